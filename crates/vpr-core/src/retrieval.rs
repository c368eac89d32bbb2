//! The nearest references of every query.

use ndarray::{Array2, ArrayView1};

use crate::{
    Descriptors, Error, Ranking, Result,
    knn::{SearchParams, search},
};

/// The `k` nearest references of every query, nearest first, ties by lower index.
///
/// Distances are Euclidean, not squared, unless the maker says otherwise; lower is nearer.
#[derive(Clone, Debug, PartialEq)]
pub struct Retrieval {
    ranking: Ranking,
    distances: Array2<f32>,
}

impl AsRef<Ranking> for Retrieval {
    fn as_ref(&self) -> &Ranking {
        &self.ranking
    }
}

impl Retrieval {
    /// Wraps `n_queries × k` reference indices and their distances.
    ///
    /// # Errors
    ///
    /// [`Error::Mismatch`] if the shapes differ, [`Error::NotFinite`] if a distance is not finite,
    /// [`Error::Parameter`] if a row is not sorted by ascending distance, and those of
    /// [`Ranking::new`].
    pub fn new(indices: Array2<usize>, distances: Array2<f32>) -> Result<Self> {
        if indices.dim() != distances.dim() {
            return Err(Error::Mismatch {
                what: "distances of a retrieval, one per index",
                expected: indices.len(),
                actual: distances.len(),
            });
        }
        for ((row, column), &value) in distances.indexed_iter() {
            if !value.is_finite() {
                let value = f64::from(value);
                return Err(Error::NotFinite { what: "distances", row, column, value });
            }
            if column > 0 && distances[(row, column - 1)] > value {
                return Err(Error::Parameter {
                    name: "distances",
                    value: format!("row {row}, rank {column}: {value}"),
                    reason: "must not be below the distance of the rank before it",
                });
            }
        }
        Ok(Self { ranking: Ranking::new(indices)?, distances })
    }

    /// Number of queries.
    #[must_use]
    pub fn len(&self) -> usize {
        self.ranking.len()
    }

    /// Whether there is no query.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// How many references are ranked for every query.
    #[must_use]
    pub fn k(&self) -> usize {
        self.ranking.k()
    }

    /// Indices of the references of one query, nearest first.
    ///
    /// # Panics
    ///
    /// If `query` is not below [`Self::len`].
    #[must_use]
    pub fn indices(&self, query: usize) -> ArrayView1<'_, usize> {
        self.ranking.indices(query)
    }

    /// Distances of the references of one query, ascending.
    ///
    /// # Panics
    ///
    /// If `query` is not below [`Self::len`].
    #[must_use]
    pub fn distances(&self, query: usize) -> ArrayView1<'_, f32> {
        self.distances.row(query)
    }

    /// The same ranks with other names: index `i` becomes `names[i]`.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] if an index has no name.
    pub fn with_indices(self, names: &[usize]) -> Result<Self> {
        let mut renamed = Array2::zeros(self.distances.dim());
        for (new, &index) in
            renamed.iter_mut().zip((0..self.len()).flat_map(|query| self.ranking.indices(query)))
        {
            let len = names.len();
            *new = *names.get(index).ok_or(Error::OutOfRange { what: "reference", index, len })?;
        }
        Self::new(renamed, self.distances)
    }

    /// The reference at rank 1 of every query.
    #[must_use]
    pub fn best(&self) -> Vec<usize> {
        self.ranking.best()
    }
}

/// Finds the `k` references nearest to every query in Euclidean distance, exactly.
///
/// The simple way to [`knn::search`](crate::knn::search), which has the same result for any
/// number of threads. Gives fewer than `k` columns if there are fewer references.
///
/// # Errors
///
/// [`Error::Mismatch`] if the two sets have different dimensions, [`Error::Empty`] if there is no
/// reference or `k` is zero, [`Error::NotFinite`] if a distance is too large for f32.
pub fn retrieve(queries: &Descriptors, references: &Descriptors, k: usize) -> Result<Retrieval> {
    search(references, queries, &SearchParams { k, ..SearchParams::default() })
}

#[cfg(test)]
mod tests {
    use ndarray::array;
    use proptest::prelude::*;

    use super::*;

    fn descriptors(rows: Array2<f32>) -> Descriptors {
        Descriptors::new(rows).unwrap()
    }

    #[test]
    fn nearest_first_and_not_squared() {
        let references = descriptors(array![[0.0, 0.0], [3.0, 4.0], [1.0, 0.0]]);
        let retrieval = retrieve(&descriptors(array![[0.0, 0.0]]), &references, 3).unwrap();
        assert_eq!(retrieval.indices(0).to_vec(), [0, 2, 1]);
        assert_eq!(retrieval.distances(0).to_vec(), [0.0, 1.0, 5.0]);
    }

    #[test]
    fn ties_break_by_lower_index() {
        let references = descriptors(array![[2.0], [0.0], [2.0], [0.0]]);
        let retrieval = retrieve(&descriptors(array![[1.0]]), &references, 3).unwrap();
        assert_eq!(retrieval.indices(0).to_vec(), [0, 1, 2]);
    }

    #[test]
    fn fewer_references_than_k_give_fewer_columns() {
        let set = descriptors(array![[1.0], [2.0]]);
        assert_eq!(retrieve(&set, &set, 10).unwrap().k(), 2);
    }

    #[test]
    fn dimensions_must_agree() {
        let err = retrieve(&descriptors(array![[1.0]]), &descriptors(array![[1.0, 2.0]]), 1);
        assert!(matches!(err, Err(Error::Mismatch { expected: 2, actual: 1, .. })));
    }

    proptest! {
        #[test]
        fn agrees_with_a_full_sort(
            references in prop::collection::vec(prop::collection::vec(-3_i8..3, 3), 1..40),
            query in prop::collection::vec(-3_i8..3, 3),
            k in 1_usize..50,
        ) {
            let rows = Array2::from_shape_fn((references.len(), 3), |(row, column)| f32::from(references[row][column]));
            let single = Array2::from_shape_fn((1, 3), |(_, column)| f32::from(query[column]));
            let retrieval = retrieve(&descriptors(single), &descriptors(rows), k).unwrap();
            let mut expected: Vec<(i32, usize)> = references
                .iter()
                .map(|row| row.iter().zip(&query).map(|(a, b)| (i32::from(*a) - i32::from(*b)).pow(2)).sum())
                .zip(0..)
                .collect();
            expected.sort_unstable();
            let expected: Vec<usize> = expected.into_iter().take(k).map(|(_, index)| index).collect();
            prop_assert_eq!(retrieval.indices(0).to_vec(), expected);
        }
    }
}
