//! Scaling vectors to unit length.

use burn::tensor::Tensor;

/// Smallest norm that is divided by, as in `torch.nn.functional.normalize`.
const SMALLEST_NORM: f32 = 1e-12;

/// Scales `x` to Euclidean norm 1 along `dim`; vectors shorter than 1e-12 are divided by 1e-12.
///
/// The bound acts on the squared norm, so that the gradient of a zero vector is zero and not NaN.
#[must_use]
pub fn normalize<const D: usize>(x: Tensor<D>, dim: usize) -> Tensor<D> {
    let squared = x.clone().square().sum_dim(dim);
    let norm = squared.clamp_min(SMALLEST_NORM * SMALLEST_NORM).sqrt();
    x / norm
}
