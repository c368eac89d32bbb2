//! Tails of counting distributions, as exact tests need them.

/// Natural logarithms of the factorials `0! … n!`, and what is counted with them. All counts given to
/// its methods are at most `n`; larger ones panic.
#[derive(Clone, Debug)]
pub struct LogFactorials(Vec<f64>);

impl LogFactorials {
    /// The table of `0! … n!`.
    #[must_use]
    pub fn up_to(n: usize) -> Self {
        let steps = (1..=n).scan(0.0, |sum, it| {
            *sum += (it as f64).ln();
            Some(*sum)
        });
        Self(std::iter::once(0.0).chain(steps).collect())
    }

    /// The chance of exactly `k` hits in `n` draws of chance `p`, which is between 0 and 1, both
    /// ends left out.
    #[must_use]
    pub fn chance(&self, k: usize, n: usize, p: f64) -> f64 {
        (self.choose(n, k) + k as f64 * p.ln() + (n - k) as f64 * (-p).ln_1p()).exp()
    }

    /// The chance of at most `k` hits, where exactly `k` counts by `of_last` only: 1 for the tail
    /// itself, 1/2 for the mid-p-value.
    #[must_use]
    pub fn tail(&self, k: usize, n: usize, p: f64, of_last: f64) -> f64 {
        if k > n {
            return 1.0;
        }
        // The smaller side is added up, so that nothing underflows that counts.
        let tail = if (k as f64) < n as f64 * p {
            self.below_mean(k, n, p)
        } else if k == n {
            1.0
        } else {
            1.0 - self.below_mean(n - k - 1, n, 1.0 - p)
        };
        (tail - (1.0 - of_last) * self.chance(k, n, p)).clamp(0.0, 1.0)
    }

    /// The chance of at most `k` marked ones among `drawn` that are drawn without replacement from
    /// `population`, of which `marked` are marked.
    #[must_use]
    pub fn hypergeometric_tail(
        &self,
        k: usize,
        population: usize,
        marked: usize,
        drawn: usize,
    ) -> f64 {
        let fewest = (marked + drawn).saturating_sub(population);
        if k >= marked.min(drawn) {
            return 1.0;
        }
        let chance = |hits: usize| {
            let others = self.choose(population - marked, drawn - hits);
            (self.choose(marked, hits) + others - self.choose(population, drawn)).exp()
        };
        (fewest..=k).map(chance).sum::<f64>().min(1.0)
    }

    /// The logarithm of "`n` choose `k`".
    fn choose(&self, n: usize, k: usize) -> f64 {
        self.0[n] - self.0[k] - self.0[n - k]
    }

    /// The tail up to `k`, from there downwards until terms change nothing.
    fn below_mean(&self, k: usize, n: usize, p: f64) -> f64 {
        let mut term = self.chance(k, n, p);
        let mut sum = term;
        let odds = (1.0 - p) / p;
        for hits in (1..=k).rev() {
            term *= hits as f64 / (n - hits + 1) as f64 * odds;
            sum += term;
            if term < sum * f64::EPSILON {
                break;
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chances_are_those_of_pascals_triangle() {
        let table = LogFactorials::up_to(10);
        for (k, count) in [1.0, 5.0, 10.0, 10.0, 5.0, 1.0].into_iter().enumerate() {
            approx::assert_relative_eq!(table.chance(k, 5, 0.5), count / 32.0, epsilon = 1e-13);
        }
        approx::assert_relative_eq!(table.tail(2, 5, 0.5, 1.0), 0.5, epsilon = 1e-13);
        approx::assert_relative_eq!(table.tail(2, 5, 0.5, 0.5), 11.0 / 32.0, epsilon = 1e-13);
        approx::assert_relative_eq!(table.tail(10, 10, 0.3, 1.0), 1.0, epsilon = 1e-13);
        // Far above the mean, where the term itself is nothing.
        approx::assert_relative_eq!(table.tail(9, 10, 1e-40, 1.0), 1.0, epsilon = 1e-13);
    }

    #[test]
    fn tails_are_those_of_scipy() {
        // scipy.stats.binom.cdf
        let table = LogFactorials::up_to(1000);
        for (value, expected) in [
            (table.tail(0, 45, 0.05, 1.0), 0.099_440_256_987_092_47),
            (table.tail(3, 100, 0.05, 1.0), 0.257_838_659_115_016),
            (table.tail(40, 1000, 0.05, 1.0), 0.080_636_573_256_691),
        ] {
            approx::assert_relative_eq!(value, expected, epsilon = 1e-9);
        }
    }

    #[test]
    fn draws_without_replacement_are_counted() {
        // Of 4, 2 marked, 2 are drawn: none marked in 1 of 6 ways, one in 4 of 6.
        let table = LogFactorials::up_to(4);
        let tail = |k, marked| table.hypergeometric_tail(k, 4, marked, 2);
        approx::assert_relative_eq!(tail(0, 2), 1.0 / 6.0, epsilon = 1e-12);
        approx::assert_relative_eq!(tail(1, 2), 5.0 / 6.0, epsilon = 1e-12);
        approx::assert_relative_eq!(tail(2, 2), 1.0, epsilon = 1e-12);
        approx::assert_abs_diff_eq!(tail(0, 3), 0.0);
    }

    #[test]
    fn large_numbers_do_not_underflow() {
        let table = LogFactorials::up_to(20_000);
        // Half of the mass, and half of the middle term: √(2/(πn))/2 by Stirling.
        let half = 0.5 + (2.0 / (std::f64::consts::PI * 20_000.0)).sqrt() / 2.0;
        approx::assert_relative_eq!(table.tail(10_000, 20_000, 0.5, 1.0), half, epsilon = 1e-6);
    }
}
