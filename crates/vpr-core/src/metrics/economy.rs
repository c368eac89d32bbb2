//! Matching performance weighed with computation: PCU and RMF.

use super::platform::{SearchCost, Timing, check_not_negative, check_positive, retrieval_time};
use crate::{Definition, Error, Result};

/// What the encoding time of a technique is compared with in [`pcu`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EncodingReference<'a> {
    /// Published: the slowest of the techniques that happen to be compared, so that the value
    /// changes with the company (seconds, one per technique, itself included).
    SlowestOf(&'a [f64]),
    /// Corrected: a time fixed beforehand, in seconds.
    Fixed(f64),
}

/// Performance per Compute Unit: `PCU = P · log₁₀(t_ref / t_e + 9)` (VPR-Bench `compute_pcu`).
///
/// `precision` is [`precision_at_full_recall`](super::precision_at_full_recall), `encoding_time` is
/// `t_e` in seconds. A technique as slow as the reference scores its precision, one ten times
/// faster 1.28 times that.
///
/// # Errors
///
/// [`Error::Parameter`] if a time is not positive and finite or `precision` is not within 0 and 1,
/// [`Error::Empty`] if there is no technique to compare with.
pub fn pcu(precision: f64, encoding_time: f64, reference: EncodingReference<'_>) -> Result<f64> {
    if !(0.0..=1.0).contains(&precision) {
        let reason = "must be from 0 to 1";
        return Err(Error::Parameter { name: "precision", value: precision.to_string(), reason });
    }
    check_positive("encoding time", encoding_time)?;
    let reference_time = match reference {
        EncodingReference::SlowestOf([]) => return Err(Error::Empty("encoding times")),
        EncodingReference::SlowestOf(times) => {
            times.iter().try_for_each(|&time| check_positive("encoding time", time))?;
            times.iter().copied().fold(0.0, f64::max)
        }
        EncodingReference::Fixed(time) => time,
    };
    check_positive("reference encoding time", reference_time)?;
    Ok(precision * (reference_time / encoding_time + 9.0).log10())
}

/// The moving camera for which [`rmf`] is computed; the default is that of the released code.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Platform {
    /// Metres per second; 10 by default (the comment beside it says 1).
    pub speed: f64,
    /// Most frames per second that the camera gives; 50 by default.
    pub camera_fps: f64,
    /// Frames per metre of the traverse; 1 by default.
    pub frames_per_metre: f64,
    /// Down-sampling of the incoming frames; 1 by default.
    pub scaling: f64,
}

impl Default for Platform {
    fn default() -> Self {
        Self { speed: 10.0, camera_fps: 50.0, frames_per_metre: 1.0, scaling: 1.0 }
    }
}

/// What is left of a technique's correct matches when it must keep up with the platform.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RealTimeMatches {
    /// Correct matches with all the time in the world ("TMF" in VPR-Bench's summary).
    pub all: usize,
    /// Correct matches among the frames the technique has time for.
    pub real_time: usize,
}

