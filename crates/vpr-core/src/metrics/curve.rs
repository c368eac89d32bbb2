//! Precision and recall over the confidence threshold, and the area under that curve.

use super::area::{auc, check_finite};
use crate::{Error, GroundTruth, Result};

/// What recall is relative to: the denominator of thesis eq. 3.2.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Positives {
    /// The queries whose best reference is correct, as released VPR-Bench counts
    /// (`performance_comparison.py`, `compute_precision_recall`): recall always reaches 1, however
    /// few queries that is.
    Published,
    /// The queries that have a correct reference in the map ([`GroundTruth::n_known`]): the largest
    /// recall is `RecallRate@1` of these queries.
    Corrected {
        /// Number of queries with a correct reference.
        n_known: usize,
    },
}

impl Positives {
    /// [`Positives::Corrected`] for a ground truth.
    #[must_use]
    pub fn corrected(truth: &GroundTruth) -> Self {
        Self::Corrected { n_known: truth.n_known() }
    }

    /// The denominator, if it is not zero.
    ///
    /// # Errors
    ///
    /// [`Error::Undefined`] if it is zero, [`Error::Parameter`] if fewer queries have a correct
    /// reference than were matched correctly.
    pub(super) fn count(self, metric: &'static str, n_correct: usize) -> Result<usize> {
        let undefined = |reason| Err(Error::Undefined { metric, reason });
        match self {
            Self::Published if n_correct == 0 => undefined("no best match is correct"),
            Self::Published => Ok(n_correct),
            Self::Corrected { n_known: 0 } => undefined("no query has a correct reference"),
            Self::Corrected { n_known } if n_known < n_correct => Err(Error::Parameter {
                name: "n_known",
                value: n_known.to_string(),
                reason: "fewer queries have a correct reference than were matched correctly",
            }),
            Self::Corrected { n_known } => Ok(n_known),
        }
    }
}

/// A precision–recall curve in scikit-learn's layout: thresholds ascend, so recall descends.
#[derive(Clone, Debug, PartialEq)]
pub struct PrecisionRecall {
    /// Precision of the matches at or above each threshold, then a last 1 without a threshold.
    pub precision: Vec<f64>,
    /// Recall of the matches at or above each threshold, then a last 0 without a threshold.
    pub recall: Vec<f64>,
    /// The distinct confidences, ascending; one shorter than the other two.
    pub thresholds: Vec<f64>,
}

/// Precision and recall (thesis eq. 3.1 and 3.2) of the matches at or above every confidence.
///
/// `precision = TP / (TP + FP)` and `recall = TP / P`, where TP and FP are the correct and wrong best
/// matches with at least the threshold's confidence and P is what [`Positives`] says. Equal
/// confidences enter together (0 and −0 are equal). With [`Positives::Published`] this is
/// scikit-learn 1.9's `precision_recall_curve`, all thresholds kept, with the last point (1, 0).
///
/// # Errors
///
/// [`Error::Empty`] without queries, [`Error::Mismatch`] if the lengths differ,
/// [`Error::NotFinite`] if a confidence is not finite, [`Error::Undefined`] if there is no positive
/// (scikit-learn warns and sets recall to 1), [`Error::Parameter`] if `n_known` is below the number
/// of correct matches.
pub fn precision_recall_curve(
    confidence: &[f64],
    correct: &[bool],
    positives: Positives,
) -> Result<PrecisionRecall> {
    let steps = descend(confidence, correct)?;
    let n_positives = positives.count("the precision-recall curve", n_correct(&steps))? as f64;
    let ascending = || steps.iter().rev();
    Ok(PrecisionRecall {
        precision: ascending().map(Step::precision).chain([1.0]).collect(),
        recall: ascending()
            .map(|step| step.true_positives as f64 / n_positives)
            .chain([0.0])
            .collect(),
        thresholds: ascending().map(|step| step.threshold).collect(),
    })
}

/// Area under the precision–recall curve by trapezoids, AUC-PR of the thesis.
///
/// scikit-learn's `auc(recall, precision)` of [`precision_recall_curve`], as VPR-Bench
/// (`compute_auc_PR`). The first trapezoid starts at the artificial point (recall 0, precision 1);
/// lines between points of this curve are not achievable by any classifier, so this is not
/// [`average_precision`], and with all confidences equal it is `(1 + share of correct) / 2`.
/// With [`Positives::Corrected`] the area ends at the largest recall and is the published one times
/// `n_correct / n_known`.
///
/// # Errors
///
/// As [`precision_recall_curve`].
pub fn auc_pr(confidence: &[f64], correct: &[bool], positives: Positives) -> Result<f64> {
    let curve = precision_recall_curve(confidence, correct, positives)?;
    auc(&curve.recall, &curve.precision)
}

/// Average precision, `Σ (Rₙ − Rₙ₋₁)·Pₙ` over falling thresholds: the area without interpolation.
///
/// With [`Positives::Published`] this is scikit-learn's `average_precision_score`. One correct or
/// wrong best match per query; for all correct references of a query see
/// [`mean_average_precision`](super::mean_average_precision).
///
/// # Errors
///
/// As [`precision_recall_curve`] (without a positive scikit-learn warns and gives 0).
pub fn average_precision(
    confidence: &[f64],
    correct: &[bool],
    positives: Positives,
) -> Result<f64> {
    let curve = precision_recall_curve(confidence, correct, positives)?;
    let drops = curve.recall.windows(2).zip(&curve.precision);
    Ok(drops.map(|(recall, precision)| (recall[0] - recall[1]) * precision).sum())
}

