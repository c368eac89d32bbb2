//! Bayesian triplet loss.

use burn::tensor::{Tensor, activation::softplus};

/// Bayesian triplet loss (BTL; Warburg, Jørgensen, Civera and Hauberg, ICCV 2021).
///
/// Embeddings are normal, N(μ, σ² I). The loss is the negative logarithm of the probability that a
/// triplet keeps its margin, P(‖a − p‖² − ‖a − n‖² < −m), plus `kl_weight` times the divergence
/// of each embedding from the prior N(0, 1/d I), both as means over triplets.
///
/// The difference τ of the squared distances is taken as normal with its exact first two moments,
/// which for independent components are, summed over dimensions,
///
/// E τ = μp² + σp² − μn² − σn² − 2 μa (μp − μn)
///
/// V τ = 2σp⁴ + 4σp² ((μp − μa)² + σa²) + 2σn⁴ + 4σn² ((μn − μa)² + σa²) + 4σa² (μp − μn)²
///
/// (the law of total variance, given a; equal to the paper's expansion, without its differences
/// of large numbers).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BayesianTriplet {
    /// The margin m, between squared distances.
    pub margin: f64,
    /// Weight of the divergence from the prior.
    pub kl_weight: f64,
}

impl Default for BayesianTriplet {
    /// No margin and the weight of the paper's code, 1e-6.
    fn default() -> Self {
        Self { margin: 0.0, kl_weight: 1e-6 }
    }
}

impl BayesianTriplet {
    /// The loss of anchors, positives and negatives, each a mean `n × d` and a variance `n × 1`
    /// (isotropic) or `n × d`.
    #[must_use]
    pub fn forward(
        &self,
        anchors: (Tensor<2>, Tensor<2>),
        positives: (Tensor<2>, Tensor<2>),
        negatives: (Tensor<2>, Tensor<2>),
    ) -> Tensor<1> {
        let [first, second, third] = [&anchors, &positives, &negatives]
            .map(|(mean, variance)| divergence(mean.clone(), variance.clone()));
        let divergence = first + second + third;
        let (mean, variance) = moments(anchors, positives, negatives);
        let z = (mean + self.margin).neg() / (variance + 1e-12).sqrt();
        log_normal_cdf(z).neg().mean() + divergence.mean() * self.kl_weight
    }
}

/// Mean and variance of ‖a − p‖² − ‖a − n‖², `n × 1` each.
fn moments(
    (a, var_a): (Tensor<2>, Tensor<2>),
    (p, var_p): (Tensor<2>, Tensor<2>),
    (n, var_n): (Tensor<2>, Tensor<2>),
) -> (Tensor<2>, Tensor<2>) {
    let shape = a.shape();
    let [var_a, var_p, var_n] = [var_a, var_p, var_n].map(|var| var.expand(shape.clone()));
    let mean = p.clone().square() + var_p.clone()
        - n.clone().square()
        - var_n.clone()
        - a.clone() * (p.clone() - n.clone()) * 2.0;
    let of = |x: Tensor<2>, var: Tensor<2>| {
        let spread = (x - a.clone()).square() + var_a.clone();
        var.clone().square() * 2.0 + var * spread * 4.0
    };
    let variance =
        of(p.clone(), var_p) + of(n.clone(), var_n) + var_a.clone() * (p - n).square() * 4.0;
    (mean.sum_dim(1), variance.sum_dim(1))
}

/// Kullback–Leibler divergence of N(μ, σ²) from N(0, 1/d), summed over dimensions, `n × 1`.
fn divergence(mean: Tensor<2>, variance: Tensor<2>) -> Tensor<2> {
    let dimension = mean.dims()[1] as f64;
    let variance = variance.expand(mean.shape());
    let ratio = (variance.clone() + mean.square()) * dimension;
    ((ratio - (variance * dimension).log() - 1.0) * 0.5).sum_dim(1)
}

/// log Φ(z), also where Φ(z) is far below the smallest f32: below −4 by the first terms of the
/// asymptotic series, log φ(z) − log(−z) + log(1 − 1/z² + 3/z⁴ − 15/z⁶).
fn log_normal_cdf(z: Tensor<2>) -> Tensor<2> {
    const TURN: f64 = -4.0;
    let near = z.clone().clamp_min(TURN);
    let near = ((near / std::f64::consts::SQRT_2).erf() * 0.5 + 0.5 + 1e-30).log();
    let far = z.clone().clamp_max(TURN);
    let inverse = far.clone().square().recip();
    let series =
        (inverse.clone() * (inverse.clone() * (inverse.clone() * -15.0 + 3.0) - 1.0)).log1p();
    let far =
        far.clone().square() * -0.5 - far.neg().log() - 0.5 * std::f64::consts::TAU.ln() + series;
    let deep = z.lower_elem(TURN);
    near.mask_where(deep, far)
}

