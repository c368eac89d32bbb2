//! Whether two methods differ in how many queries they get right: McNemar's test, and how many
//! queries it needs.

use super::binomial::LogFactorials;
use crate::{Error, Result};

/// Which p-value McNemar's test gives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum McNemar {
    /// The exact conditional test: the binomial tail, doubled. Never calls more than the level of
    /// equal methods different, and with few discordant queries far fewer.
    Exact,
    /// The same with half the chance of the observed count (Lancaster 1961); near the level also for
    /// few discordant queries, and recommended for paired shares by Fagerland et al. (BMC Med. Res.
    /// Methodol. 13:91, 2013). It may go above the level by a little.
    #[default]
    MidP,
}

/// The queries on which two methods disagree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Discordant {
    /// Number of all queries.
    pub n_queries: usize,
    /// How many only the first method got right: its wins.
    pub first: usize,
    /// How many only the second method got right: the first one's losses.
    pub second: usize,
}

/// A study that is planned, or was made, with McNemar's test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// Share of the queries that only the first method gets right.
    pub first: f64,
    /// Share of the queries that only the second method gets right.
    pub second: f64,
    /// Methods are called different at a p-value of at most this.
    pub level: f64,
    /// Which p-value.
    pub test: McNemar,
}

/// More queries than this are not looked for.
pub const MOST_QUERIES: usize = 100_000;

impl Discordant {
    /// Counts, from whether each of the two methods is right on each query.
    ///
    /// # Errors
    ///
    /// [`Error::Mismatch`] if the methods were not asked equally many queries, [`Error::Empty`] without
    /// queries.
    pub fn count(first: &[bool], second: &[bool]) -> Result<Self> {
        let (expected, actual) = (first.len(), second.len());
        if expected != actual {
            return Err(Error::Mismatch { what: "queries of two methods", expected, actual });
        }
        if first.is_empty() {
            return Err(Error::Empty("queries"));
        }
        let only = |wins: &[bool], loses: &[bool]| {
            wins.iter().zip(loses).filter(|&(&win, &lose)| win && !lose).count()
        };
        Ok(Self { n_queries: expected, first: only(first, second), second: only(second, first) })
    }

    /// The two-sided p-value of McNemar's test, that both methods get equally many queries right:
    /// with `m` discordant queries of which one method has `k`, the fewer,
    /// `2 · P(X ≤ k)` of `X ~ Binomial(m, 1/2)`, at most 1; by [`McNemar::MidP`] less `P(X = k)`.
    ///
    /// Without discordant queries it is 1.
    #[must_use]
    pub fn p_value(self, test: McNemar) -> f64 {
        let m = self.first + self.second;
        p_value(&LogFactorials::up_to(m), self.first.min(self.second), m, test)
    }
}

impl Plan {
    /// The chance that the test calls the two methods different with this many queries.
    ///
    /// It is exact: over all numbers of discordant queries and all ways to share them. With equal
    /// shares it is the chance of a false alarm.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if the shares are negative or above 1 together, or the level is not between
    /// 0 and 1.
    pub fn power(&self, n_queries: usize) -> Result<f64> {
        self.check()?;
        Ok(self.power_by(&LogFactorials::up_to(n_queries), n_queries))
    }

    /// The fewest queries with which the power reaches `power`; `None` if [`MOST_QUERIES`] are not
    /// enough, as for equal shares.
    ///
    /// Found by doubling and halving. Power does not rise in every step, since counts are whole: a
    /// slightly smaller number may reach it as well.
    ///
    /// # Errors
    ///
    /// As [`Self::power`]; also if `power` is not between 0 and 1.
    pub fn queries_for(&self, power: f64) -> Result<Option<usize>> {
        self.check()?;
        between_0_and_1("power", power)?;
        let mut table = LogFactorials::up_to(64);
        let (mut below, mut enough) = (0, 64);
        while self.power_by(&table, enough) < power {
            if enough == MOST_QUERIES || self.first == self.second {
                return Ok(None);
            }
            (below, enough) = (enough, (2 * enough).min(MOST_QUERIES));
            table = LogFactorials::up_to(enough);
        }
        while below + 1 < enough {
            let middle = usize::midpoint(below, enough);
            if self.power_by(&table, middle) < power {
                below = middle;
            } else {
                enough = middle;
            }
        }
        Ok(Some(enough))
    }

