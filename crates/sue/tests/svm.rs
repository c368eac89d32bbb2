//! The linear SVM against scikit-learn's `SGDClassifier` on the same features.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{fs, path::Path};

use serde::Deserialize;
use sue::fusion::{LinearSvm, SvmParams};

#[derive(Deserialize)]
struct Case {
    train: Vec<Vec<f64>>,
    train_labels: Vec<bool>,
    test: Vec<Vec<f64>>,
    test_labels: Vec<bool>,
    accuracy: Accuracy,
}

#[derive(Deserialize)]
struct Accuracy {
    stopped: [f64; 2],
    full: [f64; 2],
}

fn cases() -> Vec<Case> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/golden/sue/svm.json");
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// Mean accuracy over seeds on training and test data.
///
/// A stopped descent depends on the order of samples, so both sides are means over many orders.
fn accuracy(case: &Case, tolerance: Option<f64>) -> [f64; 2] {
    let n_seeds = if tolerance.is_some() { 400 } else { 5 };
    let mut sums = [0.0; 2];
    for seed in 0..n_seeds {
        let params = SvmParams { tolerance, seed, ..SvmParams::default() };
        let svm = LinearSvm::train(&case.train, &case.train_labels, &params).unwrap();
        sums[0] += svm.accuracy(&case.train, &case.train_labels).unwrap();
        sums[1] += svm.accuracy(&case.test, &case.test_labels).unwrap();
    }
    sums.map(|sum| sum / n_seeds as f64)
}

#[test]
fn accuracy_is_that_of_scikit_learn() {
    for (number, case) in cases().iter().enumerate() {
        for (name, tolerance, expected) in
            [("stopped", Some(1e-3), case.accuracy.stopped), ("full", None, case.accuracy.full)]
        {
            let actual = accuracy(case, tolerance);
            for (actual, expected) in actual.iter().zip(expected) {
                let off = (actual - expected).abs();
                assert!(off <= 0.01, "set {number}, {name}: {actual}, scikit-learn {expected}");
            }
        }
    }
}

#[test]
fn the_boundary_is_where_the_decision_is_zero() {
    let case = &cases()[1];
    let params = SvmParams { tolerance: None, ..SvmParams::default() };
    let svm = LinearSvm::train(&case.train, &case.train_labels, &params).unwrap();
    let second = svm.boundary(1.5, 0.0).unwrap();
    assert!(svm.decision(&[1.5, second]).unwrap().abs() < 1e-9);
}

#[test]
fn wrong_features_are_named() {
    let params = SvmParams::default();
    let err = |features: &[Vec<f64>], correct: &[bool]| {
        LinearSvm::train(features, correct, &params).unwrap_err().to_string()
    };
    assert!(err(&[], &[]).contains("no matches"));
    assert!(err(&[vec![1.0]], &[true, false]).contains("expected 1, got 2"));
    assert!(err(&[vec![1.0], vec![f64::NAN]], &[true, false]).contains("row 1, column 0"));
    assert!(err(&[vec![1.0], vec![2.0]], &[true, true]).contains("all correct or all wrong"));
}
