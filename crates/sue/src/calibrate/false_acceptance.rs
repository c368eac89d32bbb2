//! Split conformal: how often a wrong match may be accepted.

use std::fmt;

use serde::Serialize;
use vpr_core::Error;

use super::{check_queries, check_share};
use crate::{Result, Threshold};

/// A threshold that wrong matches rarely pass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FalseAcceptance {
    /// Matches below are accepted.
    pub threshold: Threshold,
    /// Largest chance that a wrong match is accepted.
    pub rate: f64,
    /// Number of wrong matches it rests on.
    pub n_wrong: usize,
    /// Share of the correct calibration matches that are accepted.
    pub kept: f64,
}

/// Chooses the largest threshold that a new *wrong* match passes with probability at most `rate`
/// (split conformal prediction, Vovk et al. 2005; the wrong calibration matches are the
/// calibration set).
///
/// With `m` wrong matches the threshold is the `⌊rate · (m + 1)⌋`-th smallest of their
/// uncertainties, and nothing is accepted if that is the zeroth. The chance is over the
/// calibration queries as well as the new one.
///
/// # Errors
///
/// [`Error::Parameter`] for a rate outside of (0, 1), [`Error::Empty`], [`Error::Mismatch`] and
/// [`Error::NotFinite`] for the queries, [`Error::Undefined`] if no match is wrong.
pub fn calibrate_false_acceptance(
    uncertainty: &[f64],
    correct: &[bool],
    rate: f64,
) -> Result<FalseAcceptance> {
    check_share("rate", rate)?;
    check_queries(uncertainty, correct)?;
    let of = |wanted: bool| -> Vec<f64> {
        uncertainty.iter().zip(correct).filter(|it| *it.1 == wanted).map(|it| *it.0).collect()
    };
    let (mut wrong, right) = (of(false), of(true));
    if wrong.is_empty() {
        let reason = "no calibration match is wrong";
        return Err(Error::Undefined { metric: "the false acceptance rate", reason }.into());
    }
    wrong.sort_unstable_by(f64::total_cmp);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a rank")]
    let rank = (rate * (wrong.len() + 1) as f64 + 1e-9).floor() as usize;
    // Below the (rank)-th smallest are rank − 1 of m: at most a share rate of m + 1 places.
    let threshold = match rank {
        0 => Threshold::NOTHING,
        rank => Threshold::below(wrong[rank.min(wrong.len()) - 1])?,
    };
    let n_kept = right.iter().filter(|&&it| threshold.accepts(it)).count();
    let kept = n_kept as f64 / right.len().max(1) as f64;
    Ok(FalseAcceptance { threshold, rate, n_wrong: wrong.len(), kept })
}

impl fmt::Display for FalseAcceptance {
    /// The guarantee in words.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.threshold == Threshold::NOTHING {
            return write!(
                f,
                "{} wrong matches are too few for a false acceptance rate of {}: nothing is accepted.",
                self.n_wrong, self.rate
            );
        }
        write!(
            f,
            "{}: a wrong match passes with probability at most {}, whatever the \
             distribution, if new queries are exchangeable with the calibration queries. \
             {:.1} % of the correct calibration matches pass.",
            self.threshold.rule(),
            self.rate,
            100.0 * self.kept
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rank_is_conformal() {
        let uncertainty: Vec<f64> = (0..39).map(f64::from).collect();
        let result = calibrate_false_acceptance(&uncertainty, &[false; 39], 0.05).unwrap();
        assert_eq!(result.threshold.limit(), 1.0, "floor(0.05 · 40) = 2: the second smallest");
        let few = calibrate_false_acceptance(&uncertainty[..18], &[false; 18], 0.05).unwrap();
        assert_eq!(few.threshold, Threshold::NOTHING);
        assert!(few.to_string().contains("too few"), "{few}");
    }

    #[test]
    fn no_wrong_match_has_no_rate() {
        assert!(calibrate_false_acceptance(&[1.0], &[true], 0.1).is_err());
        assert!(calibrate_false_acceptance(&[1.0], &[false], 1.0).is_err());
    }
}
