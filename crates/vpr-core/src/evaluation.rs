//! Judged matches and how well a confidence or an uncertainty orders them: precision and recall,
//! risk and coverage, intervals, comparisons.

mod best;
mod difference;

use crate::{
    Definition, Error, GroundTruth, Result,
    metrics::{
        self, Positives,
        bootstrap::Interval,
        effective::{self, Group},
    },
};
use serde::Serialize;

pub use best::{best_by_auc_pr, best_by_hits};

/// The best matches of a set of queries, judged.
#[derive(Clone, Debug, PartialEq)]
pub struct Judged {
    correct: Vec<bool>,
    known: Vec<bool>,
}

/// The uncertainties of one estimator about judged matches.
#[derive(Clone, Debug)]
pub struct Evaluation<'a> {
    judged: &'a Judged,
    confidence: Vec<f64>,
    /// Queries in groups of equal confidence, highest first.
    order: Vec<usize>,
    /// Ends of the groups in `order`.
    ends: Vec<usize>,
}

/// All numbers about one estimator.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Number of queries.
    pub n: usize,
    /// Share of correct best matches: what accepting everything gives.
    pub base_rate: f64,
    /// [`metrics::auc_pr`], recall relative to the correct matches.
    pub auc_pr_published: Option<f64>,
    /// [`metrics::auc_pr`], recall relative to the queries with a correct reference.
    pub auc_pr_corrected: Option<f64>,
    /// [`metrics::auc_roc`] of correct against wrong matches.
    pub auc_roc: Option<f64>,
    /// [`metrics::aurc`].
    pub aurc: f64,
    /// [`metrics::excess_aurc`].
    pub excess_aurc: f64,
    /// [`metrics::recall_at_precision`] at 0.95, relative to the queries with a correct reference.
    pub recall_at_95_precision: Option<f64>,
}

impl Judged {
    /// Judges the best reference of every query.
    ///
    /// # Errors
    ///
    /// [`Error::Mismatch`] if there is not one best reference per query of the truth,
    /// [`Error::Empty`] without queries.
    pub fn new(best: &[usize], truth: &GroundTruth) -> Result<Self> {
        let correct = truth.judge(best)?;
        let known = (0..truth.len()).map(|query| !truth.is_new_place(query)).collect();
        Self::from_flags(correct, known)
    }

    /// Takes judgements: whether each best match is correct, and whether the map has anything
    /// correct for the query.
    ///
    /// # Errors
    ///
    /// [`Error::Mismatch`] if the lengths differ, [`Error::Empty`] without queries.
    pub fn from_flags(correct: Vec<bool>, known: Vec<bool>) -> Result<Self> {
        let (expected, actual) = (correct.len(), known.len());
        if expected != actual {
            let what = "queries that are known or not, one per judgement";
            return Err(Error::Mismatch { what, expected, actual });
        }
        if correct.is_empty() {
            return Err(Error::Empty("queries"));
        }
        Ok(Self { correct, known })
    }

    /// Whether the best match of each query is correct.
    #[must_use]
    pub fn correct(&self) -> &[bool] {
        &self.correct
    }

    /// Number of queries.
    #[must_use]
    pub fn len(&self) -> usize {
        self.correct.len()
    }

    /// Whether there is no query; never, by construction.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.correct.is_empty()
    }

    /// Share of correct best matches.
    #[must_use]
    pub fn base_rate(&self) -> f64 {
        self.correct.iter().filter(|&&it| it).count() as f64 / self.len() as f64
    }

    /// The denominator of recall under a definition.
    #[must_use]
    pub fn positives(&self, definition: Definition) -> Positives {
        match definition {
            Definition::Published => Positives::Published,
            Definition::Corrected => {
                Positives::Corrected { n_known: self.known.iter().filter(|&&it| it).count() }
            }
        }
    }
}

impl<'a> Evaluation<'a> {
    /// Joins uncertainties with the judgements of the same queries.
    ///
    /// # Errors
    ///
    /// [`Error::Mismatch`] if they are not equally many, [`Error::NotFinite`] names the query whose
    /// uncertainty is not finite.
    pub fn new(uncertainty: &[f64], judged: &'a Judged) -> Result<Self> {
        check("uncertainties", uncertainty, judged)?;
        Ok(Self::ordered(uncertainty.iter().map(|it| 0.0 - it).collect(), judged))
    }

