//! Scaling vectors to unit length, in the two ways that networks here do it.
//!
//! [`l2_normalize`] is PyTorch's `normalize`: a length below 1e-12 becomes 1e-12. Published networks
//! are trained with it, so all aggregators and backbones of theirs take it. [`l2_normalize_rows`] is
//! that of the default network and of what sits on its trunk: 1e-12 is added to the squared length,
//! and the bits are the same on every processor ([`super::portable`]). For vectors of length near 1
//! the two differ by rounding, for short ones they do not agree; neither may stand in for the other,
//! or weights no longer give the numbers they were published with.

use burn::tensor::Tensor;

use super::{
    memory::{InMemory, tensor},
    one_pass,
};

/// Smallest norm that is divided by, as in `torch.nn.functional.normalize`.
const SMALLEST_NORM: f32 = 1e-12;

/// Added to a squared length in [`l2_normalize_rows`].
const FLOOR: f32 = 1e-12;

/// Scales `x` to Euclidean norm 1 along `dim`; vectors shorter than 1e-12 are divided by 1e-12. For
/// published networks.
///
/// The bound acts on the squared norm, so that the gradient of a zero vector is zero and not NaN.
#[must_use]
pub fn l2_normalize<const D: usize>(x: Tensor<D>, dim: usize) -> Tensor<D> {
    let squared = x.clone().square().sum_dim(dim);
    let norm = squared.clamp_min(SMALLEST_NORM * SMALLEST_NORM).sqrt();
    x / norm
}

/// Rows, `n × length`, divided by √(Σ x² + 1e-12); the same bits on every processor. For the
/// default network.
#[must_use]
pub fn l2_normalize_rows(rows: Tensor<2>) -> Tensor<2> {
    let shape = rows.dims();
    if let Some(values) = InMemory::new(&rows) {
        return tensor(one_pass::unit(values.values(), shape[1], FLOOR), shape, &rows.device());
    }
    let length = (rows.clone().square().sum_dim(1) + FLOOR).sqrt();
    rows / length
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, Distribution};

    use super::*;

    fn gap(a: Tensor<2>, b: Tensor<2>) -> f32 {
        (a - b).abs().max().into_scalar()
    }

    #[test]
    fn without_gradients_is_as_with() {
        let (device, recording) = (Device::flex(), Device::flex().autodiff());
        let rows = Tensor::<2>::random([40, 19], Distribution::Normal(0.3, 2.0), &device);
        let recorded = Tensor::from_data(rows.to_data(), &recording);
        assert!(gap(l2_normalize_rows(rows), l2_normalize_rows(recorded).inner()) < 1e-5);
    }

    #[test]
    fn the_two_agree_on_long_rows_and_not_on_short_ones() {
        let device = Device::flex();
        let rows = Tensor::<2>::from_floats([[3.0, 4.0], [-0.6, 0.8]], &device);
        assert!(gap(l2_normalize(rows.clone(), 1), l2_normalize_rows(rows)) < 1e-6);
        let short = Tensor::<2>::from_floats([[3e-7, 4e-7]], &device);
        let length = |rows: Tensor<2>| rows.square().sum().sqrt().into_scalar::<f32>();
        assert!((length(l2_normalize(short.clone(), 1)) - 1.0).abs() < 1e-5);
        assert!((length(l2_normalize_rows(short)) - 0.2_f32.sqrt()).abs() < 1e-4);
    }
}
