//! Two methods or estimators on the same queries.

use super::Evaluation;
use crate::{
    Definition, Error, Result,
    metrics::{
        Difference,
        bootstrap::{Interval, Resampling},
        paired_test,
    },
};

impl Evaluation<'_> {
    /// Percentile bootstrap interval of the difference of AUC-PR, this estimator minus another, over
    /// the same drawn queries; an interval without 0 is a difference beyond the choice of queries.
    ///
    /// Both estimators must be about the same matches; recall is relative to the correct ones.
    ///
    /// # Errors
    ///
    /// As [`Self::auc_pr_test`].
    pub fn auc_pr_difference(&self, other: &Self, resampling: &Resampling) -> Result<Interval> {
        Ok(self.auc_pr_test(other, Definition::Published, resampling)?.interval)
    }

    /// Tests the difference of AUC-PR, this method minus another, over the same drawn queries.
    ///
    /// Methods that find different matches are compared under [`Definition::Corrected`], by which
    /// recall of both is relative to the same queries.
    ///
    /// # Errors
    ///
    /// [`Error::Mismatch`] if the queries are not equally many, and those of
    /// [`paired_test`](crate::metrics::paired_test).
    pub fn auc_pr_test(
        &self,
        other: &Self,
        definition: Definition,
        resampling: &Resampling,
    ) -> Result<Difference> {
        let (expected, actual) = (self.judged.len(), other.judged.len());
        if expected != actual {
            let what = "queries of two estimators";
            return Err(Error::Mismatch { what, expected, actual });
        }
        let of = |it: &Self, queries: &[usize]| it.resampled(queries, definition);
        let (first, second) = (|it: &[usize]| of(self, it), |it: &[usize]| of(other, it));
        paired_test(expected, resampling, first, second)
    }

    /// [`metrics::auc_pr`] of drawn queries, without sorting again.
    pub(super) fn resampled(&self, queries: &[usize], definition: Definition) -> Result<f64> {
        let mut counts = vec![0_u32; self.judged.len()];
        for &query in queries {
            counts[query] += 1;
        }
        let (mut accepted, mut right, mut start) = (0.0, 0.0, 0);
        // Twice the area times the number of positives, from the artificial point (0, 1).
        let (mut area, mut precision) = (0.0, 1.0);
        for &end in &self.ends {
            let (before, mut drawn) = (right, 0.0);
            for &query in &self.order[start..end] {
                let count = f64::from(counts[query]);
                drawn += count;
                if self.judged.correct[query] {
                    right += count;
                }
            }
            start = end;
            if drawn > 0.0 {
                accepted += drawn;
                let here = right / accepted;
                area += (right - before) * (precision + here);
                precision = here;
            }
        }
        let positives = match definition {
            Definition::Published => right,
            Definition::Corrected => {
                queries.iter().filter(|&&query| self.judged.known[query]).count() as f64
            }
        };
        if positives == 0.0 {
            let reason = "no drawn query has a correct match";
            return Err(Error::Undefined { metric: "the precision-recall curve", reason });
        }
        Ok(area / 2.0 / positives)
    }
}
