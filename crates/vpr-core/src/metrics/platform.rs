//! How long a retrieval takes, and how fast a platform may move meanwhile.

use crate::{Error, Result};

/// The times of one technique on one machine, in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// `t_e`: encoding one query image, everything included.
    pub encoding: f64,
    /// `t_m`: matching one query descriptor with one reference descriptor.
    pub matching: f64,
}

/// `O(Z)` of thesis eq. 3.6: how many descriptors a search compares in a map of `Z` references.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum SearchCost {
    /// All of them, `Z`, as every technique of VPR-Bench and the thesis' figure 3.18.
    #[default]
    Linear,
    /// `⌊log₂ Z⌋ + 1`, the depth of a balanced tree.
    Logarithmic,
}

impl SearchCost {
    /// Number of comparisons for a map of this size; 0 for an empty map.
    #[must_use]
    pub fn comparisons(self, n_references: usize) -> f64 {
        match self {
            Self::Linear => n_references as f64,
            Self::Logarithmic => {
                n_references.checked_ilog2().map_or(0.0, |log| f64::from(log) + 1.0)
            }
        }
    }
}

/// Seconds to encode a query and match it with the map: `t_R = t_e + O(Z)·t_m`, thesis eq. 3.6.
///
/// `1 / t_R` is the thesis' `FPS_VPR`.
///
/// # Errors
///
/// [`Error::Parameter`] if a time is negative or not finite.
pub fn retrieval_time(timing: Timing, n_references: usize, search: SearchCost) -> Result<f64> {
    check_not_negative("encoding time", timing.encoding)?;
    check_not_negative("matching time", timing.matching)?;
    Ok(timing.encoding + search.comparisons(n_references) * timing.matching)
}

/// Retrievals per second a platform needs: `FPS_req = K·V`, thesis eq. 3.7, with `frames_per_metre`
/// (`K`, may be fractional) and `speed` (`V`) in metres per second.
///
/// # Errors
///
/// [`Error::Parameter`] if a value is negative or not finite.
pub fn required_fps(frames_per_metre: f64, speed: f64) -> Result<f64> {
    check_not_negative("frames per metre", frames_per_metre)?;
    check_not_negative("speed", speed)?;
    Ok(frames_per_metre * speed)
}

/// The highest speed, in metres per second, a technique can serve: `V = 1 / (t_R·K)`, where
/// `FPS_VPR = FPS_req`; every speed from 0 to this one is within its range (figure 3.18).
///
/// The thesis' sentence on that range says `FPS_VPR ≤ FPS_req`, which would be the speeds that are
/// too fast; this is the other side.
///
/// # Errors
///
/// [`Error::Parameter`] if a value is not positive and finite.
pub fn speed_limit(retrieval_time: f64, frames_per_metre: f64) -> Result<f64> {
    check_positive("retrieval time", retrieval_time)?;
    check_positive("frames per metre", frames_per_metre)?;
    Ok(1.0 / (retrieval_time * frames_per_metre))
}

/// Refuses what is not a finite number of at least zero.
pub(super) fn check_not_negative(name: &'static str, value: f64) -> Result<()> {
    if value.is_finite() && value >= 0.0 {
        return Ok(());
    }
    let reason = "must be finite and not negative";
    Err(Error::Parameter { name, value: value.to_string(), reason })
}

/// Refuses what is not a finite number above zero.
pub(super) fn check_positive(name: &'static str, value: f64) -> Result<()> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    let reason = "must be finite and above zero";
    Err(Error::Parameter { name, value: value.to_string(), reason })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIMING: Timing = Timing { encoding: 0.5, matching: 0.001 };

    #[test]
    fn retrieval_grows_with_the_map() {
        let time = |n, search| retrieval_time(TIMING, n, search).unwrap();
        assert_eq!(time(0, SearchCost::Linear), 0.5);
        assert_eq!(time(500, SearchCost::Linear), 1.0);
        assert_eq!(time(0, SearchCost::Logarithmic), 0.5);
        assert_eq!(time(1, SearchCost::Logarithmic), 0.501);
        assert_eq!(time(1024, SearchCost::Logarithmic), 0.511);
    }

    #[test]
    fn at_the_speed_limit_the_required_rate_is_met_exactly() {
        let limit = speed_limit(0.25, 0.5).unwrap();
        assert_eq!(limit, 8.0);
        assert_eq!(required_fps(0.5, limit).unwrap(), 1.0 / 0.25);
    }

    #[test]
    fn impossible_times_are_refused() {
        let negative = retrieval_time(Timing { encoding: -1.0, ..TIMING }, 1, SearchCost::Linear);
        assert!(matches!(negative, Err(Error::Parameter { name: "encoding time", .. })));
        let nan = retrieval_time(Timing { matching: f64::NAN, ..TIMING }, 1, SearchCost::Linear);
        assert!(matches!(nan, Err(Error::Parameter { name: "matching time", .. })));
        assert!(matches!(speed_limit(0.0, 1.0), Err(Error::Parameter { .. })));
        assert!(matches!(required_fps(1.0, f64::INFINITY), Err(Error::Parameter { .. })));
    }
}
