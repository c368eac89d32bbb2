//! Precision and recall at one chosen confidence threshold.

use super::curve::{Positives, Step, descend, n_correct};
use crate::{Definition, Error, Result};

/// The largest recall at which precision is at least `precision`: `Recall@100%Precision` with 1,
/// `Recall@95%Precision` with 0.95 (thesis §3.2.4, "other metrics").
///
/// 0 if no threshold reaches the precision, as at the curve's last point (precision 1, recall 0).
/// Precision need not fall steadily with recall: of several thresholds that reach it, the lowest
/// counts.
///
/// # Errors
///
/// [`Error::Parameter`] if `precision` is not in (0, 1], and those of
/// [`precision_recall_curve`](super::precision_recall_curve).
pub fn recall_at_precision(
    precision: f64,
    confidence: &[f64],
    correct: &[bool],
    positives: Positives,
) -> Result<f64> {
    if !(precision > 0.0 && precision <= 1.0) {
        let reason = "must be above 0 and at most 1";
        return Err(Error::Parameter { name: "precision", value: precision.to_string(), reason });
    }
    let steps = descend(confidence, correct)?;
    let n_positives = positives.count("recall at a precision", n_correct(&steps))?;
    Ok(found_at_precision(precision, &steps) as f64 / n_positives as f64)
}

/// Precision where recall is as large as it gets.
///
/// - [`Definition::Published`]: at the *highest* threshold that accepts every correct match; wrong
///   matches below it are forgotten. VPR-Bench takes it for its PCU (`compute_pcu`); releases of
///   scikit-learn before 1.1 ended their curve at this point, later ones continue it and make the
///   same line select several.
/// - [`Definition::Corrected`]: with every match accepted, the share of all queries whose best match
///   is correct; "`RecallRate@1` is equal to the precision at maximum recall" (thesis, below
///   eq. 3.3). The same as [`accuracy`].
///
/// # Errors
///
/// [`Error::Empty`], [`Error::Mismatch`] and [`Error::NotFinite`] as
/// [`precision_recall_curve`](super::precision_recall_curve); `Published` also
/// [`Error::Undefined`] if no match is correct.
pub fn precision_at_full_recall(
    definition: Definition,
    confidence: &[f64],
    correct: &[bool],
) -> Result<f64> {
    let steps = descend(confidence, correct)?;
    let n_correct = n_correct(&steps);
    match definition {
        Definition::Published => {
            Positives::Published.count("precision at full recall", n_correct)?;
            let full = steps.iter().find(|step| step.true_positives == n_correct);
            Ok(full.map_or(0.0, Step::precision))
        }
        Definition::Corrected => Ok(n_correct as f64 / confidence.len() as f64),
    }
}

/// Extended Precision, `(P_R0 + R_P100) / 2`: precision at the lowest recall and the largest recall at
/// which precision is still 1 (Ferrarini et al. 2020).
///
/// `P_R0` is the precision of the matches with the highest confidence (all that share it);
/// `R_P100` is [`recall_at_precision`] 1, hence 0 whenever `P_R0` is below 1. VPR-Bench's released
/// `compute_extendedprecision` does just that: once a wrong match has entered, precision is never
/// exactly 1 again, so the first index with precision 1 is the largest such recall. The definitions
/// therefore differ only in what recall is relative to: with [`Positives::Corrected`] `R_P100` is
/// `n_correct / n_known` of the published one, `P_R0` the same. Where `P_R0` is below 1 both are
/// `P_R0 / 2`, also if no match is correct.
///
/// # Errors
///
/// As [`precision_recall_curve`](super::precision_recall_curve), except that
/// [`Positives::Published`] without a correct match gives 0, as released.
pub fn extended_precision(
    confidence: &[f64],
    correct: &[bool],
    positives: Positives,
) -> Result<f64> {
    let steps = descend(confidence, correct)?;
    let n_correct = n_correct(&steps);
    if positives == Positives::Published && n_correct == 0 {
        return Ok(0.0);
    }
    let n_positives = positives.count("extended precision", n_correct)?;
    let recall_at_one = found_at_precision(1.0, &steps) as f64 / n_positives as f64;
    Ok(f64::midpoint(steps[0].precision(), recall_at_one))
}

/// F1 score at every threshold of
/// [`precision_recall_curve`](super::precision_recall_curve), thresholds ascending.
///
/// `F1 = 2·P·R / (P + R) = 2·TP / (accepted + positives)`, scikit-learn's `f1_score` of
/// `confidence >= threshold` with [`Positives::Published`]; 0 where nothing accepted is correct. The
/// curve's last point (precision 1, recall 0) has no threshold and is left out.
///
/// # Errors
///
/// As [`precision_recall_curve`](super::precision_recall_curve).
pub fn f1_curve(confidence: &[f64], correct: &[bool], positives: Positives) -> Result<Vec<f64>> {
    let steps = descend(confidence, correct)?;
    let n_positives = positives.count("F1", n_correct(&steps))?;
    let f1 = |step: &Step| 2.0 * step.true_positives as f64 / (step.accepted + n_positives) as f64;
    Ok(steps.iter().rev().map(f1).collect())
}

