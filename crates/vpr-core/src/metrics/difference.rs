//! Whether two methods differ in a metric of the same queries, and how many queries that needs.

use super::{
    bootstrap::{Interval, Resampling, resample},
    mcnemar::between_0_and_1,
    normal,
};
use crate::Result;

/// A difference of two methods on the same queries.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// The difference, first minus second, with its percentile interval.
    pub interval: Interval,
    /// Two-sided p-value that there is none: twice the share of resamples on the rarer side of 0, that
    /// of the methods as they are counted as one more resample (Davison and Hinkley 1997, 4.2). With
    /// `n` resamples it is not below `2 / (n + 1)`.
    pub p_value: f64,
    /// Standard deviation of the resampled differences.
    pub standard_error: f64,
    /// Number of queries.
    pub n_queries: usize,
}

/// Tests the difference `first − second` of two statistics over the same drawn queries, by the
/// resamples of [`paired_bootstrap`](super::bootstrap::paired_bootstrap).
///
/// # Errors
///
/// As [`percentile_bootstrap`](super::bootstrap::percentile_bootstrap).
pub fn paired_test(
    n_queries: usize,
    resampling: &Resampling,
    first: impl Fn(&[usize]) -> Result<f64> + Sync,
    second: impl Fn(&[usize]) -> Result<f64> + Sync,
) -> Result<Difference> {
    let resampled =
        resample(n_queries, resampling, |queries| Ok(first(queries)? - second(queries)?))?;
    let values = &resampled.values;
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|it| (it - mean).powi(2)).sum();
    Ok(Difference {
        interval: resampled.interval(resampling.level),
        p_value: share_beyond_zero(values),
        standard_error: (squares / (n - 1.0).max(1.0)).sqrt(),
        n_queries,
    })
}

/// Twice the share of differences on the rarer side of 0, one more counted there: the p-value of a
/// [`Difference`].
pub(crate) fn share_beyond_zero(differences: &[f64]) -> f64 {
    let not_above = differences.iter().filter(|it| **it <= 0.0).count();
    let not_below = differences.iter().filter(|it| **it >= 0.0).count();
    let rarer = not_above.min(not_below) as f64;
    (2.0 * (rarer + 1.0) / (differences.len() as f64 + 1.0)).min(1.0)
}

impl Difference {
    /// The chance that a test at `level` calls the methods different with this many queries, if the
    /// difference is as large as it was seen and its standard error falls with the root of the
    /// number of queries; by the normal distribution.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Parameter`] if the level is not between 0 and 1.
    pub fn power(&self, n_queries: usize, level: f64) -> Result<f64> {
        between_0_and_1("level", level)?;
        if self.standard_error == 0.0 {
            return Ok(f64::from(u8::from(self.interval.estimate != 0.0)));
        }
        let at_one = self.interval.estimate.abs() / self.standard_error;
        let away = at_one * (n_queries as f64 / self.n_queries as f64).sqrt();
        let limit = normal::quantile(1.0 - level / 2.0);
        Ok(normal::at_most(away - limit) + normal::at_most(-away - limit))
    }

    /// The fewest queries with which the power reaches `power`: `n · ((z + z′) · s / d)²`; `None`
    /// without a difference.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Parameter`] if the level or the power is not between 0 and 1.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a number of queries"
    )]
    pub fn queries_for(&self, power: f64, level: f64) -> Result<Option<usize>> {
        between_0_and_1("level", level)?;
        between_0_and_1("power", power)?;
        if self.interval.estimate == 0.0 {
            return Ok(None);
        }
        let z = (normal::quantile(1.0 - level / 2.0) + normal::quantile(power)).max(0.0);
        let queries =
            (z * self.standard_error / self.interval.estimate).powi(2) * self.n_queries as f64;
        Ok(Some(queries.ceil().max(1.0) as usize))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::bootstrap::pick;

    fn mean(values: &[f64]) -> impl Fn(&[usize]) -> Result<f64> + Sync {
        |queries| Ok(pick(values, queries).iter().sum::<f64>() / queries.len() as f64)
    }

    #[test]
    fn a_difference_of_means_has_the_error_of_statistics() {
        // Differences of −1, 0, 1, 2 in turn: mean 1/2, variance 5/4.
        let first: Vec<f64> = (0..200_u8).map(|query| f64::from(query % 4) - 1.0).collect();
        let second = vec![0.0; 200];
        let resampling = Resampling::default();
        let test = paired_test(200, &resampling, mean(&first), mean(&second)).unwrap();
        assert_eq!(test.interval.estimate, 0.5);
        approx::assert_abs_diff_eq!(
            test.standard_error,
            (1.25_f64 / 200.0).sqrt(),
            epsilon = 0.004
        );
        approx::assert_abs_diff_eq!(test.p_value, 2.0 / 2001.0, epsilon = 1e-12);
        // (1.96 + 0.84)² · 1.25 / 0.25 = 39.2 queries.
        let needed = test.queries_for(0.8, 0.05).unwrap().unwrap();
        assert!((36..44).contains(&needed), "{needed}");
        approx::assert_abs_diff_eq!(test.power(needed, 0.05).unwrap(), 0.8, epsilon = 0.01);
    }

    #[test]
    fn a_method_does_not_differ_from_itself() {
        let values: Vec<f64> = (0..30_u8).map(f64::from).collect();
        let resampling = Resampling { n_resamples: 100, ..Resampling::default() };
        let same = paired_test(30, &resampling, mean(&values), mean(&values)).unwrap();
        assert_eq!((same.p_value, same.standard_error), (1.0, 0.0));
        assert_eq!(
            (same.power(1000, 0.05).unwrap(), same.queries_for(0.8, 0.05).unwrap()),
            (0.0, None)
        );
        assert!(same.power(10, 1.0).is_err() && same.queries_for(1.0, 0.05).is_err());
    }
}
