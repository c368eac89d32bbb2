//! What a technique finds on a dataset.

use std::{path::PathBuf, sync::OnceLock};

use ndarray::Array2;
use vpr_core::{BestMatches, Ranking, Result, Retrieval, Similarities};

/// How far ranks are kept: the largest N of figure 3.11.
pub const MAX_RANK: usize = 20;

/// Which side is looked up in which.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Direction {
    /// Queries in references.
    AsReleased,
    /// Queries and references exchanged.
    Swapped,
}

impl Direction {
    /// The images that are looked up, and those they are looked up in.
    #[must_use]
    pub fn sides(self, dataset: &vpr_data::Dataset) -> [&[PathBuf]; 2] {
        match self {
            Self::AsReleased => [&dataset.queries, &dataset.references],
            Self::Swapped => [&dataset.references, &dataset.queries],
        }
    }
}

/// Similarity of every query with every reference, and what follows from it.
///
/// All chapters rank by these, so that they agree on the best match of a query.
#[derive(Debug)]
pub struct Scores {
    similarities: Similarities,
    best: BestMatches,
    ranking: OnceLock<Ranking>,
    note: Option<String>,
}

impl Scores {
    /// Ranks similarities; `note` is what a reader must know of them.
    #[must_use]
    pub fn new(similarities: Similarities, note: Option<String>) -> Self {
        Self { best: similarities.best(), similarities, ranking: OnceLock::new(), note }
    }

    /// The same with the best references that somebody stored.
    #[must_use]
    pub fn with_best(self, best: BestMatches) -> Self {
        Self { best, ..self }
    }

    /// Similarities, `n_queries × n_references`; higher is more similar.
    #[must_use]
    pub fn similarities(&self) -> &Similarities {
        &self.similarities
    }

    /// The best reference of every query, ties by lower index.
    #[must_use]
    pub fn best(&self) -> &BestMatches {
        &self.best
    }

    /// The [`MAX_RANK`] best references of every query, ties by lower index.
    ///
    /// # Errors
    ///
    /// None for similarities that are not empty.
    pub fn ranking(&self) -> Result<&Ranking> {
        if let Some(ranking) = self.ranking.get() {
            return Ok(ranking);
        }
        let ranking = self.similarities.ranked(MAX_RANK)?;
        Ok(self.ranking.get_or_init(|| ranking))
    }

    /// The `k` best references of every query in the same order, with the distances `√(2 − 2 s)` of
    /// unit descriptors whose cosines `s` the similarities are.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::Empty`] if `k` is zero.
    pub fn retrieval(&self, k: usize) -> Result<Retrieval> {
        let ranking = self.similarities.ranked(k)?;
        let shape = (ranking.len(), ranking.k());
        let indices = Array2::from_shape_fn(shape, |(query, rank)| ranking.indices(query)[rank]);
        let distances = Array2::from_shape_fn(shape, |(query, rank)| {
            distance(self.similarities.view()[(query, indices[(query, rank)])])
        });
        Retrieval::new(indices, distances)
    }

    /// What a reader must know.
    #[must_use]
    pub fn note(&self) -> Option<&str> {
        self.note.as_deref()
    }

    /// Queries and references exchanged, as if the similarity were symmetric.
    #[must_use]
    pub fn swapped(&self, note: Option<String>) -> Self {
        Self::new(self.similarities.swapped(), note)
    }
}

#[expect(clippy::cast_possible_truncation, reason = "distances are f32")]
fn distance(cosine: f64) -> f32 {
    (2.0 - 2.0 * cosine).max(0.0).sqrt() as f32
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    #[test]
    fn ranking_and_retrieval_agree_and_ties_break_by_lower_index() {
        let scores = Scores::new(
            Similarities::new(array![[0.5, 1.0, 1.0], [0.0, 0.5, -1.0]]).unwrap(),
            None,
        );
        let retrieval = scores.retrieval(2).unwrap();
        assert_eq!(scores.best().reference, [1, 1]);
        assert_eq!(retrieval.best(), scores.best().reference);
        assert_eq!(retrieval.indices(0).to_vec(), [1, 2]);
        assert_eq!(retrieval.distances(0).to_vec(), [0.0, 0.0]);
        assert_eq!(retrieval.distances(1).to_vec(), [1.0, 2.0_f32.sqrt()]);
        assert_eq!(scores.ranking().unwrap().indices(1).to_vec(), [1, 0, 2]);
    }
}
