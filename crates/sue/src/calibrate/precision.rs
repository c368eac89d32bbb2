//! Learn then test: a precision that accepted matches have.

use std::fmt;

use serde::{Deserialize, Serialize};
use vpr_core::metrics::LogFactorials;

use super::{check_queries, check_share};
use crate::{Result, Threshold};

/// What the threshold is to achieve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrecisionGoal {
    /// Share of the accepted matches that must be correct.
    pub precision: f64,
    /// Share of all calibration sets that may break the promise; see [`calibrate_precision`].
    pub risk: f64,
    /// Whose precision is promised.
    pub scope: Scope,
}

/// Whose precision is promised.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scope {
    /// Of all queries there could be: the expected share of correct matches among accepted ones. A
    /// small batch can fall below it by chance.
    #[default]
    Population,
    /// Of the next accepted matches, as many as were accepted in calibration: stricter, since
    /// their own chance is in it.
    NextBatch,
}

/// A threshold and what it promises.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Calibrated {
    /// Matches below are accepted; [`Threshold::NOTHING`] if no threshold can be promised.
    pub threshold: Threshold,
    /// Precision that is promised.
    pub precision: f64,
    /// Share of all calibration sets that may break the promise.
    pub risk: f64,
    /// Whose precision it is.
    pub scope: Scope,
    /// Number of calibration queries.
    pub n: usize,
    /// How many of them are accepted.
    pub n_accepted: usize,
    /// How many of the accepted ones are correct.
    pub n_correct: usize,
}

/// In how many places the sequence of tests starts.
const N_STARTS: usize = 2;

/// Chooses the threshold that accepts most while a precision is promised at a risk: learn-then-test
/// (Angelopoulos et al. 2021) with fixed-sequence tests over ranks, started in two places with half
/// of the risk each.
///
/// # The promise
///
/// **Of all calibration sets that could be drawn, at most a share `risk` gives a threshold whose
/// precision is lower than promised**, whatever the distribution. A set that gives no threshold
/// keeps the promise. It is *not* a promise about the sets that give one: of these a larger share
/// can break it, at most `risk` divided by the share of sets that give one. Where the wanted
/// precision is just out of reach, few sets give a threshold and most of these break it.
///
/// No procedure can do better without assumptions. Let all matches be wrong with one chance, a
/// little above `1 − precision`, whatever their uncertainty: every threshold then breaks the
/// promise, and any set at all, such as one without a wrong match, turns up with some chance; so
/// of the sets that give a threshold all break it. Who knows that about a share `g` of his sets
/// give a threshold keeps the broken ones among them below `c` with a risk of `c · g`.
/// `docs/statistics.md` has numbers; `cargo run --example promise` makes them.
///
/// # How
///
/// Candidates are chosen before looking at labels: the `r`-th smallest uncertainty for given `r`.
/// What is below it are independent draws of matches below it, so the number of wrong ones is
/// binomial, and `P(Binomial(accepted, 1 − precision) ≤ wrong)` is a p-value for "precision is
/// lower". From each start, ranks grow until a test fails; the last success counts. Equal
/// uncertainties are accepted together or not at all; a rank with fewer below it than any test can
/// pass is left out, which depends on no label. For [`Scope::NextBatch`] the p-value is
/// hypergeometric: calibration and next matches are exchangeable.
///
/// # Errors
///
/// [`vpr_core::Error::Parameter`] if precision or risk is outside of (0, 1), and
/// [`vpr_core::Error::Empty`], [`vpr_core::Error::Mismatch`], [`vpr_core::Error::NotFinite`] for the
/// queries.
pub fn calibrate_precision(
    uncertainty: &[f64],
    correct: &[bool],
    goal: PrecisionGoal,
) -> Result<Calibrated> {
    let PrecisionGoal { precision, risk, scope } = goal;
    check_share("precision", precision)?;
    check_share("risk", risk)?;
    check_queries(uncertainty, correct)?;
    let mut ranked: Vec<(f64, bool)> =
        uncertainty.iter().copied().zip(correct.iter().copied()).collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    let n = ranked.len();
    let mut best = Calibrated {
        threshold: Threshold::NOTHING,
        precision,
        risk,
        scope,
        n,
        n_accepted: 0,
        n_correct: 0,
    };
    let level = risk / N_STARTS as f64;
    let table = LogFactorials::up_to(2 * n);
    let first = smallest_testable(&table, goal, level, n);
    for start in starts(first, n) {
        // One past the last rank accepts every calibration query.
        for rank in (start..n).step_by(step(n)).chain([n]) {
            let limit = ranked.get(rank).map_or(f64::INFINITY, |it| it.0);
            let n_accepted = ranked[..rank].partition_point(|it| it.0 < limit);
            if n_accepted < first {
                continue;
            }
            let n_correct = ranked[..n_accepted].iter().filter(|it| it.1).count();
            if p_value(&table, n_accepted - n_correct, n_accepted, goal) > level {
                break;
            }
            if n_accepted > best.n_accepted {
                let threshold = Threshold::below(limit)?;
                best = Calibrated { threshold, n_accepted, n_correct, ..best };
            }
        }
    }
    Ok(best)
}

