//! Supervised contrastive loss.

use burn::tensor::{Tensor, TensorData, activation::log_softmax};

/// Supervised contrastive loss (Khosla, Teterwak, Wang et al., `NeurIPS` 2020, eq. 2), which is
/// `InfoNCE` with every image of a batch in turn as the query:
///
/// 1/n Σᵢ 1/|P(i)| Σ₊ −log( exp(s₊ / τ) / Σⱼ exp(sⱼ / τ) )
///
/// where s are the similarities of image i to all others of the batch and + runs over P(i), those
/// of its own place. Images without company are left out of the mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SupervisedContrastive {
    /// Temperature τ: the smaller, the more the hardest pairs count.
    pub temperature: f64,
}

impl Default for SupervisedContrastive {
    /// τ 0.07.
    fn default() -> Self {
        Self { temperature: 0.07 }
    }
}

impl SupervisedContrastive {
    /// The loss of unit rows `n × d` of which row i shows the place `places[i]`. Zero where no
    /// two images share a place.
    ///
    /// # Panics
    ///
    /// If there are not as many places as rows.
    #[must_use]
    pub fn forward(&self, descriptors: Tensor<2>, places: &[usize]) -> Tensor<1> {
        let n = places.len();
        assert_eq!(descriptors.dims()[0], n, "one place a descriptor");
        let device = descriptors.device();
        let matrix = |values| Tensor::<2>::from_data(TensorData::new(values, [n, n]), &device);
        let itself =
            (0..n * n).map(|k| if k / n == k % n { -1e9 } else { 0.0 }).collect::<Vec<f32>>();
        let similarities = descriptors.clone().matmul(descriptors.transpose());
        let logits = similarities / self.temperature + matrix(itself);
        (log_softmax(logits, 1) * matrix(shares(places))).sum().neg()
    }
}

/// What each pair counts, `n × n`; all pairs that count sum to one.
fn shares(places: &[usize]) -> Vec<f32> {
    let n = places.len();
    let company: Vec<usize> =
        places.iter().map(|place| places.iter().filter(|it| *it == place).count() - 1).collect();
    let queries = company.iter().filter(|&&count| count > 0).count();
    (0..n * n)
        .map(|k| {
            let (i, j) = (k / n, k % n);
            if i != j && places[i] == places[j] { 1.0 / (queries * company[i]) as f32 } else { 0.0 }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loss::check::{gradient, overfit, unit_rows};

    #[test]
    fn a_case_by_hand() {
        // A place of three images, one of two, and one without company.
        let rows = [[1.0_f32, 0.0], [0.6, 0.8], [0.8, 0.6], [0.0, 1.0], [-0.6, 0.8], [-1.0, 0.0]];
        let places = [0, 0, 0, 1, 1, 2];
        let dot = |a: [f32; 2], b: [f32; 2]| f64::from(a[0] * b[0] + a[1] * b[1]);
        let mut expected = 0.0;
        for i in 0..5 {
            let others: Vec<usize> = (0..6).filter(|&j| j != i).collect();
            let total: f64 = others.iter().map(|&j| (dot(rows[i], rows[j]) / 0.5).exp()).sum();
            let own: Vec<f64> = others
                .iter()
                .filter(|&&j| places[j] == places[i])
                .map(|&j| total.ln() - dot(rows[i], rows[j]) / 0.5)
                .collect();
            expected += own.iter().sum::<f64>() / own.len() as f64 / 5.0;
        }
        let descriptors = Tensor::<2>::from_floats(rows, &burn::tensor::Device::flex());
        let loss = SupervisedContrastive { temperature: 0.5 };
        let got = f64::from(loss.forward(descriptors, &places).into_scalar::<f32>());
        assert!((got - expected).abs() < 1e-5, "{got} {expected}");
    }

    #[test]
    fn its_gradient_is_that_of_finite_differences() {
        let loss = SupervisedContrastive { temperature: 0.5 };
        gradient(unit_rows(6, 5, 1), |rows| loss.forward(rows, &[0, 0, 1, 1, 1, 2]));
    }

    #[test]
    fn a_tiny_set_is_overfitted() {
        overfit(unit_rows(6, 8, 2), |rows| {
            let lengths = rows.clone().square().sum_dim(1).sqrt();
            SupervisedContrastive::default().forward(rows / lengths, &[0, 0, 1, 1, 2, 2])
        });
    }

    #[test]
    fn a_batch_without_company_costs_nothing() {
        let rows =
            Tensor::<2>::from_floats([[1.0, 0.0], [0.0, 1.0]], &burn::tensor::Device::flex());
        let loss: f32 = SupervisedContrastive::default().forward(rows, &[0, 1]).into_scalar();
        assert_eq!(loss, 0.0);
    }
}