/// The largest F1 score of any threshold, the maximum of [`f1_curve`].
///
/// # Errors
///
/// As [`precision_recall_curve`](super::precision_recall_curve).
pub fn f1_max(confidence: &[f64], correct: &[bool], positives: Positives) -> Result<f64> {
    Ok(f1_curve(confidence, correct, positives)?.into_iter().fold(0.0, f64::max))
}

/// Share of all queries whose best match is correct (VPR-Bench `compute_accuracy`).
///
/// New places count as wrong, whatever was retrieved for them. Equals `RecallRate@1`.
///
/// # Errors
///
/// [`Error::Empty`] without queries.
pub fn accuracy(correct: &[bool]) -> Result<f64> {
    if correct.is_empty() {
        return Err(Error::Empty("queries"));
    }
    Ok(correct.iter().filter(|&&correct| correct).count() as f64 / correct.len() as f64)
}

/// The most true positives at any threshold with at least this precision.
fn found_at_precision(precision: f64, steps: &[Step]) -> usize {
    let reaching = steps.iter().rev().find(|step| step.precision() >= precision);
    reaching.map_or(0, |step| step.true_positives)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIDENCE: [f64; 6] = [0.9, 0.8, 0.7, 0.6, 0.5, 0.4];
    const CORRECT: [bool; 6] = [true, true, false, true, true, false];
    const KNOWN: Positives = Positives::Corrected { n_known: 5 };

    #[test]
    fn the_lowest_threshold_that_reaches_the_precision_counts() {
        let recall = |p| recall_at_precision(p, &CONFIDENCE, &CORRECT, KNOWN).unwrap();
        assert_eq!(recall(1.0), 0.4);
        // Precision falls to 2/3 and rises to 4/5 again.
        assert_eq!(recall(0.8), 0.8);
        assert_eq!(recall(0.81), 0.4);
        let first_wrong = recall_at_precision(1.0, &[0.9, 0.8], &[false, true], KNOWN);
        assert_eq!(first_wrong.unwrap(), 0.0);
        let bad = recall_at_precision(0.0, &CONFIDENCE, &CORRECT, KNOWN);
        assert!(matches!(bad, Err(Error::Parameter { name: "precision", .. })));
    }

    #[test]
    fn nineteen_of_twenty_are_95_percent() {
        let confidence: Vec<f64> = (0..20_u8).map(f64::from).collect();
        let correct: Vec<bool> = (0..20).map(|query| query != 7).collect();
        let recall = recall_at_precision(0.95, &confidence, &correct, Positives::Published);
        assert_eq!(recall.unwrap(), 1.0);
    }

    #[test]
    fn published_precision_at_full_recall_forgets_the_last_wrong_matches() {
        let precision = |definition| precision_at_full_recall(definition, &CONFIDENCE, &CORRECT);
        assert_eq!(precision(Definition::Published).unwrap(), 0.8);
        assert_eq!(precision(Definition::Corrected).unwrap(), 4.0 / 6.0);
        assert_eq!(accuracy(&CORRECT).unwrap(), 4.0 / 6.0);
        let none = precision_at_full_recall(Definition::Published, &CONFIDENCE, &[false; 6]);
        assert!(matches!(none, Err(Error::Undefined { .. })));
        let none = precision_at_full_recall(Definition::Corrected, &CONFIDENCE, &[false; 6]);
        assert_eq!(none.unwrap(), 0.0);
        assert!(matches!(accuracy(&[]), Err(Error::Empty(_))));
    }

    #[test]
    fn extended_precision_differs_by_the_denominator_of_recall_only() {
        let ep = |correct: &[bool], positives| extended_precision(&CONFIDENCE, correct, positives);
        assert_eq!(ep(&CORRECT, Positives::Published).unwrap(), f64::midpoint(1.0, 0.5));
        assert_eq!(ep(&CORRECT, KNOWN).unwrap(), f64::midpoint(1.0, 0.4));
        let wrong_first = [false, true, true, true, true, true];
        assert_eq!(ep(&wrong_first, Positives::Published).unwrap(), 0.0);
        assert_eq!(ep(&[false; 6], Positives::Published).unwrap(), 0.0);
        assert_eq!(ep(&[true; 6], Positives::Published).unwrap(), 1.0);
        // Two share the highest confidence, one of them is wrong.
        let tied = extended_precision(&[0.9, 0.9, 0.1], &[true, false, true], Positives::Published);
        assert_eq!(tied.unwrap(), 0.25);
    }

    #[test]
    fn f1_is_the_harmonic_mean_of_precision_and_recall() {
        let curve = f1_curve(&CONFIDENCE, &CORRECT, KNOWN).unwrap();
        let points = super::super::precision_recall_curve(&CONFIDENCE, &CORRECT, KNOWN).unwrap();
        assert_eq!(curve.len(), points.thresholds.len());
        for ((f1, p), r) in curve.iter().zip(&points.precision).zip(&points.recall) {
            approx::assert_abs_diff_eq!(*f1, 2.0 * p * r / (p + r), epsilon = 1e-15);
        }
        assert_eq!(f1_max(&CONFIDENCE, &CORRECT, KNOWN).unwrap(), 0.8);
        assert_eq!(f1_max(&CONFIDENCE, &[false; 6], KNOWN).unwrap(), 0.0);
    }
}
