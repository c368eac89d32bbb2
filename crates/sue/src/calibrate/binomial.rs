//! Tails of counting distributions, in the log domain.

/// `P(Binomial(n, p) ≤ k)`.
pub(super) fn binomial_at_most(k: usize, n: usize, p: f64) -> f64 {
    if k >= n {
        return 1.0;
    }
    let (log_p, log_q) = (p.ln(), (-p).ln_1p());
    let mut log_term = n as f64 * log_q; // k = 0
    let mut sum = log_term.exp();
    for i in 0..k {
        log_term += ((n - i) as f64 / (i + 1) as f64).ln() + log_p - log_q;
        sum += log_term.exp();
    }
    sum.min(1.0)
}

/// `P(H ≤ k)` for `H` the number of marked ones among `drawn` drawn without replacement from
/// `population`, of which `marked` are marked.
pub(super) fn hypergeometric_at_most(
    k: usize,
    population: usize,
    marked: usize,
    drawn: usize,
) -> f64 {
    let lowest = (marked + drawn).saturating_sub(population);
    let highest = marked.min(drawn);
    if k >= highest {
        return 1.0;
    }
    if k < lowest {
        return 0.0;
    }
    let log_of = |hits: usize| {
        log_choose(marked, hits) + log_choose(population - marked, drawn - hits)
            - log_choose(population, drawn)
    };
    let mut log_term = log_of(lowest);
    let mut sum = log_term.exp();
    for hits in lowest..k {
        let up = (marked - hits) as f64 * (drawn - hits) as f64;
        let down = (hits + 1) as f64 * ((population + hits + 1) - (marked + drawn)) as f64;
        log_term += (up / down).ln();
        sum += log_term.exp();
    }
    sum.min(1.0)
}

/// `ln (n choose k)`.
fn log_choose(n: usize, k: usize) -> f64 {
    let k = k.min(n - k);
    (0..k).map(|i| ((n - i) as f64 / (i + 1) as f64).ln()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_scipy() {
        // scipy.stats.binom.cdf and hypergeom.cdf.
        let cases = [
            (binomial_at_most(0, 45, 0.05), 0.099_440_256_987_092_47),
            (binomial_at_most(3, 100, 0.05), 0.257_838_659_115_016),
            (binomial_at_most(40, 1000, 0.05), 0.080_636_573_256_691),
        ];
        for (value, expected) in cases {
            assert!((value - expected).abs() < 1e-9, "{value} {expected}");
        }
        // Counted by hand: 2 of 4 drawn, 2 marked: P(0) = 1/6, P(1) = 4/6.
        assert!((hypergeometric_at_most(0, 4, 2, 2) - 1.0 / 6.0).abs() < 1e-12);
        assert!((hypergeometric_at_most(1, 4, 2, 2) - 5.0 / 6.0).abs() < 1e-12);
        assert_eq!(hypergeometric_at_most(2, 4, 2, 2), 1.0);
        assert_eq!(hypergeometric_at_most(0, 4, 3, 2), 0.0);
    }
}
