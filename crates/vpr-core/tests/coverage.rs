//! The intervals of areas hold the truth as often as they say: a small part of the table of
//! `docs/statistics.md`, which `examples/coverage.rs` makes.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vpr_core::{Definition, Evaluation, Judged};

const SAMPLES: u32 = 600;

/// Uniform confidences: wrong matches on (0, 1), right ones on (`shift`, 1 + `shift`).
struct Model {
    base_rate: f64,
    shift: f64,
}

impl Model {
    fn draw(&self, n: usize, rng: &mut ChaCha8Rng) -> (Vec<f64>, Judged) {
        let correct: Vec<bool> = (0..n).map(|_| rng.random::<f64>() < self.base_rate).collect();
        let shift = |is_right: bool| if is_right { self.shift } else { 0.0 };
        let confidence = correct.iter().map(|&it| shift(it) + rng.random::<f64>()).collect();
        (confidence, Judged::from_flags(correct, vec![true; n]).unwrap())
    }

    /// Share of right and of wrong matches above a confidence.
    fn above(&self, at: f64) -> (f64, f64) {
        ((1.0 + self.shift - at).clamp(0.0, 1.0), (1.0 - at).clamp(0.0, 1.0))
    }

    /// The area under the precision–recall curve of all matches, by rectangles.
    fn area(&self) -> f64 {
        let steps = 20_000;
        let of = |step: u32| {
            let recall = (f64::from(step) + 0.5) / f64::from(steps);
            let (right, wrong) = self.above(1.0 + self.shift - recall);
            let right = self.base_rate * right;
            right / (right + (1.0 - self.base_rate) * wrong)
        };
        (0..steps).map(of).sum::<f64>() / f64::from(steps)
    }

    /// The chance that a right match is more certain than a wrong one.
    fn roc_area(&self) -> f64 {
        1.0 - (1.0 - self.shift).powi(2) / 2.0
    }
}

/// A share of `SAMPLES` that is `share` in truth falls below this once in a thousand times.
fn floor(share: f64) -> f64 {
    share - 3.1 * (share * (1.0 - share) / f64::from(SAMPLES)).sqrt()
}

#[test]
fn areas_of_precision_and_recall() {
    for (base_rate, n) in [
        (0.2, 50),
        (0.2, 200),
        (0.5, 50),
        (0.86, 50),
        (0.86, 200),
        (0.95, 50),
        (0.95, 200),
        (0.98, 200),
    ] {
        for shift in [0.0, 0.4, 0.8] {
            let model = Model { base_rate, shift };
            let mut rng = ChaCha8Rng::seed_from_u64(n as u64);
            let mut n_held = [0, 0];
            for _ in 0..SAMPLES {
                let (confidence, judged) = model.draw(n, &mut rng);
                let evaluation = Evaluation::of_confidence(&confidence, &judged).unwrap();
                let truths = [
                    (Definition::Published, model.area()),
                    (Definition::Corrected, model.area() * base_rate),
                ];
                for (held, (definition, truth)) in n_held.iter_mut().zip(truths) {
                    let it = evaluation.auc_pr_interval(definition).unwrap();
                    *held += u32::from(it.low <= truth && truth <= it.high);
                }
            }
            for held in n_held.map(|it| f64::from(it) / f64::from(SAMPLES)) {
                assert!(
                    held >= floor(0.93),
                    "{held} of n {n}, base rate {base_rate}, shift {shift}"
                );
            }
        }
    }
}

#[test]
fn areas_of_the_roc_curve() {
    for (base_rate, n) in [(0.1, 100), (0.5, 50), (0.5, 200), (0.9, 100)] {
        for shift in [0.0, 0.4, 0.9] {
            let model = Model { base_rate, shift };
            let mut rng = ChaCha8Rng::seed_from_u64(n as u64);
            let (mut n_held, mut n_drawn) = (0, 0);
            for _ in 0..SAMPLES {
                let (confidence, judged) = model.draw(n, &mut rng);
                let evaluation = Evaluation::of_confidence(&confidence, &judged).unwrap();
                let Ok(it) = evaluation.auc_roc_interval() else { continue };
                n_drawn += 1;
                n_held += u32::from(it.low <= model.roc_area() && model.roc_area() <= it.high);
            }
            let held = f64::from(n_held) / f64::from(n_drawn);
            assert!(held >= floor(0.93), "{held} of n {n}, base rate {base_rate}, shift {shift}");
        }
    }
}
