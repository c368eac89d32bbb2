//! Similarity of every query with every reference, as techniques without one vector per image give.

use std::cmp::Ordering;

use ndarray::{Array2, ArrayView1, ArrayView2};
use rayon::prelude::*;

use crate::{Error, Ranking, Result};

/// Similarities, `n_queries × n_references`, f64, finite; **higher is more similar**.
///
/// VPR-Bench stores its matches this way round; `VPR_Tutorial` stores the transpose.
#[derive(Clone, Debug, PartialEq)]
pub struct Similarities(Array2<f64>);

/// The best reference of every query and how similar it is.
#[derive(Clone, Debug, PartialEq)]
pub struct BestMatches {
    /// Index of the best reference, one per query.
    pub reference: Vec<usize>,
    /// Its similarity, the confidence of the match; higher is more certain.
    pub confidence: Vec<f64>,
}

impl Similarities {
    /// Wraps an `n_queries × n_references` array.
    ///
    /// # Errors
    ///
    /// [`Error::Empty`] without a query or a reference, [`Error::NotFinite`] if a value is not finite.
    pub fn new(values: Array2<f64>) -> Result<Self> {
        if values.is_empty() {
            return Err(Error::Empty("similarities"));
        }
        match values.indexed_iter().find(|(_, value)| !value.is_finite()) {
            None => Ok(Self(values.as_standard_layout().into_owned())),
            Some(((row, column), &value)) => {
                Err(Error::NotFinite { what: "similarities", row, column, value })
            }
        }
    }

    /// Number of queries.
    #[must_use]
    pub fn n_queries(&self) -> usize {
        self.0.nrows()
    }

    /// Number of references.
    #[must_use]
    pub fn n_references(&self) -> usize {
        self.0.ncols()
    }

    /// All similarities.
    #[must_use]
    pub fn view(&self) -> ArrayView2<'_, f64> {
        self.0.view()
    }

    /// The same similarities with queries and references exchanged.
    #[must_use]
    pub fn swapped(&self) -> Self {
        Self(self.0.t().as_standard_layout().into_owned())
    }

    /// The best reference of every query, ties by lower index.
    #[must_use]
    pub fn best(&self) -> BestMatches {
        let best = |row: ArrayView1<'_, f64>| {
            row.iter().copied().enumerate().fold((0, f64::NEG_INFINITY), |best, (index, value)| {
                if value > best.1 { (index, value) } else { best }
            })
        };
        let (reference, confidence) = self.0.outer_iter().map(best).unzip();
        BestMatches { reference, confidence }
    }

    /// The `k` most similar references of every query, ties by lower index; fewer if there are fewer.
    ///
    /// # Errors
    ///
    /// [`Error::Empty`] if `k` is zero.
    pub fn ranked(&self, k: usize) -> Result<Ranking> {
        let k = k.min(self.n_references());
        let rows: Vec<Vec<usize>> =
            self.0.outer_iter().into_par_iter().map(|row| most_similar(row, k)).collect();
        let shape = (self.n_queries(), k);
        Ranking::new(Array2::from_shape_fn(shape, |(query, rank)| rows[query][rank]))
    }
}

/// Indices of the `k` highest values, highest first, ties by lower index.
fn most_similar(row: ArrayView1<'_, f64>, k: usize) -> Vec<usize> {
    let best_first = |&a: &usize, &b: &usize| {
        row[b].partial_cmp(&row[a]).unwrap_or(Ordering::Equal).then(a.cmp(&b))
    };
    let mut order: Vec<usize> = (0..row.len()).collect();
    if k < order.len() {
        order.select_nth_unstable_by(k, best_first);
        order.truncate(k);
    }
    order.sort_unstable_by(best_first);
    order
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    #[test]
    fn higher_is_better_and_ties_break_by_lower_index() {
        let scores = Similarities::new(array![[0.1, 0.9, 0.9], [0.5, 0.5, 0.2]]).unwrap();
        assert_eq!(scores.best().reference, [1, 0]);
        assert_eq!(scores.best().confidence, [0.9, 0.5]);
        assert_eq!(scores.ranked(2).unwrap(), Ranking::new(array![[1, 2], [0, 1]]).unwrap());
        assert_eq!(scores.ranked(9).unwrap().indices(1).to_vec(), [0, 1, 2]);
    }

    #[test]
    fn zero_and_minus_zero_are_a_tie() {
        let scores = Similarities::new(array![[-0.0, 0.0]]).unwrap();
        assert_eq!(scores.best().reference, [0]);
        assert_eq!(scores.ranked(2).unwrap().indices(0).to_vec(), [0, 1]);
    }

    #[test]
    fn swapping_exchanges_queries_and_references() {
        let scores = Similarities::new(array![[0.1, 0.9, 0.3]]).unwrap().swapped();
        assert_eq!((scores.n_queries(), scores.n_references()), (3, 1));
        assert_eq!(scores.best().confidence, [0.1, 0.9, 0.3]);
    }
}
