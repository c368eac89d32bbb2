//! How far a metric would vary with other queries: bootstrap and Wilson intervals. Those of areas
//! under curves are in [`effective`](super::effective).

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::{Error, Result};

/// How often and from which seed to resample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resampling {
    /// How many resamples to draw; 2000 by default.
    pub n_resamples: usize,
    /// Share of the resamples the interval holds; 0.95 by default.
    pub level: f64,
    /// Seed of the draws (`ChaCha8`, one stream per resample); 0 by default.
    pub seed: u64,
}

impl Default for Resampling {
    fn default() -> Self {
        Self { n_resamples: 2000, level: 0.95, seed: 0 }
    }
}

/// A value and the interval around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The statistic of all queries as they are.
    pub estimate: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// How many resamples had no value and were left out; 0 where nothing is resampled.
    pub n_undefined: usize,
}

/// Percentile bootstrap of any statistic over queries (Efron).
///
/// It holds for differences of two techniques on the same queries ([`paired_bootstrap`]) and for
/// means of many queries. It does **not** hold for areas under curves and other values near 0 or 1:
/// 95 % intervals of AUC-PR at a base rate of .95 hold the truth in 64 to 87 % of samples of 50 to
/// 300 queries (`docs/statistics.md`). For those there are
/// [`Evaluation::auc_pr_interval`](crate::Evaluation::auc_pr_interval) and
/// [`Evaluation::auc_roc_interval`](crate::Evaluation::auc_roc_interval).
///
/// `statistic` gets indices of queries, first `0..n_queries`, then as many drawn with replacement for
/// each resample; [`pick`] applies them to a slice. Everything that counts queries must be drawn too:
/// `n_known` of [`Positives`](super::Positives) is to be counted among the drawn queries. The ends are
/// the `(1 − level) / 2` and `(1 + level) / 2` quantiles of the resampled values, interpolated
/// linearly as NumPy's `percentile`.
///
/// Resamples for which the statistic is [`Error::Undefined`] are left out and counted, so the
/// interval is *given that the metric has a value*; with fewer than half of them left there is no
/// interval. Resample `i` is drawn from stream `i` of the seed: the result is the same for any number
/// of threads.
///
/// # Errors
///
/// [`Error::Empty`] without queries, [`Error::Parameter`] if there is no resample or the level is not
/// between 0 and 1, [`Error::Undefined`] if the statistic has no value for all queries or for more
/// than half of the resamples, [`Error::NotFinite`] if it gives NaN or infinity, and other errors of
/// the statistic.
pub fn percentile_bootstrap(
    n_queries: usize,
    resampling: &Resampling,
    statistic: impl Fn(&[usize]) -> Result<f64> + Sync,
) -> Result<Interval> {
    Ok(resample(n_queries, resampling, statistic)?.interval(resampling.level))
}

/// A statistic of all queries, and of every resample that has one.
pub(super) struct Resampled {
    pub(super) estimate: f64,
    /// Ascending, at least one.
    pub(super) values: Vec<f64>,
    pub(super) n_undefined: usize,
}

impl Resampled {
    /// The middle share of the resampled values.
    pub(super) fn interval(&self, level: f64) -> Interval {
        let tail = (1.0 - level) / 2.0;
        let (low, high) = (quantile(tail, &self.values), quantile(1.0 - tail, &self.values));
        Interval { estimate: self.estimate, low, high, n_undefined: self.n_undefined }
    }
}

/// What [`percentile_bootstrap`] resamples, with its errors.
pub(super) fn resample(
    n_queries: usize,
    resampling: &Resampling,
    statistic: impl Fn(&[usize]) -> Result<f64> + Sync,
) -> Result<Resampled> {
    check(n_queries, resampling)?;
    let all: Vec<usize> = (0..n_queries).collect();
    let estimate = finite(0, statistic(&all)?)?;
    let resampled: Vec<Result<f64>> = (0..resampling.n_resamples)
        .into_par_iter()
        .map(|resample| statistic(&draw(n_queries, resampling.seed, resample)))
        .collect();
    let mut values = Vec::with_capacity(resampled.len());
    for (resample, value) in resampled.into_iter().enumerate() {
        match value {
            Ok(value) => values.push(finite(resample, value)?),
            Err(Error::Undefined { .. }) => {}
            Err(err) => return Err(err),
        }
    }
    let n_undefined = resampling.n_resamples - values.len();
    if n_undefined > values.len() {
        let reason = "the statistic has no value for more than half of the resamples";
        return Err(Error::Undefined { metric: "the bootstrap interval", reason });
    }
    values.sort_unstable_by(f64::total_cmp);
    Ok(Resampled { estimate, values, n_undefined })
}