/// Variance from a head's output: softplus, at least 1e-6.
#[must_use]
pub fn positive(raw: Tensor<2>) -> Tensor<2> {
    softplus(raw, 1.0) + 1e-6
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use burn::tensor::{Device, TensorData};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::loss::check::{gradient, overfit, thirds, unit_rows};

    fn rows((rows, shape): (Vec<f32>, [usize; 2])) -> Tensor<2> {
        Tensor::from_data(TensorData::new(rows, shape), &Device::flex())
    }

    fn constant(value: f32, n: usize) -> Tensor<2> {
        rows((vec![value; n], [n, 1]))
    }

    #[test]
    fn the_moments_are_those_of_many_draws() {
        let (width, n_draws) = (4, 400_000);
        let means = [1, 2, 3].map(|seed| unit_rows(1, width, seed).0);
        let variances = [0.2_f32, 0.05, 0.4];
        let [anchor, near, far] =
            [0, 1, 2].map(|k| (rows((means[k].clone(), [1, width])), constant(variances[k], 1)));
        let (mean, variance) = moments(anchor, near, far);
        let mut random = ChaCha8Rng::seed_from_u64(9);
        let mut normal = |mean: f32, variance: f32| {
            let (radius, angle): (f64, f64) = (random.random(), random.random());
            let draw = (-2.0 * (1.0 - radius).ln()).sqrt() * (TAU * angle).cos();
            f64::from(mean) + f64::from(variance).sqrt() * draw
        };
        let (mut sum, mut squares) = (0.0, 0.0);
        for _ in 0..n_draws {
            let mut tau = 0.0;
            #[expect(clippy::needless_range_loop, reason = "three vectors at once")]
            for component in 0..width {
                let [anchor, near, far] =
                    [0, 1, 2].map(|k| normal(means[k][component], variances[k]));
                tau += (anchor - near).powi(2) - (anchor - far).powi(2);
            }
            sum += tau;
            squares += tau * tau;
        }
        let expected = sum / f64::from(n_draws);
        let spread = squares / f64::from(n_draws) - expected * expected;
        let got = (f64::from(mean.into_scalar::<f32>()), f64::from(variance.into_scalar::<f32>()));
        assert!((got.0 - expected).abs() < 0.02, "{} {expected}", got.0);
        assert!((got.1 / spread - 1.0).abs() < 0.02, "{} {spread}", got.1);
    }

    #[test]
    fn the_logarithm_of_the_normal_distribution_reaches_far_down() {
        // Values of scipy.special.log_ndtr.
        let expected = [
            (1.0_f32, -0.172_753_78_f32),
            (-1.0, -1.841_021_7),
            (-3.9, -9.942_304),
            (-4.1, -10.787_431),
            (-10.0, -53.231_285),
            (-40.0, -804.608_46),
        ];
        for (z, value) in expected {
            let got: f32 = log_normal_cdf(constant(z, 1)).into_scalar();
            assert!((got - value).abs() < 2e-3 * value.abs(), "{z}: {got} {value}");
        }
    }

    #[test]
    fn its_gradient_is_that_of_finite_differences() {
        let loss = BayesianTriplet { margin: 0.1, kl_weight: 0.01 };
        // Last column: the variance before its softplus.
        gradient(unit_rows(6, 5, 8), |rows| {
            let (a, p, n) = thirds(rows);
            let split = |x: Tensor<2>| (x.clone().narrow(1, 0, 4), positive(x.narrow(1, 4, 1)));
            loss.forward(split(a), split(p), split(n))
        });
    }

    #[test]
    fn a_tiny_set_is_overfitted() {
        overfit(unit_rows(12, 9, 3), |rows| {
            let (a, p, n) = thirds(rows);
            let split = |x: Tensor<2>| (x.clone().narrow(1, 0, 8), positive(x.narrow(1, 8, 1)));
            BayesianTriplet::default().forward(split(a), split(p), split(n))
        });
    }

    #[test]
    fn a_triplet_that_cannot_be_told_gets_a_larger_variance() {
        let mean = rows(unit_rows(1, 8, 3));
        let far = rows(unit_rows(1, 8, 4));
        let loss = |variance: f32| -> f32 {
            // The negative is nearer than the positive: confidence costs.
            let of = |mean: &Tensor<2>| (mean.clone(), constant(variance, 1));
            BayesianTriplet::default().forward(of(&mean), of(&far), of(&mean)).into_scalar()
        };
        assert!(loss(0.1) < loss(0.001));
    }
}
