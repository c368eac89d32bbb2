//! SUE as released, against two independent transcriptions of the script's formulas.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{fs, path::Path};

use ndarray::Array2;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;
use sue::{DistanceKind, Error, Places, Sue, SueDefinition, SueParams, UncertaintyEstimator};
use vpr_core::{PlanarPosition, Poses, Retrieval};

/// One query as the script sees it.
struct Case {
    distances: Vec<f32>,
    positions: Vec<[f64; 2]>,
    lambda: f64,
    clip: f64,
}

impl Case {
    /// The query's neighbours as a map of their own, in rank order, and one reference far away that
    /// is not ranked.
    fn estimate(&self, definition: SueDefinition) -> Result<f64, Error> {
        let k = self.distances.len();
        let mut places: Vec<_> =
            self.positions.iter().map(|it| PlanarPosition::new(it[0], it[1])).collect();
        places.push(PlanarPosition::new(-1e6, 3e6));
        let indices = Array2::from_shape_fn((1, k), |(_, rank)| rank);
        let distances = Array2::from_shape_vec((1, k), self.distances.clone()).unwrap();
        let retrieval = Retrieval::new(indices, distances).unwrap();
        let distance = DistanceKind::Squared;
        let params =
            SueParams { k, lambda: self.lambda, distance, clip_m: Some(self.clip), definition };
        let poses = Poses::Planar(places);
        let places = Places::from_poses(&retrieval, &poses)?;
        Ok(Sue::new(params)?.estimate(&places)?[0])
    }

    /// The released formulas, step by step and with the script's own order of operations.
    fn transcribed(&self) -> Option<f64> {
        let raw: Vec<f64> = self
            .distances
            .iter()
            .map(|&d| std::f64::consts::E.powf(-(f64::from(d) * f64::from(d)).abs() * self.lambda))
            .collect();
        let sum = raw.iter().sum::<f64>();
        let weights: Vec<f64> = raw.iter().map(|w| w / sum).collect();
        if weights.iter().any(|w| w.is_nan()) {
            return None;
        }
        let mean = |axis: usize| {
            let weighted: f64 = weights.iter().zip(&self.positions).map(|(w, p)| w * p[axis]).sum();
            weighted / weights.iter().sum::<f64>()
        };
        let variance = |axis: usize| -> f64 {
            let centre = mean(axis);
            let difference = |p: &[f64; 2]| self.clip.min(p[axis] - centre);
            weights.iter().zip(&self.positions).map(|(w, p)| w * difference(p).powi(2)).sum()
        };
        Some(f64::midpoint(variance(0), variance(1)))
    }
}

/// Within 1e-9, relative to the value where it is above one.
fn assert_near(value: f64, expected: f64, what: &str) {
    let tolerance = 1e-9 * expected.abs().max(1.0);
    assert!((value - expected).abs() <= tolerance, "{what}: {value} is not {expected}");
}

#[expect(clippy::cast_possible_truncation, reason = "distances are f32")]
fn random_case(rng: &mut ChaCha8Rng) -> Case {
    let k = rng.random_range(1..=20);
    let scale = 10_f64.powf(rng.random_range(-4.0..2.0));
    let mut distances: Vec<f32> =
        (0..k).map(|_| (scale * rng.random_range(0.05..1.0)) as f32).collect();
    if rng.random_bool(0.3) {
        let tied = distances[0];
        distances.iter_mut().step_by(2).for_each(|it| *it = tied);
    }
    distances.sort_by(f32::total_cmp);
    let spread = 10_f64.powf(rng.random_range(-2.0..6.0));
    let mut positions: Vec<[f64; 2]> = (0..k)
        .map(|_| [spread * rng.random_range(-1.0..1.0), spread * rng.random_range(-1.0..1.0)])
        .collect();
    match rng.next_u32() % 4 {
        0 => positions.fill([12.5, -3.0]),
        1 => positions.iter_mut().step_by(3).for_each(|it| *it = [0.25, 0.5]),
        _ => {}
    }
    let lambda = [0.01, 1.0, 10.0, 350.0][rng.random_range(0..4)];
    Case { distances, positions, lambda, clip: [500.0, 1e9][rng.random_range(0..2)] }
}

#[test]
fn a_thousand_random_queries_agree_with_the_transcription() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let (mut compared, mut refused) = (0, 0);
    for number in 0..1000 {
        let case = random_case(&mut rng);
        match (case.transcribed(), case.estimate(SueDefinition::Published)) {
            (Some(expected), value) => {
                assert_near(value.unwrap(), expected, &format!("case {number}"));
                compared += 1;
            }
            (None, Err(Error::Underflow { query: 0, .. })) => {
                assert!(case.estimate(SueDefinition::Corrected).unwrap().is_finite());
                refused += 1;
            }
            (None, value) => panic!("case {number}: the script gives NaN, ours {value:?}"),
        }
    }
    assert!(compared > 700 && refused > 20, "{compared} compared, {refused} refused");
}

#[test]
fn numpy_agrees() {
    #[derive(Deserialize)]
    struct Golden {
        distances: Vec<f32>,
        positions: Vec<[f64; 2]>,
        lambda: f64,
        clip: f64,
        expected: Option<f64>,
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/golden/sue/sue.json");
    let cases: Vec<Golden> = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
    assert!(cases.iter().filter(|it| it.expected.is_none()).count() >= 3);
    for (number, golden) in cases.into_iter().enumerate() {
        let Golden { distances, positions, lambda, clip, expected } = golden;
        let case = Case { distances, positions, lambda, clip };
        match (expected, case.estimate(SueDefinition::Published)) {
            (Some(expected), value) => assert_near(value.unwrap(), expected, &number.to_string()),
            (None, value) => assert!(matches!(value, Err(Error::Underflow { .. })), "{number}"),
        }
    }
}

#[test]
fn more_neighbours_than_references_is_refused_where_the_script_fails() {
    let indices = Array2::from_shape_fn((1, 3), |(_, rank)| rank);
    let distances = Array2::from_shape_fn((1, 3), |(_, rank)| rank as f32);
    let retrieval = Retrieval::new(indices, distances).unwrap();
    let poses = Poses::Planar((0..3).map(|x| PlanarPosition::new(f64::from(x), 0.0)).collect());
    let places = Places::from_poses(&retrieval, &poses).unwrap();
    for sue in [Sue::published(), Sue::thesis(), Sue::corrected()] {
        let err = sue.estimate(&places).unwrap_err();
        assert!(matches!(err, Error::TooFewNeighbors { needed: 10, available: 3, .. }), "{err}");
    }
}

#[test]
fn one_reference_is_certain() {
    let case =
        Case { distances: vec![0.3], positions: vec![[5.0, 6.0]], lambda: 350.0, clip: 500.0 };
    assert_eq!(case.estimate(SueDefinition::Published).unwrap(), 0.0);
    assert_eq!(case.estimate(SueDefinition::Corrected).unwrap(), 0.0);
}