/// Percentile bootstrap of the difference `first − second` of two statistics over the *same* drawn queries, as
/// for two techniques on one dataset.
///
/// An interval without 0 says the two differ beyond the choice of queries. A resample is undefined if
/// either statistic is.
///
/// # Errors
///
/// As [`percentile_bootstrap`].
pub fn paired_bootstrap(
    n_queries: usize,
    resampling: &Resampling,
    first: impl Fn(&[usize]) -> Result<f64> + Sync,
    second: impl Fn(&[usize]) -> Result<f64> + Sync,
) -> Result<Interval> {
    percentile_bootstrap(n_queries, resampling, |queries| Ok(first(queries)? - second(queries)?))
}

/// The values of the drawn queries, in the order drawn.
///
/// # Panics
///
/// If a query is not below `values.len()`.
#[must_use]
pub fn pick<T: Copy>(values: &[T], queries: &[usize]) -> Vec<T> {
    queries.iter().map(|&query| values[query]).collect()
}

/// The standard normal quantile of a two-sided 95 % interval, for [`wilson_interval`].
pub const Z_95: f64 = 1.959_963_984_540_054;

/// Wilson's score interval of a share, `n_hits` of `n` (Wilson 1927): with `p = n_hits / n`,
/// `(p + z²/2n ± z·√(p(1 − p)/n + z²/4n²)) / (1 + z²/n)`.
///
/// For Recall@N and other shares of queries; unlike the bootstrap it says something at 0 and 1.
///
/// # Errors
///
/// [`Error::Empty`] if `n` is zero, [`Error::Parameter`] if there are more hits than `n` or `z` is not
/// positive and finite.
pub fn wilson_interval(n_hits: usize, n: usize, z: f64) -> Result<Interval> {
    if n == 0 {
        return Err(Error::Empty("queries"));
    }
    if n_hits > n {
        let reason = "more hits than queries";
        return Err(Error::Parameter { name: "n_hits", value: n_hits.to_string(), reason });
    }
    super::platform::check_positive("z", z)?;
    let (share, count) = (n_hits as f64 / n as f64, n as f64);
    let (low, high) = wilson(share, count, z);
    Ok(Interval {
        estimate: share,
        low: if n_hits == 0 { 0.0 } else { low },
        high: if n_hits == n { 1.0 } else { high },
        n_undefined: 0,
    })
}

/// Wilson's interval of a share of `count` queries, which need not be whole.
pub(super) fn wilson(share: f64, count: f64, z: f64) -> (f64, f64) {
    let squared = z * z;
    let shrink = 1.0 + squared / count;
    let centre = (share + squared / (2.0 * count)) / shrink;
    let spread = share * (1.0 - share) / count + squared / (4.0 * count * count);
    let reach = z * spread.sqrt() / shrink;
    (centre - reach, centre + reach)
}

fn check(n_queries: usize, resampling: &Resampling) -> Result<()> {
    if n_queries == 0 {
        return Err(Error::Empty("queries"));
    }
    let refuse = |name, value, reason| Err(Error::Parameter { name, value, reason });
    if resampling.n_resamples == 0 {
        return refuse("n_resamples", "0".to_owned(), "must be at least 1");
    }
    if !(resampling.level > 0.0 && resampling.level < 1.0) {
        return refuse("level", resampling.level.to_string(), "must be between 0 and 1");
    }
    Ok(())
}

/// Draws `n_queries` queries with replacement, always the same for the same seed and resample.
#[expect(clippy::cast_possible_truncation, reason = "a query index fits usize")]
pub(crate) fn draw(n_queries: usize, seed: u64, resample: usize) -> Vec<usize> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(resample as u64);
    // Drawn as u64, so that it does not depend on the width of usize.
    (0..n_queries).map(|_| rng.random_range(0..n_queries as u64) as usize).collect()
}

fn finite(row: usize, value: f64) -> Result<f64> {
    if value.is_finite() {
        return Ok(value);
    }
    Err(Error::NotFinite { what: "values of the resampled statistic", row, column: 0, value })
}

