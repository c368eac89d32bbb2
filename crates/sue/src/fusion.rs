//! Several uncertainties together: a linear support vector machine.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use vpr_core::Error;

use crate::Result;

/// A rule that accepts a match if a weighted sum of its uncertainties is low enough (thesis
/// §5.2.5), learnt on one dataset and used on others.
///
/// Features are scaled to \[0, 1\] by their range in the training data.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LinearSvm {
    low: Vec<f64>,
    range: Vec<f64>,
    weights: Vec<f64>,
    intercept: f64,
}

/// How to train; the defaults are those of scikit-learn's `SGDClassifier(loss="hinge",
/// penalty="l1")`, which the thesis names.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SvmParams {
    /// Weight of the L1 penalty; 1e-4 by default.
    pub alpha: f64,
    /// Passes over the data at most; 1000 by default.
    pub max_iterations: usize,
    /// Stops when the mean objective of five passes is no better than the best by this much; 1e-3 by
    /// default, never if `None`: then the result hardly depends on the order of the samples.
    pub tolerance: Option<f64>,
    /// Seed of the order of samples (`ChaCha8`).
    pub seed: u64,
}

impl Default for SvmParams {
    fn default() -> Self {
        Self { alpha: 1e-4, max_iterations: 1000, tolerance: Some(1e-3), seed: 0 }
    }
}

/// Passes without improvement before training stops.
const PATIENCE: usize = 5;

impl LinearSvm {
    /// Trains on one feature vector per match, all of the same length, and whether it is correct.
    ///
    /// Stochastic gradient descent on the hinge loss with rate `1 / (α (t₀ + t))` (Bottou) and the
    /// cumulative L1 penalty of Tsuruoka et al. 2009, as scikit-learn does; the order of samples
    /// is our own.
    ///
    /// # Errors
    ///
    /// [`Error::Empty`] without matches or features, [`Error::Mismatch`] if lengths differ,
    /// [`Error::NotFinite`] names match and feature, [`Error::Parameter`] for `alpha` that is not
    /// positive, [`Error::Undefined`] if all matches are correct or all are wrong.
    pub fn train(features: &[Vec<f64>], correct: &[bool], params: &SvmParams) -> Result<Self> {
        let width = check(features, correct)?;
        if !(params.alpha.is_finite() && params.alpha > 0.0) {
            let (value, reason) = (params.alpha.to_string(), "must be positive and finite");
            return Err(Error::Parameter { name: "alpha", value, reason }.into());
        }
        if correct.iter().all(|&it| it == correct[0]) {
            let reason = "the training matches are all correct or all wrong";
            return Err(Error::Undefined { metric: "the support vector machine", reason }.into());
        }
        let extreme = |pick: fn(f64, f64) -> f64, start: f64| -> Vec<f64> {
            (0..width).map(|i| features.iter().map(|it| it[i]).fold(start, pick)).collect()
        };
        let (low, high) = (extreme(f64::min, f64::INFINITY), extreme(f64::max, f64::NEG_INFINITY));
        let range = low.iter().zip(&high).map(|(low, high)| high - low).collect();
        let mut svm = Self { low, range, weights: vec![0.0; width], intercept: 0.0 };
        let scaled: Vec<Vec<f64>> = features.iter().map(|it| svm.scale(it)).collect();
        svm.descend(&scaled, correct, params);
        Ok(svm)
    }

    fn descend(&mut self, scaled: &[Vec<f64>], correct: &[bool], params: &SvmParams) {
        let mut rng = ChaCha8Rng::seed_from_u64(params.seed);
        let mut order: Vec<usize> = (0..scaled.len()).collect();
        let typical = (1.0 / params.alpha.sqrt()).sqrt();
        let start = 1.0 / (typical * params.alpha);
        let (mut steps, mut penalty, mut applied) = (0.0, 0.0, vec![0.0; self.weights.len()]);
        let (mut best, mut stale) = (f64::INFINITY, 0);
        for _ in 0..params.max_iterations {
            shuffle(&mut order, &mut rng);
            let mut objective = 0.0;
            for &sample in &order {
                let sign = if correct[sample] { 1.0 } else { -1.0 };
                let margin = sign * self.sum(&scaled[sample]);
                let rate = 1.0 / (params.alpha * (start + steps));
                let size: f64 = self.weights.iter().map(|it| it.abs()).sum();
                objective += (1.0 - margin).max(0.0) + params.alpha * size;
                if margin <= 1.0 {
                    for (weight, value) in self.weights.iter_mut().zip(&scaled[sample]) {
                        *weight += rate * sign * value;
                    }
                    self.intercept += rate * sign;
                }
                penalty += rate * params.alpha;
                shrink(&mut self.weights, &mut applied, penalty);
                steps += 1.0;
            }
            let Some(tolerance) = params.tolerance else { continue };
            objective /= scaled.len() as f64;
            stale = if objective > best - tolerance { stale + 1 } else { 0 };
            best = best.min(objective);
            if stale >= PATIENCE {
                break;
            }
        }
    }