/// Fewest accepted matches, of `n`, that can pass a test, all of them being correct.
fn smallest_testable(table: &LogFactorials, goal: PrecisionGoal, level: f64, n: usize) -> usize {
    (1..=n).find(|&accepted| p_value(table, 0, accepted, goal) <= level).unwrap_or(usize::MAX)
}

/// Ranks at which sequences start, spread over those that can pass.
fn starts(first: usize, n: usize) -> Vec<usize> {
    if first > n {
        return Vec::new();
    }
    (0..N_STARTS).map(|i| first + (n - first) * i / N_STARTS).collect()
}

/// About a hundred ranks are tested.
fn step(n: usize) -> usize {
    (n / 100).max(1)
}

/// A p-value for "the precision is lower than wanted", given `wrong` of `accepted`.
fn p_value(table: &LogFactorials, wrong: usize, accepted: usize, goal: PrecisionGoal) -> f64 {
    let allowed = 1.0 - goal.precision;
    match goal.scope {
        Scope::Population => table.tail(wrong, accepted, allowed, 1.0),
        Scope::NextBatch => {
            // The promise breaks if more than this many of the next matches are wrong.
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
            let tolerated = (allowed * accepted as f64 + 1e-9).floor() as usize;
            let broken = tolerated + 1;
            if broken > accepted {
                return 0.0;
            }
            // Largest over all totals that would break it: the smallest such total.
            table.hypergeometric_tail(wrong, 2 * accepted, wrong + broken, accepted)
        }
    }
}

