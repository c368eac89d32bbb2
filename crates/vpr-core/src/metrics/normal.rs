//! The standard normal distribution.

/// The chance of a value of at most `z`: `1/2 + φ(z) · Σ z^(2i+1) / (1·3·5…(2i+1))` (Marsaglia 2004).
pub(super) fn at_most(z: f64) -> f64 {
    if z.abs() > 8.0 {
        return f64::from(u8::from(z > 0.0));
    }
    let (mut sum, mut term, mut odd) = (z, z, 1.0);
    while term.abs() > sum.abs() * f64::EPSILON {
        odd += 2.0;
        term *= z * z / odd;
        sum += term;
    }
    let density = (-z * z / 2.0).exp() / (2.0 * std::f64::consts::PI).sqrt();
    (0.5 + sum * density).clamp(0.0, 1.0)
}

/// The value that is not exceeded with chance `p`, between 0 and 1, by halving.
pub(super) fn quantile(p: f64) -> f64 {
    let (mut low, mut high) = (-8.0, 8.0);
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        if at_most(middle) < p {
            low = middle;
        } else {
            high = middle;
        }
    }
    f64::midpoint(low, high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::bootstrap::Z_95;

    #[test]
    fn chances_and_quantiles_are_those_of_tables() {
        approx::assert_abs_diff_eq!(at_most(1.0), 0.841_344_746_068_543, epsilon = 1e-14);
        approx::assert_abs_diff_eq!(at_most(-3.0), 0.001_349_898_031_630_1, epsilon = 1e-14);
        approx::assert_abs_diff_eq!(quantile(0.975), Z_95, epsilon = 1e-12);
        assert_eq!((at_most(-40.0), at_most(0.0), at_most(40.0)), (0.0, 0.5, 1.0));
    }
}
