//! How well confidence orders matches when the least certain are rejected.

use super::curve::{Step, descend};
use crate::{Error, Result};

/// Risk over coverage: what share of the accepted matches is wrong as fewer are accepted.
#[derive(Clone, Debug, PartialEq)]
pub struct RiskCoverage {
    /// Share of the queries whose match is accepted; ascends to 1.
    pub coverage: Vec<f64>,
    /// Share of wrong matches among the accepted, `1 − precision`.
    pub risk: Vec<f64>,
}

/// Risk–coverage curve of selective prediction (El-Yaniv and Wiener 2010): one point per distinct
/// confidence, highest first; equal confidences enter together.
///
/// # Errors
///
/// [`Error::Empty`] without queries, [`Error::Mismatch`] if the lengths differ,
/// [`Error::NotFinite`] if a confidence is not finite.
pub fn risk_coverage_curve(confidence: &[f64], correct: &[bool]) -> Result<RiskCoverage> {
    let steps = descend(confidence, correct)?;
    let n = confidence.len() as f64;
    Ok(RiskCoverage {
        coverage: steps.iter().map(|step| step.accepted as f64 / n).collect(),
        risk: steps.iter().map(|step| 1.0 - step.precision()).collect(),
    })
}

/// Area under the risk–coverage curve, AURC: the mean over `i = 1…n` of the risk of the `i` most
/// certain matches (Geifman, Uziel, El-Yaniv 2019, eq. 4). Lower is better.
///
/// Equal confidences count as if in random order: the expectation over all orders.
///
/// # Errors
///
/// As [`risk_coverage_curve`].
pub fn aurc(confidence: &[f64], correct: &[bool]) -> Result<f64> {
    let steps = descend(confidence, correct)?;
    let before = std::iter::once((0, 0))
        .chain(steps.iter().map(|step| (step.accepted, step.false_positives())));
    let sum: f64 = before.zip(&steps).map(|(before, step)| risk_of_group(before, step)).sum();
    Ok(sum / confidence.len() as f64)
}

/// Excess AURC: [`aurc`] minus that of a perfect order of the same matches, in which every correct
/// match is more certain than every wrong one (Geifman et al. 2019, eq. 7, with the exact optimum
/// instead of its approximation `r + (1 − r) ln(1 − r)`). 0 is perfect.
///
/// It takes out how many matches are wrong, which no estimator of uncertainty can change.
///
/// # Errors
///
/// As [`risk_coverage_curve`].
pub fn excess_aurc(confidence: &[f64], correct: &[bool]) -> Result<f64> {
    let area = aurc(confidence, correct)?;
    let n = correct.len();
    let n_correct = correct.iter().filter(|&&correct| correct).count();
    let optimum: f64 = (n_correct + 1..=n).map(|i| (i - n_correct) as f64 / i as f64).sum();
    Ok(area - optimum / n as f64)
}

/// Sum of the risks within one group of equal confidences, in expectation over its orders.
fn risk_of_group((accepted, wrong): (usize, usize), step: &Step) -> f64 {
    let size = step.accepted - accepted;
    let wrong_here = (step.false_positives() - wrong) as f64;
    let risk = |i: usize| {
        let expected = wrong as f64 + wrong_here * i as f64 / size as f64;
        expected / (accepted + i) as f64
    };
    (1..=size).map(risk).sum()
}

/// Risk when every match is accepted: the share of wrong matches, `1 −` [`accuracy`](super::accuracy).
///
/// # Errors
///
/// [`Error::Empty`] without queries.
pub fn base_risk(correct: &[bool]) -> Result<f64> {
    if correct.is_empty() {
        return Err(Error::Empty("queries"));
    }
    Ok(correct.iter().filter(|&&correct| !correct).count() as f64 / correct.len() as f64)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_hand_worked_example() {
        let (confidence, correct) = ([0.9, 0.8, 0.7, 0.6], [true, false, true, false]);
        let curve = risk_coverage_curve(&confidence, &correct).unwrap();
        assert_eq!(curve.coverage, [0.25, 0.5, 0.75, 1.0]);
        approx::assert_abs_diff_eq!(curve.risk[2], 1.0 / 3.0, epsilon = 1e-15);
        // Risks 0, 1/2, 1/3, 1/2; in perfect order 0, 0, 1/3, 1/2.
        approx::assert_abs_diff_eq!(
            aurc(&confidence, &correct).unwrap(),
            (0.5 + 1.0 / 3.0 + 0.5) / 4.0,
            epsilon = 1e-15
        );
        approx::assert_abs_diff_eq!(
            excess_aurc(&confidence, &correct).unwrap(),
            0.125,
            epsilon = 1e-15
        );
    }

    #[test]
    fn equal_confidences_are_the_mean_over_orders() {
        let correct = [true, false, true];
        let orders = [[true, true, false], [true, false, true], [false, true, true]];
        let mean = orders.iter().map(|it| aurc(&[3.0, 2.0, 1.0], it).unwrap()).sum::<f64>() / 3.0;
        approx::assert_abs_diff_eq!(aurc(&[0.5; 3], &correct).unwrap(), mean, epsilon = 1e-12);
    }

    #[test]
    fn nothing_wrong_is_no_risk() {
        assert_eq!(aurc(&[0.1, 0.2], &[true, true]).unwrap(), 0.0);
        assert_eq!(excess_aurc(&[0.1, 0.2], &[false, false]).unwrap(), 0.0);
        assert_eq!(base_risk(&[true, false]).unwrap(), 0.5);
        assert!(matches!(aurc(&[], &[]), Err(Error::Empty(_))));
        assert!(matches!(aurc(&[f64::NAN], &[true]), Err(Error::NotFinite { .. })));
    }

    proptest! {
        #[test]
        fn excess_is_never_negative_and_risk_ends_at_the_base_rate(
            matches in prop::collection::vec((0_u8..20, any::<bool>()), 1..60),
        ) {
            let confidence: Vec<f64> = matches.iter().map(|it| f64::from(it.0)).collect();
            let correct: Vec<bool> = matches.iter().map(|it| it.1).collect();
            prop_assert!(excess_aurc(&confidence, &correct).unwrap() > -1e-12);
            let curve = risk_coverage_curve(&confidence, &correct).unwrap();
            let last = curve.risk.last().copied().unwrap();
            prop_assert!((last - base_risk(&correct).unwrap()).abs() < 1e-12);
        }
    }
}
