//! Multi-similarity loss with mining in the batch.

use burn::tensor::{Tensor, TensorData};

/// Multi-similarity loss (Wang, Han, Huang, Dong and Scott, CVPR 2019, eqs. 11–16), as GSV-Cities
/// trains with it:
///
/// 1/n Σᵢ ( 1/α log(1 + Σ₊ exp(−α (s − λ))) + 1/β log(1 + Σ₋ exp(β (s − λ))) )
///
/// where s are the similarities of image i to the mined images of its own place (+) and of other
/// places (−). Mined are negatives more similar than the least similar positive less ε, and
/// positives less similar than the most similar negative plus ε.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MultiSimilarity {
    /// Sharpness over positives.
    pub alpha: f64,
    /// Sharpness over negatives.
    pub beta: f64,
    /// Similarity at which a pair counts one.
    pub lambda: f64,
    /// Margin of the mining.
    pub epsilon: f64,
}

impl Default for MultiSimilarity {
    /// The values of GSV-Cities: α 1, β 50, λ 0, ε 0.1.
    fn default() -> Self {
        Self { alpha: 1.0, beta: 50.0, lambda: 0.0, epsilon: 0.1 }
    }
}

impl MultiSimilarity {
    /// The loss of unit rows `n × d` of which row i shows the place `places[i]`. Zero where
    /// nothing is mined.
    ///
    /// # Panics
    ///
    /// If there are not as many places as rows.
    #[must_use]
    pub fn forward(&self, descriptors: Tensor<2>, places: &[usize]) -> Tensor<1> {
        let n = places.len();
        assert_eq!(descriptors.dims()[0], n, "one place a descriptor");
        let similarities = descriptors.clone().matmul(descriptors.transpose());
        let device = similarities.device();
        let values: Vec<f32> = similarities.clone().detach().into_data().iter::<f32>().collect();
        let (positives, negatives) = self.mine(&values, places);
        let mask = |mask: Vec<f32>| Tensor::<2>::from_data(TensorData::new(mask, [n, n]), &device);
        let above = similarities - self.lambda;
        let near = (above.clone() * -self.alpha).exp() * mask(positives);
        let far = (above * self.beta).exp() * mask(negatives);
        let near = near.sum_dim(1).log1p() / self.alpha;
        let far = far.sum_dim(1).log1p() / self.beta;
        (near + far).mean()
    }

    /// Which pairs count, as two `n × n` masks of zeros and ones.
    fn mine(&self, similarities: &[f32], places: &[usize]) -> (Vec<f32>, Vec<f32>) {
        let n = places.len();
        let (mut positives, mut negatives) = (vec![0.0; n * n], vec![0.0; n * n]);
        for i in 0..n {
            let row = &similarities[i * n..(i + 1) * n];
            let same = |j: usize| places[j] == places[i];
            let least =
                (0..n).filter(|&j| j != i && same(j)).map(|j| row[j]).fold(f32::INFINITY, f32::min);
            let most =
                (0..n).filter(|&j| !same(j)).map(|j| row[j]).fold(f32::NEG_INFINITY, f32::max);
            for j in (0..n).filter(|&j| j != i) {
                if same(j) && f64::from(row[j]) - self.epsilon < f64::from(most) {
                    positives[i * n + j] = 1.0;
                }
                if !same(j) && f64::from(row[j]) + self.epsilon > f64::from(least) {
                    negatives[i * n + j] = 1.0;
                }
            }
        }
        (positives, negatives)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loss::check::{gradient, overfit, unit_rows};

    #[test]
    fn a_case_by_hand() {
        // Two places of two images in the plane; every pair is mined.
        let rows = [[1.0_f32, 0.0], [0.6, 0.8], [0.8, 0.6], [0.0, 1.0]];
        let descriptors = Tensor::<2>::from_floats(rows, &burn::tensor::Device::flex());
        let places = [0, 0, 1, 1];
        let loss = MultiSimilarity { epsilon: 2.0, ..MultiSimilarity::default() };
        let dot = |a: [f32; 2], b: [f32; 2]| f64::from(a[0] * b[0] + a[1] * b[1]);
        let mut expected = 0.0;
        for i in 0..4 {
            let far: f64 = (0..4)
                .filter(|&j| places[j] != places[i])
                .map(|j| (50.0 * dot(rows[i], rows[j])).exp())
                .sum();
            let other = i ^ 1;
            let near = (-dot(rows[i], rows[other])).exp();
            expected += (near.ln_1p() + far.ln_1p() / 50.0) / 4.0;
        }
        let got = f64::from(loss.forward(descriptors, &places).into_scalar::<f32>());
        assert!((got - expected).abs() < 1e-5, "{got} {expected}");
    }

    #[test]
    fn only_hard_pairs_are_mined() {
        let loss = MultiSimilarity::default();
        // Image 0: positive at .9, negatives at .3 and .85.
        let row = [1.0, 0.9, 0.3, 0.85];
        let mut similarities = vec![0.0; 16];
        similarities[..4].copy_from_slice(&row);
        let (positives, negatives) = loss.mine(&similarities, &[0, 0, 1, 2]);
        assert_eq!(positives[..4], [0.0, 1.0, 0.0, 0.0]);
        assert_eq!(negatives[..4], [0.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn its_gradient_is_that_of_finite_differences() {
        let loss = MultiSimilarity { beta: 5.0, epsilon: 4.0, ..MultiSimilarity::default() };
        let places = [0, 0, 1, 1, 2, 2];
        gradient(unit_rows(6, 5, 1), |rows| loss.forward(rows, &places));
    }

    #[test]
    fn a_tiny_set_is_overfitted() {
        overfit(unit_rows(6, 8, 2), |rows| {
            let lengths = rows.clone().square().sum_dim(1).sqrt();
            MultiSimilarity::default().forward(rows / lengths, &[0, 0, 1, 1, 2, 2])
        });
    }

    #[test]
    fn a_place_without_company_and_an_easy_batch_cost_nothing() {
        let rows =
            Tensor::<2>::from_floats([[1.0, 0.0], [0.0, 1.0]], &burn::tensor::Device::flex());
        let loss: f32 = MultiSimilarity::default().forward(rows, &[0, 1]).into_scalar();
        assert_eq!(loss, 0.0);
    }
}