    /// Signed distance to the boundary in units of the margin; positive is accepted.
    ///
    /// # Errors
    ///
    /// [`Error::Mismatch`] if there are not as many features as in training.
    pub fn decision(&self, features: &[f64]) -> Result<f64> {
        let (expected, actual) = (self.weights.len(), features.len());
        if expected != actual {
            return Err(Error::Mismatch { what: "features of a match", expected, actual }.into());
        }
        Ok(self.sum(&self.scale(features)))
    }

    /// Share of matches that are accepted if correct and rejected if wrong.
    ///
    /// # Errors
    ///
    /// As [`Self::train`] for the input, and [`Self::decision`].
    pub fn accuracy(&self, features: &[Vec<f64>], correct: &[bool]) -> Result<f64> {
        check(features, correct)?;
        let mut n_right = 0;
        for (features, &correct) in features.iter().zip(correct) {
            n_right += usize::from((self.decision(features)? > 0.0) == correct);
        }
        Ok(n_right as f64 / correct.len() as f64)
    }

    /// The line on which `decision` is `level`, for two features in their own units: where the
    /// second feature lies for given first ones. `None` if the second does not count.
    #[must_use]
    pub fn boundary(&self, first: f64, level: f64) -> Option<f64> {
        let [a, b] = self.weights[..] else { return None };
        if b == 0.0 || self.range[0] == 0.0 {
            return None;
        }
        let first = (first - self.low[0]) / self.range[0];
        let second = (level - self.intercept - a * first) / b;
        Some(self.low[1] + second * self.range[1])
    }

    fn sum(&self, scaled: &[f64]) -> f64 {
        self.intercept + self.weights.iter().zip(scaled).map(|(a, b)| a * b).sum::<f64>()
    }

    fn scale(&self, features: &[f64]) -> Vec<f64> {
        let scaled = features.iter().zip(&self.low).zip(&self.range);
        scaled
            .map(|((it, low), range)| if *range == 0.0 { 0.0 } else { (it - low) / range })
            .collect()
    }
}

/// Draws weights towards 0 by what of the penalty so far each has not had yet.
fn shrink(weights: &mut [f64], applied: &mut [f64], penalty: f64) {
    for (weight, applied) in weights.iter_mut().zip(applied) {
        let before = *weight;
        if before > 0.0 {
            *weight = (before - (penalty + *applied)).max(0.0);
        } else if before < 0.0 {
            *weight = (before + (penalty - *applied)).min(0.0);
        }
        *applied += *weight - before;
    }
}

fn shuffle(order: &mut [usize], rng: &mut ChaCha8Rng) {
    for i in (1..order.len()).rev() {
        #[expect(clippy::cast_possible_truncation, reason = "an index")]
        let other = rng.random_range(0..=i as u64) as usize;
        order.swap(i, other);
    }
}

/// Number of features of every match.
fn check(features: &[Vec<f64>], correct: &[bool]) -> Result<usize> {
    let (expected, actual) = (features.len(), correct.len());
    if expected != actual {
        let what = "judgements, one per feature vector";
        return Err(Error::Mismatch { what, expected, actual }.into());
    }
    let width = features.first().ok_or(Error::Empty("matches"))?.len();
    if width == 0 {
        return Err(Error::Empty("features of a match").into());
    }
    for (row, features) in features.iter().enumerate() {
        let (expected, actual) = (width, features.len());
        if expected != actual {
            return Err(Error::Mismatch { what: "features of a match", expected, actual }.into());
        }
        if let Some(column) = features.iter().position(|it| !it.is_finite()) {
            let value = features[column];
            return Err(Error::NotFinite { what: "features", row, column, value }.into());
        }
    }
    Ok(width)
}
