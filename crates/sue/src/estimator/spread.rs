//! Weighted spread of positions, the core of all spatial estimators.

use nalgebra::Vector3;
use ndarray::ArrayView1;
use vpr_core::Poses;

/// Turns logarithms of weights into weights relative to the largest; false if all are `−∞`.
pub(super) fn exponentiate(log_weights: &mut [f64]) -> bool {
    let largest = log_weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    for weight in log_weights.iter_mut() {
        *weight = (*weight - largest).exp();
    }
    largest > f64::NEG_INFINITY
}

/// Trace of the weighted covariance of the positions of `references`, `Σ w ‖p − μ‖² / Σ w` with
/// `μ = Σ w p / Σ w` (thesis eqs. 5.1 and 5.2), metres²; NaN if all weights are 0.
///
/// Positions are taken relative to the best reference, so that coordinates of any size (UTM) keep
/// their digits, and by West's update, so that nothing cancels.
pub(super) fn weighted_spread(
    references: ArrayView1<'_, usize>,
    poses: &Poses,
    weights: &[f64],
) -> f64 {
    let origin = poses.position(references[0]);
    let (mut total, mut mean, mut square) = (0.0, Vector3::zeros(), 0.0);
    for (&reference, &weight) in references.iter().zip(weights) {
        if weight > 0.0 {
            let position: Vector3<f64> = poses.position(reference) - origin;
            total += weight;
            let step = position - mean;
            mean += step * (weight / total);
            square += weight * step.dot(&(position - mean));
        }
    }
    (square / total).max(0.0)
}

/// The same with differences of coordinates clipped to `±clip`, about the unclipped mean.
pub(super) fn clipped_spread(
    references: ArrayView1<'_, usize>,
    poses: &Poses,
    weights: &[f64],
    clip: f64,
) -> f64 {
    let origin = poses.position(references[0]);
    let relative = |reference: usize| -> Vector3<f64> { poses.position(reference) - origin };
    let total: f64 = weights.iter().sum();
    let mut mean = Vector3::zeros();
    for (&reference, &weight) in references.iter().zip(weights) {
        mean += relative(reference) * (weight / total);
    }
    let square = |(&reference, &weight): (&usize, &f64)| {
        let difference = (relative(reference) - mean).map(|it| it.clamp(-clip, clip));
        weight / total * difference.norm_squared()
    };
    references.iter().zip(weights).map(square).sum()
}

/// The released script's form of the same: planar, weights divided by their sum before use,
/// differences clipped from above only, and half of the trace (`sue.py` lines 96–130; S-1, S-3);
/// NaN if all weights are 0 (S-4).
pub(super) fn released_spread(
    references: ArrayView1<'_, usize>,
    poses: &Poses,
    weights: &mut [f64],
    clip: f64,
) -> f64 {
    let total: f64 = weights.iter().map(|weight| weight.abs()).sum();
    for weight in weights.iter_mut() {
        *weight /= total;
    }
    // NumPy's average divides by the sum of the weights once more.
    let sum: f64 = weights.iter().sum();
    let (mut x, mut y) = (0.0, 0.0);
    for (&reference, &weight) in references.iter().zip(&*weights) {
        let position = poses.position(reference);
        x += weight * position.x;
        y += weight * position.y;
    }
    let (x, y) = (x / sum, y / sum);
    let (mut along_x, mut along_y) = (0.0, 0.0);
    for (&reference, &weight) in references.iter().zip(&*weights) {
        let position = poses.position(reference);
        let (dx, dy) = (clip.min(position.x - x), clip.min(position.y - y));
        along_x += weight * dx * dx;
        along_y += weight * dy * dy;
    }
    f64::midpoint(along_x, along_y)
}