    /// Joins confidences (higher is more certain: similarities, say) with the judgements of the
    /// same queries.
    ///
    /// # Errors
    ///
    /// As [`Self::new`].
    pub fn of_confidence(confidence: &[f64], judged: &'a Judged) -> Result<Self> {
        check("confidences", confidence, judged)?;
        // Adding zero makes −0 a 0, so that equal numbers are neighbours in the total order.
        Ok(Self::ordered(confidence.iter().map(|it| 0.0 + it).collect(), judged))
    }

    fn ordered(confidence: Vec<f64>, judged: &'a Judged) -> Self {
        let mut order: Vec<usize> = (0..confidence.len()).collect();
        order.sort_by(|&a, &b| confidence[b].total_cmp(&confidence[a]).then(a.cmp(&b)));
        let groups = order.chunk_by(|&a, &b| confidence[a] == confidence[b]);
        let ends = groups
            .scan(0, |end, group| {
                *end += group.len();
                Some(*end)
            })
            .collect();
        Self { judged, confidence, order, ends }
    }

    /// The judgements.
    #[must_use]
    pub fn judged(&self) -> &'a Judged {
        self.judged
    }

    /// The negative uncertainties, higher is more certain.
    #[must_use]
    pub fn confidence(&self) -> &[f64] {
        &self.confidence
    }

    /// [`metrics::auc_pr`] under a definition.
    ///
    /// # Errors
    ///
    /// [`Error::Undefined`] if nothing is correct or known.
    pub fn auc_pr(&self, definition: Definition) -> Result<f64> {
        let positives = self.judged.positives(definition);
        metrics::auc_pr(&self.confidence, &self.judged.correct, positives)
    }

    /// [`metrics::average_precision`] under a definition.
    ///
    /// # Errors
    ///
    /// [`Error::Undefined`] if nothing is correct or known.
    pub fn average_precision(&self, definition: Definition) -> Result<f64> {
        let positives = self.judged.positives(definition);
        metrics::average_precision(&self.confidence, &self.judged.correct, positives)
    }

    /// All numbers; those without a value for these queries are `None`.
    ///
    /// # Errors
    ///
    /// None for judged matches, but what the metrics report.
    pub fn summary(&self) -> Result<Summary> {
        let (confidence, correct) = (&self.confidence, &self.judged.correct);
        let corrected = self.judged.positives(Definition::Corrected);
        Ok(Summary {
            n: self.judged.len(),
            base_rate: self.judged.base_rate(),
            auc_pr_published: defined(self.auc_pr(Definition::Published))?,
            auc_pr_corrected: defined(self.auc_pr(Definition::Corrected))?,
            auc_roc: defined(metrics::auc_roc(confidence, correct))?,
            aurc: metrics::aurc(confidence, correct)?,
            excess_aurc: metrics::excess_aurc(confidence, correct)?,
            recall_at_95_precision: defined(metrics::recall_at_precision(
                0.95, confidence, correct, corrected,
            ))?,
        })
    }

    /// [`Self::auc_pr`] with its 95 % interval, [`effective::METHOD`]: Wilson's for as many queries as
    /// the area is worth. It holds for any base rate; `docs/statistics.md` has its coverage.
    ///
    /// # Errors
    ///
    /// As [`Self::auc_pr`].
    pub fn auc_pr_interval(&self, definition: Definition) -> Result<Interval> {
        let estimate = self.auc_pr(definition)?;
        Ok(effective::precision_recall(&self.groups(), estimate, definition))
    }

    /// [`metrics::auc_roc`] of correct against wrong matches with its 95 % interval,
    /// [`effective::METHOD`].
    ///
    /// # Errors
    ///
    /// As [`metrics::auc_roc`].
    pub fn auc_roc_interval(&self) -> Result<Interval> {
        let estimate = metrics::auc_roc(&self.confidence, &self.judged.correct)?;
        Ok(effective::roc(&self.groups(), estimate))
    }

    /// The matches of each confidence, highest first.
    fn groups(&self) -> Vec<Group> {
        let starts = std::iter::once(&0).chain(&self.ends);
        let group = |(&start, &end): (&usize, &usize)| {
            let mut group = Group::default();
            for &query in &self.order[start..end] {
                *match (self.judged.correct[query], self.judged.known[query]) {
                    (true, _) => &mut group.right,
                    (false, true) => &mut group.wrong,
                    (false, false) => &mut group.unknown,
                } += 1.0;
            }
            group
        };
        starts.zip(&self.ends).map(group).collect()
    }
}

