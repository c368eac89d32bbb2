//! Triplet loss.

use burn::tensor::{Tensor, activation::relu};

use super::distances;

/// Triplet loss, max{d(q, p) − d(q, n) + m, 0} with the Euclidean distance d (thesis eqs. 4.4 and
/// 6.5; Weinberger and Saul 2009), the mean over triplets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triplet {
    /// How much further negatives have to be than positives.
    pub margin: f64,
}

impl Default for Triplet {
    /// The margin of chapter 6, 0.3.
    fn default() -> Self {
        Self { margin: 0.3 }
    }
}

impl Triplet {
    /// The loss of queries, positives and negatives, `n × d` each, row by row.
    #[must_use]
    pub fn forward(
        &self,
        queries: Tensor<2>,
        positives: Tensor<2>,
        negatives: Tensor<2>,
    ) -> Tensor<1> {
        let near = distances(queries.clone(), positives);
        let far = distances(queries, negatives);
        relu(near - far + self.margin).mean()
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::Device;

    use super::*;
    use crate::loss::check::{gradient, overfit, thirds, unit_rows};

    #[test]
    fn a_case_by_hand() {
        let rows = |rows: [[f32; 2]; 2]| Tensor::<2>::from_floats(rows, &Device::flex());
        let loss = Triplet { margin: 0.5 }.forward(
            rows([[0.0, 0.0], [0.0, 0.0]]),
            rows([[3.0, 4.0], [1.0, 0.0]]),
            rows([[0.0, 5.0], [0.0, 2.0]]),
        );
        // 5 - 5 + 0.5 and 1 - 2 + 0.5, cut at zero.
        assert!((loss.into_scalar::<f32>() - 0.25).abs() < 1e-6);
    }

    #[test]
    fn its_gradient_is_that_of_finite_differences() {
        let loss = Triplet { margin: 3.0 };
        gradient(unit_rows(6, 4, 2), |rows| {
            let (q, p, n) = thirds(rows);
            loss.forward(q, p, n)
        });
    }

    #[test]
    fn a_tiny_set_is_overfitted() {
        overfit(unit_rows(12, 8, 3), |rows| {
            let (q, p, n) = thirds(rows);
            Triplet::default().forward(q, p, n)
        });
    }
}
