//! References in order of nearness, without distances.

use ndarray::{Array2, ArrayView1};

use crate::{Error, Result};

/// Indices of the `k` best references of every query, `n_queries × k`, best first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ranking(Array2<usize>);

impl AsRef<Self> for Ranking {
    fn as_ref(&self) -> &Self {
        self
    }
}

impl Ranking {
    /// Wraps `n_queries × k` reference indices.
    ///
    /// # Errors
    ///
    /// [`Error::Empty`] if nothing is ranked.
    pub fn new(indices: Array2<usize>) -> Result<Self> {
        if indices.ncols() == 0 {
            return Err(Error::Empty("ranks"));
        }
        Ok(Self(indices))
    }

    /// Number of queries.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.nrows()
    }

    /// Whether there is no query.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// How many references are ranked for every query; at least one.
    #[must_use]
    pub fn k(&self) -> usize {
        self.0.ncols()
    }

    /// The references of one query, best first.
    ///
    /// # Panics
    ///
    /// If `query` is not below [`Self::len`].
    #[must_use]
    pub fn indices(&self, query: usize) -> ArrayView1<'_, usize> {
        self.0.row(query)
    }

    /// The reference at rank 1 of every query.
    #[must_use]
    pub fn best(&self) -> Vec<usize> {
        self.0.column(0).to_vec()
    }
}