/// One finite value per judged query.
fn check(what: &'static str, values: &[f64], judged: &Judged) -> Result<()> {
    let (expected, actual) = (judged.len(), values.len());
    if expected != actual {
        return Err(Error::Mismatch { what, expected, actual });
    }
    match values.iter().position(|it| !it.is_finite()) {
        None => Ok(()),
        Some(row) => Err(Error::NotFinite { what, row, column: 0, value: values[row] }),
    }
}

/// `None` instead of an error that says there is no value.
fn defined(value: Result<f64>) -> Result<Option<f64>> {
    match value {
        Ok(value) => Ok(Some(value)),
        Err(Error::Undefined { .. }) => Ok(None),
        Err(err) => Err(err),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::metrics::bootstrap::Resampling;

    proptest! {
        #[test]
        fn the_fast_area_of_drawn_queries_is_the_metric_of_drawn_queries(
            matches in prop::collection::vec((0_u8..12, any::<bool>()), 2..40),
            start in 0_usize..1000,
        ) {
            let uncertainty: Vec<f64> = matches.iter().map(|it| f64::from(it.0)).collect();
            let correct: Vec<bool> = matches.iter().map(|it| it.1).collect();
            let known: Vec<bool> = correct.iter().enumerate().map(|(i, c)| *c || i % 3 > 0).collect();
            let judged = Judged::from_flags(correct.clone(), known.clone()).unwrap();
            let evaluation = Evaluation::new(&uncertainty, &judged).unwrap();
            let draw = |i: usize| (start + i * 7) % matches.len();
            let queries: Vec<usize> = (0..matches.len()).map(draw).collect();
            let pick = |flags: &[bool]| queries.iter().map(|&query| flags[query]).collect::<Vec<_>>();
            let confidence: Vec<f64> = queries.iter().map(|&query| -uncertainty[query]).collect();
            let n_known = pick(&known).into_iter().filter(|&it| it).count();
            for (definition, positives) in [
                (Definition::Published, Positives::Published),
                (Definition::Corrected, Positives::Corrected { n_known }),
            ] {
                let slow = metrics::auc_pr(&confidence, &pick(&correct), positives);
                let fast = evaluation.resampled(&queries, definition);
                match (slow, fast) {
                    (Ok(slow), Ok(fast)) => prop_assert!((slow - fast).abs() < 1e-12, "{slow} {fast}"),
                    (slow, fast) => prop_assert_eq!(slow.is_ok(), fast.is_ok()),
                }
            }
        }
    }

    #[test]
    fn an_order_of_confidence_is_judged() {
        let judged = Judged::from_flags(vec![true, true, false, false], vec![true; 4]).unwrap();
        let good = Evaluation::new(&[0.1, 0.2, 0.3, 0.4], &judged).unwrap();
        let bad = Evaluation::new(&[0.4, 0.3, 0.2, 0.1], &judged).unwrap();
        let summary = good.summary().unwrap();
        assert_eq!(summary.auc_pr_published, Some(1.0));
        assert_eq!(summary.auc_pr_corrected, Some(0.5));
        assert_eq!(summary.auc_roc, Some(1.0));
        assert_eq!(summary.excess_aurc, 0.0);
        assert_eq!(summary.recall_at_95_precision, Some(0.5));
        assert!(bad.summary().unwrap().excess_aurc > 0.3);
        let resampling = Resampling { n_resamples: 200, ..Resampling::default() };
        assert!(good.auc_pr_difference(&bad, &resampling).unwrap().estimate > 0.4);
    }

    #[test]
    fn a_nan_is_named_by_query() {
        let judged = Judged::from_flags(vec![true, false], vec![true; 2]).unwrap();
        let err = Evaluation::new(&[0.0, f64::NAN], &judged).unwrap_err().to_string();
        assert!(err.contains("row 1"), "{err}");
        let err = Evaluation::of_confidence(&[0.0, f64::INFINITY], &judged).unwrap_err();
        assert_eq!(err.to_string(), "confidences: row 1, column 0 is inf, not a finite number");
    }

    #[test]
    fn there_is_one_value_per_query() {
        let judged = Judged::from_flags(vec![true, false], vec![true; 2]).unwrap();
        for err in [
            Evaluation::new(&[0.0], &judged).unwrap_err(),
            Evaluation::of_confidence(&[0.0; 3], &judged).unwrap_err(),
        ] {
            assert!(matches!(err, Error::Mismatch { expected: 2, .. }), "{err}");
        }
    }
}
