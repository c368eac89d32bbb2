//! Gaussian random projection: fewer values, distances kept on average.

use burn::tensor::{Device, Tensor, TensorData};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A fixed random matrix with entries from N(0, 1 / to), as scikit-learn's `GaussianRandomProjection`.
///
/// Johnson and Lindenstrauss (1984); Dasgupta, *Experiments with Random Projection* (2000).
/// The numbers come from a seed (`ChaCha8`, Box–Muller), not from scikit-learn's generator.
#[derive(Clone, Debug)]
pub struct GaussianProjection {
    /// `from × to`.
    matrix: Tensor<2>,
}

impl GaussianProjection {
    /// A projection from `from` to `to` values.
    #[expect(clippy::cast_possible_truncation, reason = "weights are f32")]
    #[must_use]
    pub fn new(from: usize, to: usize, seed: u64, device: &Device) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let scale = 1.0 / (to as f64).sqrt();
        let mut values = Vec::with_capacity(from * to + 1);
        while values.len() < from * to {
            let radius = scale * (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
            let (sin, cos) = (std::f64::consts::TAU * rng.random::<f64>()).sin_cos();
            values.extend([(radius * cos) as f32, (radius * sin) as f32]);
        }
        values.truncate(from * to);
        Self { matrix: Tensor::from_data(TensorData::new(values, [from, to]), device) }
    }

    /// The matrix `numpy.random.seed(seed); numpy.random.randn(to, from)`, as VPR-Bench's AlexNet draws
    /// it: not divided by `√to`, which unit descriptors do not see.
    #[expect(clippy::cast_possible_truncation, reason = "weights are f32")]
    #[must_use]
    pub fn as_numpy(from: usize, to: usize, seed: u32, device: &Device) -> Self {
        let mut normal = super::mersenne::Normal::new(seed);
        let values: Vec<f32> = (0..to * from).map(|_| normal.draw() as f32).collect();
        let matrix = Tensor::<2>::from_data(TensorData::new(values, [to, from]), device);
        Self { matrix: matrix.transpose() }
    }

    /// `batch × from` to `batch × to`, not normalised.
    #[must_use]
    pub fn forward(&self, descriptors: Tensor<2>) -> Tensor<2> {
        descriptors.matmul(self.matrix.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_stay_on_average_and_the_seed_decides() {
        let device = Device::flex();
        let identity = Tensor::<2>::eye(300, &device);
        let rows =
            |seed| GaussianProjection::new(300, 400, seed, &device).forward(identity.clone());
        let squared: f32 = rows(1).square().sum_dim(1).mean().into_scalar();
        assert!((squared - 1.0).abs() < 0.01, "{squared}");
        let bits = |seed| rows(seed).into_data().try_to_vec::<f32>().unwrap();
        assert_eq!(bits(1), bits(1));
        assert_ne!(bits(1), bits(2));
    }
}
