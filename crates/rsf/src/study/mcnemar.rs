//! McNemar's exact test.

/// Two-sided p of McNemar's exact test (1947): of the queries that only one of two methods gets
/// right, are about half the first's? 1 if there is no such query.
#[must_use]
pub fn mcnemar(only_first: usize, only_second: usize) -> f64 {
    let n = only_first + only_second;
    let least = only_first.min(only_second);
    // Logarithm of the binomial coefficient over 2ⁿ, from 0 successes up.
    let mut log = -(n as f64) * std::f64::consts::LN_2;
    let mut tail = 0.0;
    for k in 0..=least {
        tail += log.exp();
        log += ((n - k) as f64 / (k + 1) as f64).ln();
    }
    (2.0 * tail).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tails_by_hand() {
        assert_eq!(mcnemar(0, 0), 1.0);
        assert_eq!(mcnemar(3, 3), 1.0);
        // 2 (1 + 6) / 2⁶ and 2 / 2¹⁰.
        assert!((mcnemar(1, 5) - 14.0 / 64.0).abs() < 1e-12);
        assert!((mcnemar(10, 0) - 2.0 / 1024.0).abs() < 1e-12);
        // Far beyond what fits in 64 bits.
        assert!(mcnemar(2000, 1500) < 1e-15 && mcnemar(2000, 1500) > 0.0);
    }
}
