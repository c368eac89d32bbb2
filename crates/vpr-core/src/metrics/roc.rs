//! True-positive rate over false-positive rate.

use super::{
    area::auc,
    curve::{Step, descend, n_correct},
};
use crate::{Definition, Error, GroundTruth, Result};

/// A receiver operating characteristic in scikit-learn's layout: thresholds descend from ∞.
#[derive(Clone, Debug, PartialEq)]
pub struct RocCurve {
    /// Share of the negatives at or above each threshold; ascends from 0 to 1.
    pub fpr: Vec<f64>,
    /// Share of the positives at or above each threshold; ascends from 0 to 1.
    pub tpr: Vec<f64>,
    /// The thresholds; the first is ∞, where nothing is accepted.
    pub thresholds: Vec<f64>,
}

/// Which queries are the positives of the ROC curve.
///
/// - [`Definition::Published`]: those whose best match is correct, so that the negatives are the
///   *wrong retrievals* (VPR-Bench, `performance_comparison`).
/// - [`Definition::Corrected`]: those that have a correct reference at all, so that the negatives are
///   the *new places*, as thesis eq. 3.4 and 3.5 and the text around them say. Only datasets with
///   added new places have any.
///
/// # Errors
///
/// [`Error::Mismatch`] if there is not one best reference per query.
pub fn roc_positives(
    definition: Definition,
    best: &[usize],
    truth: &GroundTruth,
) -> Result<Vec<bool>> {
    let correct = truth.judge(best)?;
    Ok(match definition {
        Definition::Published => correct,
        Definition::Corrected => (0..truth.len()).map(|query| !truth.is_new_place(query)).collect(),
    })
}

/// The ROC curve: `TPR = TP / (TP + FN)` over `FPR = FP / (FP + TN)`, thesis eq. 3.4 and 3.5.
///
/// A query is accepted if its confidence is at least the threshold; see [`roc_positives`] for which
/// queries are positive. Equal confidences enter together. The layout is scikit-learn 1.9's
/// `roc_curve` with `drop_intermediate=True`: points that lie on a straight line between their
/// neighbours with equal steps are left out.
///
/// # Errors
///
/// [`Error::Empty`], [`Error::Mismatch`], [`Error::NotFinite`] as
/// [`precision_recall_curve`](super::precision_recall_curve); [`Error::Undefined`] if all queries are
/// positive or all are negative (scikit-learn warns and gives NaN, VPR-Bench −1).
pub fn roc_curve(confidence: &[f64], positive: &[bool]) -> Result<RocCurve> {
    let steps = descend(confidence, positive)?;
    let n_positives = n_correct(&steps);
    let n_negatives = positive.len() - n_positives;
    let undefined = |reason| Err(Error::Undefined { metric: "the ROC curve", reason });
    if n_positives == 0 {
        return undefined("no query is positive");
    }
    if n_negatives == 0 {
        return undefined("no query is negative");
    }
    let corners = corners(&steps);
    let share = |count: usize, of: usize| count as f64 / of as f64;
    let rates = |count: fn(&Step) -> usize, of: usize| -> Vec<f64> {
        [0.0].into_iter().chain(corners.iter().map(|step| share(count(step), of))).collect()
    };
    Ok(RocCurve {
        fpr: rates(Step::false_positives, n_negatives),
        tpr: rates(|step| step.true_positives, n_positives),
        thresholds: [f64::INFINITY]
            .into_iter()
            .chain(corners.iter().map(|step| step.threshold))
            .collect(),
    })
}

/// Area under [`roc_curve`] by trapezoids: the chance that a positive is more certain than a
/// negative, ties counting half. scikit-learn's `roc_auc_score`.
///
/// # Errors
///
/// As [`roc_curve`].
pub fn auc_roc(confidence: &[f64], positive: &[bool]) -> Result<f64> {
    let curve = roc_curve(confidence, positive)?;
    auc(&curve.fpr, &curve.tpr)
}

/// The first step, the last, and those where the counts do not grow as much as at the next one.
fn corners(steps: &[Step]) -> Vec<Step> {
    let inner = steps.windows(3).filter_map(|near| {
        let grows = |count: fn(&Step) -> usize| {
            (count(&near[1]) - count(&near[0]), count(&near[2]) - count(&near[1]))
        };
        let (before, after) = grows(Step::false_positives);
        let (right_before, right_after) = grows(|step| step.true_positives);
        (before != after || right_before != right_after).then_some(near[1])
    });
    let last = if steps.len() > 1 { steps.last() } else { None };
    steps.first().copied().into_iter().chain(inner).chain(last.copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn straight_runs_keep_their_ends_only() {
        let confidence = [0.9, 0.8, 0.7, 0.6, 0.5, 0.4];
        let positive = [true, true, true, false, false, false];
        let curve = roc_curve(&confidence, &positive).unwrap();
        assert_eq!(curve.fpr, [0.0, 0.0, 0.0, 1.0]);
        assert_eq!(curve.tpr, [0.0, 1.0 / 3.0, 1.0, 1.0]);
        assert_eq!(curve.thresholds, [f64::INFINITY, 0.9, 0.7, 0.4]);
        assert_eq!(auc_roc(&confidence, &positive).unwrap(), 1.0);
    }

    #[test]
    fn equal_confidences_separate_nothing() {
        let curve = roc_curve(&[0.5; 4], &[true, false, true, true]).unwrap();
        assert_eq!((curve.fpr, curve.tpr), (vec![0.0, 1.0], vec![0.0, 1.0]));
        assert_eq!(auc_roc(&[0.5; 4], &[true, false, true, true]).unwrap(), 0.5);
    }

    #[test]
    fn one_class_has_no_curve() {
        for class in [true, false] {
            assert!(matches!(auc_roc(&[0.1, 0.2], &[class; 2]), Err(Error::Undefined { .. })));
        }
    }

    #[test]
    fn corrected_positives_are_the_known_places() {
        let truth = GroundTruth::from_lists(vec![vec![0], vec![1], vec![]], 2).unwrap();
        let positives = |definition| roc_positives(definition, &[0, 0, 1], &truth).unwrap();
        assert_eq!(positives(Definition::Published), [true, false, false]);
        assert_eq!(positives(Definition::Corrected), [true, true, false]);
    }
}