/// The matches at or above one threshold.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    /// The lowest confidence that is accepted.
    pub(super) threshold: f64,
    /// How many of the accepted matches are correct.
    pub(super) true_positives: usize,
    /// How many matches are accepted; at least one.
    pub(super) accepted: usize,
}

impl Step {
    /// Share of the accepted matches that are correct.
    pub(super) fn precision(&self) -> f64 {
        self.true_positives as f64 / self.accepted as f64
    }

    /// How many of the accepted matches are wrong.
    pub(super) fn false_positives(&self) -> usize {
        self.accepted - self.true_positives
    }
}

/// One step per distinct confidence, highest first; never empty.
pub(super) fn descend(confidence: &[f64], correct: &[bool]) -> Result<Vec<Step>> {
    if confidence.len() != correct.len() {
        let what = "judgements, one per confidence";
        return Err(Error::Mismatch { what, expected: confidence.len(), actual: correct.len() });
    }
    if confidence.is_empty() {
        return Err(Error::Empty("queries"));
    }
    check_finite("confidences", confidence)?;
    let mut ranked: Vec<(f64, bool)> =
        confidence.iter().copied().zip(correct.iter().copied()).collect();
    // Adding zero makes −0 a 0, so that equal numbers are neighbours in the total order.
    ranked.sort_by(|a, b| (b.0 + 0.0).total_cmp(&(a.0 + 0.0)));

    let (mut true_positives, mut accepted) = (0, 0);
    let steps = ranked.chunk_by(|a, b| a.0 == b.0).map(|tied| {
        true_positives += tied.iter().filter(|(_, correct)| *correct).count();
        accepted += tied.len();
        Step { threshold: tied[0].0, true_positives, accepted }
    });
    Ok(steps.collect())
}

/// Number of correct matches of all.
pub(super) fn n_correct(steps: &[Step]) -> usize {
    steps.last().map_or(0, |step| step.true_positives)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIDENCE: [f64; 5] = [0.9, 0.8, 0.8, 0.4, 0.1];
    const CORRECT: [bool; 5] = [true, true, false, false, true];

    #[test]
    fn ties_enter_together() {
        let curve = precision_recall_curve(&CONFIDENCE, &CORRECT, Positives::Published).unwrap();
        assert_eq!(curve.thresholds, [0.1, 0.4, 0.8, 0.9]);
        assert_eq!(curve.precision, [0.6, 0.5, 2.0 / 3.0, 1.0, 1.0]);
        assert_eq!(curve.recall, [1.0, 2.0 / 3.0, 2.0 / 3.0, 1.0 / 3.0, 0.0]);
    }

    #[test]
    fn zero_and_minus_zero_are_one_threshold() {
        let confidence = [0.0, -0.0, 0.0, -1.0];
        let curve =
            precision_recall_curve(&confidence, &[true, false, true, true], Positives::Published);
        assert_eq!(curve.unwrap().thresholds, [-1.0, 0.0]);
    }

    #[test]
    fn corrected_recall_ends_at_the_share_of_known_queries() {
        let positives = Positives::Corrected { n_known: 6 };
        let curve = precision_recall_curve(&CONFIDENCE, &CORRECT, positives).unwrap();
        assert_eq!(curve.recall, [0.5, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0, 0.0]);
        let published = auc_pr(&CONFIDENCE, &CORRECT, Positives::Published).unwrap();
        let corrected = auc_pr(&CONFIDENCE, &CORRECT, positives).unwrap();
        approx::assert_abs_diff_eq!(corrected, published / 2.0, epsilon = 1e-15);
    }

    #[test]
    fn without_a_positive_there_is_no_curve() {
        let none = [false; 5];
        let published = auc_pr(&CONFIDENCE, &none, Positives::Published);
        assert!(matches!(published, Err(Error::Undefined { .. })));
        let unknown = auc_pr(&CONFIDENCE, &none, Positives::Corrected { n_known: 0 });
        assert!(matches!(unknown, Err(Error::Undefined { .. })));
        // Three known places and none found is a value: zero.
        let missed = Positives::Corrected { n_known: 3 };
        assert_eq!(auc_pr(&CONFIDENCE, &none, missed).unwrap(), 0.0);
        assert_eq!(average_precision(&CONFIDENCE, &none, missed).unwrap(), 0.0);
    }

    #[test]
    fn wrong_input_is_refused() {
        let published = Positives::Published;
        assert!(matches!(auc_pr(&[], &[], published), Err(Error::Empty(_))));
        let short = auc_pr(&CONFIDENCE, &CORRECT[1..], published);
        assert!(matches!(short, Err(Error::Mismatch { expected: 5, actual: 4, .. })));
        let nan = auc_pr(&[1.0, f64::NAN], &[true, false], published);
        assert!(matches!(nan, Err(Error::NotFinite { row: 1, .. })));
        let few = auc_pr(&CONFIDENCE, &CORRECT, Positives::Corrected { n_known: 2 });
        assert!(matches!(few, Err(Error::Parameter { name: "n_known", .. })));
    }
}
