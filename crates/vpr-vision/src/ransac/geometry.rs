//! What a kind of model of two views must say of itself.

use super::Correspondence;

/// 3 × 3, row by row.
pub(super) type Matrix = [[f64; 3]; 3];

/// A kind of model of two views.
pub(super) trait Geometry {
    /// Correspondences of which a model is made.
    const SAMPLE: usize;

    /// Whether a sample can be one of inliers.
    fn is_fair(_sample: &[Correspondence]) -> bool {
        true
    }

    /// Adds the models of [`Self::SAMPLE`] correspondences; none if they are degenerate.
    fn fit(sample: &[Correspondence], models: &mut Vec<Matrix>);

    /// Adds models of all inliers, which are more than a sample.
    fn refit(inliers: &[Correspondence], models: &mut Vec<Matrix>);

    /// Whether the squared residual of (x, y) ↔ (u, v) is below a bound. Without a division, and false if anything is
    /// not finite. To be inlined.
    fn explains(model: &Matrix, x: f64, y: f64, u: f64, v: f64, below: f64) -> bool;
}