/// Real-time Matched Frames: how many correct matches of a traverse remain when frames arrive at
/// `f = min(scaling·K·V, camera_fps)` per second and one retrieval takes `t_R` of eq. 3.6, linear.
///
/// With `r = max(f·t_R, 1)` frames passing per retrieval:
///
/// - [`Definition::Published`] (`compute_RMF`): `f` is rounded up, the map is taken to be as large as
///   the *number of queries*, `r` is truncated, and the frames looked at are 0 and every r-th
///   counted from one (r − 1, 2r − 1, …), the first two of them one frame too close.
/// - [`Definition::Corrected`]: the map has `n_references`, nothing is rounded, and a technique that
///   is free takes the newest frame: frames `⌊k·r⌋`.
///
/// # Errors
///
/// [`Error::Empty`] without queries, [`Error::Parameter`] if a time or a property of the platform is
/// negative or not finite.
pub fn rmf(
    definition: Definition,
    correct: &[bool],
    timing: Timing,
    n_references: usize,
    platform: &Platform,
) -> Result<RealTimeMatches> {
    if correct.is_empty() {
        return Err(Error::Empty("queries"));
    }
    let Platform { speed, camera_fps, frames_per_metre, scaling } = *platform;
    check_not_negative("speed", speed)?;
    check_not_negative("camera fps", camera_fps)?;
    check_not_negative("frames per metre", frames_per_metre)?;
    check_not_negative("scaling", scaling)?;
    let wanted_fps = scaling * frames_per_metre * speed;
    let looked_at = |frames: Vec<usize>| frames.iter().filter(|&&frame| correct[frame]).count();
    let real_time = match definition {
        Definition::Published => {
            let time = retrieval_time(timing, correct.len(), SearchCost::Linear)?;
            // Divided twice as released: the truncation below sees the last bit.
            let ratio = wanted_fps.ceil().min(camera_fps) / (1.0 / time);
            let stride = ratio.max(1.0).trunc();
            let due = |&frame: &usize| frame == 0 || ((frame + 1) as f64 % stride) == 0.0;
            looked_at((0..correct.len()).filter(due).collect())
        }
        Definition::Corrected => {
            let time = retrieval_time(timing, n_references, SearchCost::Linear)?;
            let stride = (wanted_fps.min(camera_fps) * time).max(1.0);
            let mut n_looked_at = 0_usize;
            let due = |&frame: &usize| {
                let due = (n_looked_at as f64 * stride).floor() <= frame as f64;
                n_looked_at += usize::from(due);
                due
            };
            looked_at((0..correct.len()).filter(due).collect())
        }
    };
    let all = correct.iter().filter(|&&correct| correct).count();
    Ok(RealTimeMatches { all, real_time })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pcu_of_the_slowest_technique_is_its_precision() {
        let times = [0.2, 2.0, 0.02];
        let published = |time| pcu(0.5, time, EncodingReference::SlowestOf(&times)).unwrap();
        assert_eq!(published(2.0), 0.5);
        approx::assert_abs_diff_eq!(published(0.2), 0.5 * 19.0_f64.log10(), epsilon = 1e-15);
        // Corrected does not change with the company.
        let fixed = pcu(0.5, 0.2, EncodingReference::Fixed(2.0)).unwrap();
        assert_eq!(fixed, published(0.2));
    }

    #[test]
    fn pcu_refuses_impossible_input() {
        let fixed = EncodingReference::Fixed(1.0);
        assert!(matches!(pcu(0.5, 0.0, fixed), Err(Error::Parameter { .. })));
        assert!(matches!(pcu(1.5, 1.0, fixed), Err(Error::Parameter { .. })));
        assert!(matches!(
            pcu(0.5, 1.0, EncodingReference::Fixed(-1.0)),
            Err(Error::Parameter { .. })
        ));
        assert!(matches!(pcu(0.5, 1.0, EncodingReference::SlowestOf(&[])), Err(Error::Empty(_))));
        let nan = EncodingReference::SlowestOf(&[f64::NAN]);
        assert!(matches!(pcu(0.5, 1.0, nan), Err(Error::Parameter { .. })));
    }

    #[test]
    fn published_rmf_is_that_of_the_released_code() {
        // compute_RMF(0.2, 0.005, matches) run in Python: 10 fps against 1 / (0.2 + 20·0.005),
        // a ratio of 3.0000000000000004, frames 0, 2, 5, 8, 11, 14, 17.
        let timing = Timing { encoding: 0.2, matching: 0.005 };
        let correct: Vec<bool> = (0..20).map(|query| query % 3 == 2 || query == 1).collect();
        let rmf = rmf(Definition::Published, &correct, timing, 9999, &Platform::default()).unwrap();
        assert_eq!(rmf, RealTimeMatches { all: 7, real_time: 6 });
    }

    #[test]
    fn corrected_rmf_takes_the_newest_frame() {
        // 10 fps, 0.25 s: 2.5 frames per retrieval, frames 0, 2, 5, 7, 10, 12, …
        let timing = Timing { encoding: 0.15, matching: 0.001 };
        let matches = |frames: &[usize]| {
            let correct: Vec<bool> = (0..20).map(|frame| frames.contains(&frame)).collect();
            rmf(Definition::Corrected, &correct, timing, 100, &Platform::default())
                .unwrap()
                .real_time
        };
        assert_eq!(matches(&[0, 2, 5, 7, 10, 12, 15, 17]), 8);
        assert_eq!(matches(&[1, 3, 4, 6, 8, 9, 11, 13, 14, 16, 18, 19]), 0);
    }

    #[test]
    fn a_fast_technique_keeps_all_its_matches() {
        let timing = Timing { encoding: 0.01, matching: 0.0 };
        for definition in [Definition::Published, Definition::Corrected] {
            let all = rmf(definition, &[true; 7], timing, 10, &Platform::default()).unwrap();
            assert_eq!(all, RealTimeMatches { all: 7, real_time: 7 });
            let none = rmf(definition, &[], timing, 10, &Platform::default());
            assert!(matches!(none, Err(Error::Empty(_))));
            let backwards = Platform { speed: -1.0, ..Platform::default() };
            let refused = rmf(definition, &[true], timing, 10, &backwards);
            assert!(matches!(refused, Err(Error::Parameter { name: "speed", .. })));
        }
    }
}