    fn check(&self) -> Result<()> {
        let both = self.first + self.second;
        let is_share = |it: f64| (0.0..=1.0).contains(&it);
        if !(is_share(self.first) && is_share(self.second) && both <= 1.0 + 1e-9) {
            let (name, reason) = ("shares", "must not be negative, nor above 1 together");
            let value = format!("{}, {}", self.first, self.second);
            return Err(Error::Parameter { name, value, reason });
        }
        between_0_and_1("level", self.level)
    }

    fn power_by(&self, table: &LogFactorials, n_queries: usize) -> f64 {
        let discordant = (self.first + self.second).min(1.0);
        if discordant == 0.0 {
            return 0.0;
        }
        let of_first = self.first / discordant;
        // Eight standard deviations around the mean hold all but 1e-14.
        let mean = n_queries as f64 * discordant;
        let reach = 8.0 * (mean * (1.0 - discordant)).sqrt() + 8.0;
        let low = floor(mean - reach);
        let high = floor(mean + reach).min(n_queries);
        let mut region = Region { fewest: None };
        (low..=high)
            .map(|m| {
                let weight = if discordant < 1.0 {
                    table.chance(m, n_queries, discordant)
                } else {
                    f64::from(u8::from(m == n_queries))
                };
                let Some(k) = region.at(table, m, self) else { return 0.0 };
                weight * (at_most(table, k, m, of_first) + at_most(table, k, m, 1.0 - of_first))
            })
            .sum()
    }
}

/// Up to how many wins of the lesser method two methods are called different, as the number of
/// discordant queries grows.
struct Region {
    fewest: Option<usize>,
}

impl Region {
    fn at(&mut self, table: &LogFactorials, m: usize, plan: &Plan) -> Option<usize> {
        let rejects = |k: usize| 2 * k < m && p_value(table, k, m, plan.test) <= plan.level;
        if self.fewest.is_none() {
            // The first number: by halving, since p-values rise with k.
            let (mut low, mut high) = (0, m / 2 + 1);
            while low < high {
                let middle = usize::midpoint(low, high);
                if rejects(middle) {
                    low = middle + 1;
                } else {
                    high = middle;
                }
            }
            self.fewest = low.checked_sub(1);
            return self.fewest;
        }
        // One more discordant query moves it by one at most.
        let next = self.fewest.map_or(0, |it| it + 1);
        if rejects(next) {
            self.fewest = Some(next);
        }
        self.fewest
    }
}

/// The chance of at most `k` of `m`, for any chance of one.
fn at_most(table: &LogFactorials, k: usize, m: usize, p: f64) -> f64 {
    if p <= 0.0 {
        return 1.0;
    }
    if p >= 1.0 {
        return f64::from(u8::from(k >= m));
    }
    table.tail(k, m, p, 1.0)
}

