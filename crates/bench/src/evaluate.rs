//! Everything chapter 3 asks of one technique on one dataset.

use vpr_core::{
    BestMatches, Definition, GroundTruth, Ranking, Result, Similarities,
    metrics::{
        self,
        bootstrap::{Interval, Resampling, bootstrap, pick},
    },
};

pub use vpr_core::metrics::Positives;

/// How far ranks are kept: the largest N of figure 3.11.
pub const MAX_RANK: usize = 20;

/// One technique's retrieval on one dataset, ready to be measured.
#[derive(Clone, Debug)]
pub struct Evaluation<'a> {
    truth: &'a GroundTruth,
    best: BestMatches,
    correct: Vec<bool>,
    ranking: Ranking,
}

impl<'a> Evaluation<'a> {
    /// Judges the best reference of every query, ties by lower index.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::Mismatch`] if similarities and truth are about different numbers of queries or
    /// references.
    pub fn new(similarities: &Similarities, truth: &'a GroundTruth) -> Result<Self> {
        Self::of_matches(similarities.best(), similarities, truth)
    }

    /// Judges the best references somebody stored, instead of those that follow from the scores.
    ///
    /// # Errors
    ///
    /// As [`Self::new`].
    pub fn of_matches(
        best: BestMatches,
        similarities: &Similarities,
        truth: &'a GroundTruth,
    ) -> Result<Self> {
        if similarities.n_references() != truth.n_references() {
            return Err(vpr_core::Error::Mismatch {
                what: "references that were scored, as the ground truth has",
                expected: truth.n_references(),
                actual: similarities.n_references(),
            });
        }
        let correct = truth.judge(&best.reference)?;
        Ok(Self { truth, best, correct, ranking: similarities.ranked(MAX_RANK)? })
    }

    /// Number of queries.
    #[must_use]
    pub fn n_queries(&self) -> usize {
        self.correct.len()
    }

    /// Whether the best reference of each query is correct.
    #[must_use]
    pub fn correct(&self) -> &[bool] {
        &self.correct
    }

    /// Confidence in the best reference of each query; higher is more certain.
    #[must_use]
    pub fn confidence(&self) -> &[f64] {
        &self.best.confidence
    }

    /// The truth it is judged by.
    #[must_use]
    pub fn truth(&self) -> &GroundTruth {
        self.truth
    }

    /// The denominator of recall under a definition.
    #[must_use]
    pub fn positives(&self, definition: Definition) -> Positives {
        match definition {
            Definition::Published => Positives::Published,
            Definition::Corrected => Positives::corrected(self.truth),
        }
    }

    /// [`metrics::auc_pr`]. No correct match gives zero for a corrected denominator and is undefined
    /// for the published one.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::Undefined`] if no best match is correct.
    pub fn auc_pr(&self, positives: Positives) -> Result<f64> {
        metrics::auc_pr(&self.best.confidence, &self.correct, positives)
    }

    /// [`Self::auc_pr`] with its 95 % bootstrap interval over queries.
    ///
    /// # Errors
    ///
    /// As [`metrics::bootstrap::bootstrap`].
    pub fn auc_pr_interval(&self, definition: Definition, seed: u64) -> Result<Interval> {
        let known: Vec<bool> =
            (0..self.n_queries()).map(|query| !self.truth.is_new_place(query)).collect();
        let resampling = Resampling { seed, ..Resampling::default() };
        bootstrap(self.n_queries(), &resampling, |queries| {
            let positives = match definition {
                Definition::Published => Positives::Published,
                Definition::Corrected => Positives::Corrected {
                    n_known: pick(&known, queries).into_iter().filter(|&it| it).count(),
                },
            };
            let confidence = pick(&self.best.confidence, queries);
            metrics::auc_pr(&confidence, &pick(&self.correct, queries), positives)
        })
    }

    /// [`metrics::recall_at`].
    ///
    /// # Errors
    ///
    /// None for `n` up to [`MAX_RANK`].
    pub fn recall_at(&self, n: usize) -> Result<f64> {
        metrics::recall_at(n, &self.ranking, self.truth)
    }

    /// [`metrics::average_precision`].
    ///
    /// # Errors
    ///
    /// As the metric.
    pub fn average_precision(&self, positives: Positives) -> Result<f64> {
        metrics::average_precision(&self.best.confidence, &self.correct, positives)
    }
}
