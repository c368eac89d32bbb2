//! STUN's self-teaching loss.

use burn::tensor::{Tensor, activation::sigmoid};

/// Which self-teaching loss.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SelfTeaching {
    /// The released code: `‖μ_s − μ_t‖₂` over σ², plus log σ², the mean over dimensions of σ². The
    /// norm is not squared and one number for all dimensions (reference-behaviour §4.3).
    #[default]
    Published,
    /// The Gaussian likelihood that the paper derives it from, per dimension:
    /// `d (μ_s − μ_t)²` over σ², plus log σ². The factor d (the dimension) puts the residuals of unit
    /// rows, of order 1/√d, on the scale of the head's variances, which lie within 1 to e.
    Corrected,
}

/// How a student's variance follows from the output s of its linear head.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LogVariance {
    /// log σ² = sigmoid(s), in training and in use.
    #[default]
    Sigmoid,
    /// log σ² = clamp(10 sigmoid(s) + 0.2, 0, 1): what the released code *trains* with for triplet
    /// and quadruplet teachers, while it evaluates with [`Self::Sigmoid`]. As sigmoid(s) is
    /// positive this is 1 unless s < −2.44, and has no gradient there.
    Shifted,
}

impl LogVariance {
    /// log σ² of a head's output.
    #[must_use]
    pub fn of(self, raw: Tensor<2>) -> Tensor<2> {
        match self {
            Self::Sigmoid => sigmoid(raw),
            Self::Shifted => (sigmoid(raw) * 10.0 + 0.2).clamp(0.0, 1.0),
        }
    }
}

impl SelfTeaching {
    /// Self-teaching loss (Cai, Lu and Huang, IROS 2022, eq. 6): the student's mean shall be the
    /// teacher's, and its variance shall say how far it is from it.
    ///
    /// `student` and `teacher` are `n × d`, `log_variance` is `n × d` or `n × 1`.
    #[must_use]
    pub fn forward(
        self,
        student: Tensor<2>,
        log_variance: Tensor<2>,
        teacher: Tensor<2>,
    ) -> Tensor<1> {
        let residual = match self {
            Self::Published => super::distances(student, teacher),
            Self::Corrected => {
                let dimension = student.dims()[1] as f64;
                (student - teacher).square() * dimension
            }
        };
        (residual * log_variance.clone().neg().exp() + log_variance).mean()
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, TensorData};

    use super::*;
    use crate::loss::check::{gradient, overfit, unit_rows};

    fn teacher(n: usize, d: usize) -> Tensor<2> {
        let (rows, shape) = unit_rows(n, d, 77);
        Tensor::from_data(TensorData::new(rows, shape), &Device::flex())
    }

    #[test]
    fn cases_by_hand() {
        let row = |values: [f32; 2]| Tensor::<2>::from_floats([values], &Device::flex());
        let (student, teacher) = (row([3.0, 4.0]), row([0.0, 0.0]));
        let log_variance = row([0.0, 1.0]);
        let published: f32 = SelfTeaching::Published
            .forward(student.clone(), log_variance.clone(), teacher.clone())
            .into_scalar();
        let e = std::f32::consts::E;
        assert!((published - (5.0 + (5.0 / e + 1.0)) / 2.0).abs() < 1e-5);
        let corrected: f32 =
            SelfTeaching::Corrected.forward(student, log_variance, teacher).into_scalar();
        assert!((corrected - (2.0 * 9.0 + (2.0 * 16.0 / e + 1.0)) / 2.0).abs() < 1e-4);
    }

    #[test]
    fn the_published_clamp_saturates_where_heads_begin() {
        let raw = Tensor::<2>::from_floats([[0.0, -1.0, -5.0]], &Device::flex());
        let log: Vec<f32> = LogVariance::Shifted.of(raw.clone()).into_data().try_to_vec().unwrap();
        assert_eq!(log[..2], [1.0, 1.0]);
        assert!((log[2] - (10.0 / (1.0 + 5.0_f32.exp()) + 0.2)).abs() < 1e-5);
        let test: Vec<f32> = LogVariance::Sigmoid.of(raw).into_data().try_to_vec().unwrap();
        assert!((test[0] - 0.5).abs() < 1e-6);
    }

    #[test]
    fn gradients_are_those_of_finite_differences() {
        for loss in [SelfTeaching::Published, SelfTeaching::Corrected] {
            gradient(unit_rows(3, 8, 11), |rows| {
                let log = LogVariance::Sigmoid.of(rows.clone().narrow(1, 4, 4));
                loss.forward(rows.narrow(1, 0, 4), log, teacher(3, 4))
            });
        }
    }

    #[test]
    fn a_tiny_set_is_overfitted() {
        overfit(unit_rows(3, 8, 12), |rows| {
            let log = LogVariance::Sigmoid.of(rows.clone().narrow(1, 4, 4));
            SelfTeaching::Corrected.forward(rows.narrow(1, 0, 4), log, teacher(3, 4))
        });
    }
}