impl fmt::Display for Calibrated {
    /// The guarantee in words.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.threshold == Threshold::NOTHING {
            return write!(
                f,
                "No threshold can be promised a precision of {} at risk {} from these {} calibration queries: \
                 nothing is accepted.",
                self.precision, self.risk, self.n
            );
        }
        let whose = match self.scope {
            Scope::Population => "of the accepted matches are correct in expectation".to_owned(),
            Scope::NextBatch => {
                format!("of the next {} accepted matches are correct", self.n_accepted)
            }
        };
        write!(
            f,
            "{}: at least {} {whose}, whatever their distribution, if new queries come from the same one. Of all \
             calibration sets at most a share of {} breaks this, those without a threshold counted as kept; of \
             those with one, at most {} divided by their share. In calibration {} of {} were accepted, {} of them \
             correct.",
            self.threshold.rule(),
            self.precision,
            self.risk,
            self.risk,
            self.n_accepted,
            self.n,
            self.n_correct
        )
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Matches whose chance of being wrong grows with uncertainty, from 0 to `worst`.
    fn draw(n: usize, worst: f64, rng: &mut ChaCha8Rng) -> (Vec<f64>, Vec<bool>) {
        (0..n)
            .map(|_| {
                let uncertainty: f64 = rng.random();
                (uncertainty, rng.random::<f64>() >= uncertainty * worst)
            })
            .unzip()
    }

    #[test]
    fn the_promise_holds_where_the_truth_is_known() {
        // Precision below τ is 1 − 0.2 τ / 2 exactly.
        let goal = PrecisionGoal { precision: 0.95, risk: 0.1, scope: Scope::Population };
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let (mut broken, mut used) = (0, 0);
        for _ in 0..500 {
            let (uncertainty, correct) = draw(1500, 0.2, &mut rng);
            let result = calibrate_precision(&uncertainty, &correct, goal).unwrap();
            let limit = result.threshold.limit().clamp(0.0, 1.0);
            used += usize::from(result.n_accepted > 0);
            broken += usize::from(limit * 0.2 / 2.0 > 0.05);
        }
        assert!(broken <= 50, "{broken} of 500 broke it");
        assert!(used > 300, "{used} of 500 found a threshold");
    }

    #[test]
    fn the_next_batch_keeps_it_too() {
        let goal = PrecisionGoal { precision: 0.9, risk: 0.1, scope: Scope::NextBatch };
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut broken = 0;
        for _ in 0..500 {
            let (uncertainty, correct) = draw(300, 0.5, &mut rng);
            let result = calibrate_precision(&uncertainty, &correct, goal).unwrap();
            let (uncertainty, correct) = draw(300, 0.5, &mut rng);
            let accepted: Vec<bool> = uncertainty
                .iter()
                .zip(&correct)
                .filter(|it| result.threshold.accepts(*it.0))
                .map(|it| *it.1)
                .collect();
            let n_correct = accepted.iter().filter(|&&it| it).count();
            broken += usize::from((n_correct as f64) < 0.9 * accepted.len() as f64 - 1e-9);
        }
        assert!(broken <= 50, "{broken} of 500 broke it");
    }

    #[test]
    fn too_few_queries_promise_nothing() {
        let goal = PrecisionGoal { precision: 0.95, risk: 0.1, scope: Scope::Population };
        let result = calibrate_precision(&[0.1; 20], &[true; 20], goal).unwrap();
        assert_eq!(result.threshold, Threshold::NOTHING);
        assert!(result.to_string().contains("nothing is accepted"), "{result}");
    }

    #[test]
    fn perfect_matches_are_all_accepted() {
        let goal = PrecisionGoal { precision: 0.95, risk: 0.1, scope: Scope::Population };
        let uncertainty: Vec<f64> = (0..200).map(f64::from).collect();
        let result = calibrate_precision(&uncertainty, &[true; 200], goal).unwrap();
        assert_eq!(result.n_accepted, 200);
        assert!(result.to_string().starts_with("Accept every match: at least 0.95"), "{result}");
    }

    #[test]
    fn equal_uncertainties_are_accepted_together() {
        let goal = PrecisionGoal { precision: 0.95, risk: 0.1, scope: Scope::Population };
        let accepted = |uncertainty: &[f64], correct: &[bool]| {
            calibrate_precision(uncertainty, correct, goal).unwrap().n_accepted
        };
        // All the same, in halves, and most at the lowest or the highest value.
        assert_eq!(accepted(&[0.0; 200], &[true; 200]), 200);
        for low in [1, 20, 100, 150, 199] {
            let uncertainty: Vec<f64> = (0..200).map(|i| f64::from(u8::from(i >= low))).collect();
            assert_eq!(accepted(&uncertainty, &[true; 200]), 200, "{low} of 200 at 0");
            // Where the higher half is wrong, the lower one is accepted if it is enough.
            let correct: Vec<bool> = (0..200).map(|i| i < low).collect();
            let expected = if low < 59 {
                0
            } else if low > 195 {
                200
            } else {
                low
            };
            assert_eq!(accepted(&uncertainty, &correct), expected, "{low} of 200 at 0");
        }
    }
}
