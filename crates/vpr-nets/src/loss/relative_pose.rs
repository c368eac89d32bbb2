//! Relative-pose loss.

use burn::tensor::Tensor;

/// Relative-pose loss, `‖Δp_est − Δp_gt‖²` (thesis eq. 6.6; Laskar, Melekhov, Kalia and Kannala
/// 2017), the mean over pairs of the squared norm of their difference.
///
/// Both are `n × 7`, estimated by a regressor and true: translation (metres) and quaternion
/// (w, x, y, z) of the second camera seen from the first. The thesis writes the norm and calls it
/// the mean squared error; this is the sum over components of the latter.
#[must_use]
pub fn relative_pose(estimated: Tensor<2>, truth: Tensor<2>) -> Tensor<1> {
    (estimated - truth).square().sum_dim(1).mean()
}

#[cfg(test)]
mod tests {
    use burn::tensor::Device;

    use super::*;
    use crate::loss::check::{gradient, overfit, unit_rows};

    fn truth(n: usize) -> Tensor<2> {
        let (rows, shape) = unit_rows(n, 7, 40);
        Tensor::from_data(burn::tensor::TensorData::new(rows, shape), &Device::flex())
    }

    #[test]
    fn a_case_by_hand() {
        let rows = |rows: [[f32; 7]; 2]| Tensor::<2>::from_floats(rows, &Device::flex());
        let estimated =
            rows([[1.0, 2.0, 0.0, 1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]]);
        let truth =
            rows([[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]]);
        let loss: f32 = relative_pose(estimated, truth).into_scalar();
        assert!((loss - f32::midpoint(5.0, 3.0)).abs() < 1e-6);
    }

    #[test]
    fn its_gradient_is_that_of_finite_differences() {
        gradient(unit_rows(3, 7, 4), |rows| relative_pose(rows, truth(3)));
    }

    #[test]
    fn a_tiny_set_is_overfitted() {
        overfit(unit_rows(3, 7, 4), |rows| relative_pose(rows, truth(3)));
    }
}