/// Quantile of ascending values, at least one, interpolated linearly between neighbours.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index of values")]
fn quantile(share: f64, ascending: &[f64]) -> f64 {
    let position = share * (ascending.len() - 1) as f64;
    let below = (position.floor() as usize).min(ascending.len() - 1);
    let above = (below + 1).min(ascending.len() - 1);
    ascending[below] + (position - below as f64) * (ascending[above] - ascending[below])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mean(values: &[f64]) -> impl Fn(&[usize]) -> Result<f64> + Sync {
        |queries| Ok(pick(values, queries).iter().sum::<f64>() / queries.len() as f64)
    }

    #[test]
    fn the_interval_of_a_mean_is_near_the_normal_one() {
        let values: Vec<f64> = (0..400_u16).map(|query| f64::from(query % 20)).collect();
        let interval = percentile_bootstrap(400, &Resampling::default(), mean(&values)).unwrap();
        assert_eq!(interval.estimate, 9.5);
        // Standard error √(33.25 / 400) = 0.288.
        approx::assert_abs_diff_eq!(interval.low, 9.5 - 1.96 * 0.288, epsilon = 0.06);
        approx::assert_abs_diff_eq!(interval.high, 9.5 + 1.96 * 0.288, epsilon = 0.06);
    }

    #[test]
    fn one_thread_and_three_give_the_same_bits() {
        let values: Vec<f64> = (0..50_u8).map(|query| f64::from(query).sqrt()).collect();
        let run = |n_threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
            pool.install(|| {
                percentile_bootstrap(50, &Resampling::default(), mean(&values)).unwrap()
            })
        };
        assert_eq!(run(1), run(3));
        let other = Resampling { seed: 1, ..Resampling::default() };
        assert_ne!(run(1), percentile_bootstrap(50, &other, mean(&values)).unwrap());
    }

    #[test]
    fn undefined_resamples_are_left_out_and_counted() {
        // Undefined unless query 0 is drawn: 1 − (9/10)¹⁰ = 65 % of the resamples have a value.
        let needs = |needed: usize| {
            move |queries: &[usize]| {
                if queries.iter().filter(|&&query| query == 0).count() >= needed {
                    return Ok(1.0);
                }
                Err(Error::Undefined { metric: "test", reason: "query 0 is missing" })
            }
        };
        let interval = percentile_bootstrap(10, &Resampling::default(), needs(1)).unwrap();
        assert!((600..800).contains(&interval.n_undefined), "{}", interval.n_undefined);
        let all_wrong = percentile_bootstrap(10, &Resampling::default(), needs(2));
        assert!(matches!(all_wrong, Err(Error::Undefined { metric: "test", .. })));
        let rare =
            |queries: &[usize]| if queries[1] == 1 { needs(1)(queries) } else { needs(9)(queries) };
        let err = percentile_bootstrap(10, &Resampling::default(), rare);
        assert!(matches!(err, Err(Error::Undefined { metric: "the bootstrap interval", .. })));
    }

    #[test]
    fn a_technique_does_not_differ_from_itself() {
        let values: Vec<f64> = (0..30_u8).map(f64::from).collect();
        let same = paired_bootstrap(30, &Resampling::default(), mean(&values), mean(&values));
        let same = same.unwrap();
        assert_eq!((same.low, same.high), (0.0, 0.0));
        let better: Vec<f64> = values.iter().map(|value| value + 1.0).collect();
        let gain = paired_bootstrap(30, &Resampling::default(), mean(&better), mean(&values));
        approx::assert_abs_diff_eq!(gain.unwrap().low, 1.0, epsilon = 1e-12);
    }

    #[test]
    fn impossible_parameters_are_refused() {
        let run = |n, resampling| percentile_bootstrap(n, &resampling, |_| Ok(1.0));
        let default = Resampling::default();
        assert!(matches!(run(0, default), Err(Error::Empty(_))));
        let none = Resampling { n_resamples: 0, ..default };
        assert!(matches!(run(3, none), Err(Error::Parameter { name: "n_resamples", .. })));
        let level = Resampling { level: 95.0, ..default };
        assert!(matches!(run(3, level), Err(Error::Parameter { name: "level", .. })));
        let nan = percentile_bootstrap(3, &default, |_| Ok(f64::NAN));
        assert!(matches!(nan, Err(Error::NotFinite { .. })));
    }

    #[test]
    fn wilson_agrees_with_scipy() {
        // scipy.stats.binomtest(75, 111).proportion_ci(0.95, "wilson").
        let interval = wilson_interval(75, 111, Z_95).unwrap();
        approx::assert_abs_diff_eq!(interval.low, 0.583_981_343_537_928_4, epsilon = 1e-12);
        approx::assert_abs_diff_eq!(interval.high, 0.755_617_268_326_555_4, epsilon = 1e-12);
        assert_eq!(wilson_interval(0, 10, Z_95).unwrap().low, 0.0);
        assert_eq!(wilson_interval(10, 10, Z_95).unwrap().high, 1.0);
        assert!(matches!(wilson_interval(0, 0, Z_95), Err(Error::Empty(_))));
        assert!(matches!(wilson_interval(2, 1, Z_95), Err(Error::Parameter { .. })));
    }
}
