//! Metrics against scikit-learn: the golden cases, and what must hold for any input.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a test fails by panicking and says what it skips"
)]

use std::{fs, path::PathBuf};

use proptest::prelude::*;
use serde::Deserialize;
use vpr_core::{
    Definition, Error,
    metrics::{
        Positives, accuracy, auc_pr, auc_roc, average_precision, extended_precision, f1_max,
        precision_at_full_recall, precision_recall_curve, recall_at_precision, roc_curve,
    },
};

const TOLERANCE: f64 = 1e-12;

#[derive(Deserialize)]
struct Golden {
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    kind: String,
    correct: Vec<u8>,
    score: Vec<f64>,
    precision: Vec<f64>,
    recall: Vec<f64>,
    thresholds: Vec<f64>,
    auc_pr_trapezoid: Option<f64>,
    average_precision: Option<f64>,
    auc_roc: Option<f64>,
    fpr: Option<Vec<f64>>,
    tpr: Option<Vec<f64>>,
}

impl Case {
    fn correct(&self) -> Vec<bool> {
        self.correct.iter().map(|&correct| correct == 1).collect()
    }
}

fn cases() -> Vec<Case> {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let text = fs::read_to_string(root.join("../../data/golden/metrics/metrics.json"))
        .expect("the golden file is in the repository");
    serde_json::from_str::<Golden>(&text).expect("the golden file is valid").cases
}

fn assert_near(what: &str, actual: &[f64], expected: &[f64]) {
    assert_eq!(actual.len(), expected.len(), "{what}: length");
    for (index, (a, e)) in actual.iter().zip(expected).enumerate() {
        assert!((a - e).abs() <= TOLERANCE, "{what}[{index}]: {a} instead of {e}");
    }
}

/// A value where scikit-learn has one, [`Error::Undefined`] where the golden file has `null`.
fn assert_value_or_undefined(what: &str, actual: vpr_core::Result<f64>, expected: Option<f64>) {
    match (actual, expected) {
        (Ok(actual), Some(expected)) => assert_near(what, &[actual], &[expected]),
        (Err(Error::Undefined { .. }), None) => {}
        (actual, expected) => panic!("{what}: {actual:?} instead of {expected:?}"),
    }
}

#[test]
fn all_nine_kinds_are_there() {
    let kinds: Vec<String> = cases().into_iter().map(|case| case.kind).collect();
    let expected =
        "one ties normal heavy_ties separable all_wrong all_right negative_scores constant";
    assert_eq!(kinds.join(" "), expected);
}

#[test]
fn precision_recall_curves_are_scikit_learns() {
    for case in cases() {
        let (kind, correct) = (&case.kind, case.correct());
        let published = precision_recall_curve(&case.score, &correct, Positives::Published);
        let curve = if correct.contains(&true) {
            let curve = published.unwrap();
            assert_near(&format!("{kind}: recall"), &curve.recall, &case.recall);
            curve
        } else {
            // scikit-learn warns and writes a recall of 1; here it is undefined, and 0 of a given
            // number of known places.
            assert!(matches!(published, Err(Error::Undefined { .. })), "{kind}: {published:?}");
            let known = Positives::Corrected { n_known: 1 };
            let curve = precision_recall_curve(&case.score, &correct, known).unwrap();
            assert!(curve.recall.iter().all(|&recall| recall == 0.0));
            curve
        };
        assert_near(&format!("{kind}: precision"), &curve.precision, &case.precision);
        assert_near(&format!("{kind}: thresholds"), &curve.thresholds, &case.thresholds);
    }
}

#[test]
fn areas_are_scikit_learns_or_undefined() {
    for case in cases() {
        let (kind, score, correct) = (&case.kind, &case.score, case.correct());
        let area = auc_pr(score, &correct, Positives::Published);
        assert_value_or_undefined(&format!("{kind}: AUC-PR"), area, case.auc_pr_trapezoid);
        let average = average_precision(score, &correct, Positives::Published);
        assert_value_or_undefined(&format!("{kind}: AP"), average, case.average_precision);
        let roc = auc_roc(score, &correct);
        assert_value_or_undefined(&format!("{kind}: AUC-ROC"), roc, case.auc_roc);
    }
}

#[test]
fn roc_curves_are_scikit_learns_or_undefined() {
    for case in cases() {
        let (kind, correct) = (&case.kind, case.correct());
        match (roc_curve(&case.score, &correct), &case.fpr, &case.tpr) {
            (Ok(curve), Some(fpr), Some(tpr)) => {
                assert_near(&format!("{kind}: FPR"), &curve.fpr, fpr);
                assert_near(&format!("{kind}: TPR"), &curve.tpr, tpr);
                assert_eq!(curve.thresholds.len(), fpr.len());
            }
            (Err(Error::Undefined { .. }), None, None) => {}
            (curve, ..) => panic!("{kind}: {curve:?}"),
        }
    }
}

