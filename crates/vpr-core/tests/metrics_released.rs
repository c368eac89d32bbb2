//! Published definitions against the released VPR-Bench functions, run on random traverses.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a test fails by panicking and says what it skips"
)]

use std::{fs, path::PathBuf};

use serde::Deserialize;
use vpr_core::{
    Definition, Error,
    metrics::{
        Platform, Positives, RealTimeMatches, Timing, area_between_curves, extended_precision, rmf,
        true_positive_spacing,
    },
};

#[derive(Deserialize)]
struct Golden {
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    correct: Vec<u8>,
    confidence: Vec<f64>,
    encoding: f64,
    matching: f64,
    speed: f64,
    camera_fps: f64,
    frames_per_metre: f64,
    scaling: f64,
    all: usize,
    real_time: usize,
    spacing: Option<Vec<usize>>,
    extended_precision: f64,
    same: Option<Vec<f64>>,
    other: Option<Vec<f64>>,
    abc: Option<f64>,
}

impl Case {
    fn correct(&self) -> Vec<bool> {
        self.correct.iter().map(|&correct| correct == 1).collect()
    }
}

fn cases() -> Vec<Case> {
    let file = "../../data/golden/metrics/released.json";
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(file);
    let text = fs::read_to_string(path).expect("the golden file is in the repository");
    let golden: Golden = serde_json::from_str(&text).expect("the golden file is valid");
    assert_eq!(golden.cases.len(), 40);
    golden.cases
}

#[test]
fn rmf_is_the_released_one() {
    for case in cases() {
        let timing = Timing { encoding: case.encoding, matching: case.matching };
        let platform = Platform {
            speed: case.speed,
            camera_fps: case.camera_fps,
            frames_per_metre: case.frames_per_metre,
            scaling: case.scaling,
        };
        // The number of references is not looked at.
        let actual = rmf(Definition::Published, &case.correct(), timing, 7, &platform).unwrap();
        assert_eq!(actual, RealTimeMatches { all: case.all, real_time: case.real_time });
    }
}

#[test]
fn spacing_is_the_released_one_and_undefined_where_that_crashes() {
    for case in cases() {
        match (true_positive_spacing(Definition::Published, &case.correct()), &case.spacing) {
            (Ok(actual), Some(expected)) => assert_eq!(&actual, expected),
            (Err(Error::Undefined { .. }), None) => {}
            (actual, expected) => panic!("{actual:?} instead of {expected:?}"),
        }
    }
}

#[test]
fn extended_precision_is_the_released_one() {
    for case in cases() {
        let correct = case.correct();
        let actual = extended_precision(&case.confidence, &correct, Positives::Published).unwrap();
        assert!((actual - case.extended_precision).abs() <= 1e-12);
    }
}

#[test]
fn area_between_curves_is_shapelys() {
    for case in cases() {
        if let (Some(same), Some(other), Some(expected)) = (&case.same, &case.other, case.abc) {
            let actual = area_between_curves(Definition::Published, same, other).unwrap();
            assert!((actual - expected).abs() <= 1e-12, "{actual} instead of {expected}");
        }
    }
}
