//! Distance-based loss.

use burn::tensor::Tensor;

use super::distances;

/// Distance-based loss, ‖Δf − Δt‖₂ (thesis eq. 6.7; Thoma, Paudel and Van Gool 2020), the mean
/// over pairs: Δf is the Euclidean distance of two descriptors and Δt that of the positions of
/// their cameras, so the map of descriptors becomes one of places. For a pair the norm is that of a
/// number, its absolute value.
///
/// `queries` and `positives` are `n × d`, `translations` holds the n distances Δt, `n × 1`, in the
/// unit that descriptors shall have; unit rows reach 2 at most.
#[must_use]
pub fn distance_based(
    queries: Tensor<2>,
    positives: Tensor<2>,
    translations: Tensor<2>,
) -> Tensor<1> {
    (distances(queries, positives) - translations).abs().mean()
}

#[cfg(test)]
mod tests {
    use burn::tensor::Device;

    use super::*;
    use crate::loss::check::{gradient, overfit, thirds, unit_rows};

    fn metres(n: usize) -> Tensor<2> {
        let distances: Vec<f32> = (0..n).map(|k| 0.2 + 0.1 * k as f32).collect();
        Tensor::<1>::from_floats(distances.as_slice(), &Device::flex()).reshape([n, 1])
    }

    #[test]
    fn a_case_by_hand() {
        let rows = |rows: [[f32; 2]; 2]| Tensor::<2>::from_floats(rows, &Device::flex());
        let loss = distance_based(
            rows([[0.0, 0.0], [1.0, 1.0]]),
            rows([[3.0, 4.0], [1.0, 0.0]]),
            Tensor::from_floats([[4.5], [3.0]], &Device::flex()),
        );
        assert!((loss.into_scalar::<f32>() - f32::midpoint(0.5, 2.0)).abs() < 1e-5);
    }

    #[test]
    fn its_gradient_is_that_of_finite_differences() {
        gradient(unit_rows(6, 4, 5), |rows| {
            let (q, p, _) = thirds(rows);
            distance_based(q, p, metres(2))
        });
    }

    #[test]
    fn a_tiny_set_is_overfitted() {
        overfit(unit_rows(12, 8, 6), |rows| {
            let (q, p, _) = thirds(rows);
            distance_based(q, p, metres(4))
        });
    }
}