/// Best matches with many ties, at least one query, and a count of known queries above the correct.
fn matches() -> impl Strategy<Value = (Vec<f64>, Vec<bool>, Positives)> {
    let query = (-20_i8..20, any::<bool>());
    (prop::collection::vec(query, 1..60), 1_usize..20).prop_map(|(queries, n_missed)| {
        let (confidence, correct): (Vec<f64>, Vec<bool>) =
            queries.into_iter().map(|(level, correct)| (f64::from(level) / 4.0, correct)).unzip();
        let n_known = correct.iter().filter(|&&correct| correct).count() + n_missed;
        (confidence, correct, Positives::Corrected { n_known })
    })
}

/// Every metric of one confidence and one judgement per query; `None` where it is undefined.
fn all_metrics(confidence: &[f64], correct: &[bool], positives: Positives) -> Vec<Option<f64>> {
    let values = [
        auc_pr(confidence, correct, positives),
        average_precision(confidence, correct, positives),
        extended_precision(confidence, correct, positives),
        f1_max(confidence, correct, positives),
        recall_at_precision(1.0, confidence, correct, positives),
        recall_at_precision(0.95, confidence, correct, positives),
        precision_at_full_recall(Definition::Published, confidence, correct),
        auc_roc(confidence, correct),
        precision_at_full_recall(Definition::Corrected, confidence, correct),
    ];
    let defined = |value| match value {
        Ok(value) => Some(value),
        Err(Error::Undefined { .. }) => None,
        Err(err) => panic!("{err}"),
    };
    values.into_iter().map(defined).collect()
}

proptest! {
    #[test]
    fn every_value_is_between_0_and_1((confidence, correct, corrected) in matches()) {
        for positives in [Positives::Published, corrected] {
            for value in all_metrics(&confidence, &correct, positives).into_iter().flatten() {
                prop_assert!((0.0..=1.0 + TOLERANCE).contains(&value), "{value}");
            }
        }
    }

    #[test]
    fn the_order_of_the_queries_does_not_matter(
        ((confidence, correct, positives), shift) in (matches(), 0_usize..60),
    ) {
        let mut queries: Vec<(f64, bool)> =
            confidence.iter().copied().zip(correct.iter().copied()).collect();
        let n_queries = queries.len();
        queries.rotate_left(shift % n_queries);
        queries.reverse();
        let (moved_confidence, moved_correct): (Vec<f64>, Vec<bool>) = queries.into_iter().unzip();
        prop_assert_eq!(
            all_metrics(&confidence, &correct, positives),
            all_metrics(&moved_confidence, &moved_correct, positives)
        );
    }

    #[test]
    fn only_the_order_of_the_confidences_matters((confidence, correct, positives) in matches()) {
        let stretched: Vec<f64> = confidence.iter().map(|value| value.exp() * 3.0 - 7.0).collect();
        prop_assert_eq!(
            all_metrics(&confidence, &correct, positives),
            all_metrics(&stretched, &correct, positives)
        );
    }

    #[test]
    fn published_is_never_below_corrected((confidence, correct, positives) in matches()) {
        let published = all_metrics(&confidence, &correct, Positives::Published);
        let corrected = all_metrics(&confidence, &correct, positives);
        for (published, corrected) in published.into_iter().zip(corrected).take(6) {
            if let (Some(published), Some(corrected)) = (published, corrected) {
                prop_assert!(published >= corrected, "{published} < {corrected}");
            }
        }
        let full = precision_at_full_recall(Definition::Published, &confidence, &correct);
        if let Ok(full) = full {
            prop_assert!(full >= accuracy(&correct).unwrap());
        }
    }

    #[test]
    fn a_perfect_ranking_is_perfect(n_right in 1_u8..30, n_wrong in 1_u8..30) {
        let confidence: Vec<f64> = (0..n_right + n_wrong).rev().map(f64::from).collect();
        let correct: Vec<bool> = (0..n_right + n_wrong).map(|query| query < n_right).collect();
        let values = all_metrics(&confidence, &correct, Positives::Published);
        for value in values.into_iter().take(8) {
            prop_assert!((value.unwrap() - 1.0).abs() <= TOLERANCE);
        }
    }

    #[test]
    fn auc_roc_is_the_share_of_pairs_in_the_right_order((confidence, correct, _) in matches()) {
        let of = |class: bool| -> Vec<f64> {
            let judged = confidence.iter().zip(&correct);
            judged.filter(|(_, correct)| **correct == class).map(|(value, _)| *value).collect()
        };
        let (right, wrong) = (of(true), of(false));
        let won = |r: f64, w: f64| f64::midpoint(f64::from(u8::from(r > w)), f64::from(u8::from(r >= w)));
        let n_won: f64 = right.iter().flat_map(|&r| wrong.iter().map(move |&w| won(r, w))).sum();
        let n_pairs = right.len() * wrong.len();
        if let Ok(area) = auc_roc(&confidence, &correct) {
            prop_assert!((area - n_won / n_pairs as f64).abs() <= TOLERANCE);
        } else {
            prop_assert_eq!(n_pairs, 0);
        }
    }
}