fn p_value(table: &LogFactorials, fewer: usize, m: usize, test: McNemar) -> f64 {
    if m == 0 {
        return 1.0;
    }
    let of_last = match test {
        McNemar::Exact => 1.0,
        McNemar::MidP => 0.5,
    };
    (2.0 * table.tail(fewer, m, 0.5, of_last)).min(1.0)
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a number of queries")]
fn floor(value: f64) -> usize {
    value.max(0.0) as usize
}

pub(super) fn between_0_and_1(name: &'static str, value: f64) -> Result<()> {
    if value > 0.0 && value < 1.0 {
        return Ok(());
    }
    let reason = "must be between 0 and 1";
    Err(Error::Parameter { name, value: value.to_string(), reason })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn p(first: usize, second: usize, test: McNemar) -> f64 {
        Discordant { n_queries: first + second, first, second }.p_value(test)
    }

    #[test]
    fn p_values_are_binomial_tails() {
        // By hand: 2 · (1 + 10 + 45) / 2¹⁰, and less 45 / 2¹⁰.
        approx::assert_relative_eq!(p(8, 2, McNemar::Exact), 112.0 / 1024.0, epsilon = 1e-12);
        approx::assert_relative_eq!(p(2, 8, McNemar::MidP), 67.0 / 1024.0, epsilon = 1e-12);
        // Equal counts, and none.
        for test in [McNemar::Exact, McNemar::MidP] {
            approx::assert_relative_eq!(p(5, 5, test), 1.0, epsilon = 1e-12);
            assert_eq!(p(0, 0, test), 1.0);
        }
    }

    #[test]
    fn wins_and_losses_are_counted_per_query() {
        let (first, second) = ([true, true, false, false, true], [true, false, true, false, false]);
        let counted = Discordant::count(&first, &second).unwrap();
        assert_eq!(counted, Discordant { n_queries: 5, first: 2, second: 1 });
        assert!(matches!(Discordant::count(&first, &[true]), Err(Error::Mismatch { .. })));
        assert!(matches!(Discordant::count(&[], &[]), Err(Error::Empty(_))));
    }

    /// Power by adding up every outcome there is.
    fn by_enumeration(plan: &Plan, n: usize) -> f64 {
        let table = LogFactorials::up_to(n);
        let discordant = plan.first + plan.second;
        let mut power = 0.0;
        for m in 0..=n {
            for b in 0..=m {
                if p(b, m - b, plan.test) <= plan.level {
                    let share = table.chance(b, m, plan.first / discordant);
                    power += table.chance(m, n, discordant) * share;
                }
            }
        }
        power
    }

    #[test]
    fn power_is_the_sum_over_all_outcomes() {
        for test in [McNemar::Exact, McNemar::MidP] {
            for (first, second) in [(0.1, 0.1), (0.3, 0.1), (0.02, 0.15), (0.5, 0.2)] {
                let plan = Plan { first, second, level: 0.05, test };
                for n in [1, 7, 30, 80] {
                    let (fast, slow) = (plan.power(n).unwrap(), by_enumeration(&plan, n));
                    approx::assert_abs_diff_eq!(fast, slow, epsilon = 1e-9);
                }
            }
        }
    }

    #[test]
    fn the_number_of_queries_reaches_the_power() {
        let plan = Plan { first: 0.12, second: 0.05, level: 0.05, test: McNemar::MidP };
        let n = plan.queries_for(0.8).unwrap().unwrap();
        assert!(plan.power(n).unwrap() >= 0.8 && plan.power(n - 20).unwrap() < 0.8, "{n}");
        let equal = Plan { first: 0.1, second: 0.1, ..plan };
        assert_eq!(equal.queries_for(0.8).unwrap(), None);
        let none = Plan { first: 0.0, second: 0.0, ..plan };
        assert_eq!((none.power(50).unwrap(), none.queries_for(0.8).unwrap()), (0.0, None));
        // Only one method ever wins.
        let sure = Plan { first: 1.0, second: 0.0, ..plan };
        assert_eq!(sure.queries_for(0.9).unwrap(), Some(5));
    }

    #[test]
    fn impossible_plans_are_refused() {
        let plan = Plan { first: 0.7, second: 0.5, level: 0.05, test: McNemar::Exact };
        assert!(matches!(plan.power(10), Err(Error::Parameter { name: "shares", .. })));
        let plan = Plan { first: 0.7, second: 0.1, level: 5.0, test: McNemar::Exact };
        assert!(matches!(plan.power(10), Err(Error::Parameter { name: "level", .. })));
        let plan = Plan { level: 0.05, ..plan };
        assert!(matches!(plan.queries_for(80.0), Err(Error::Parameter { name: "power", .. })));
    }
}
