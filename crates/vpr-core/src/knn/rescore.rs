//! Exact ranks for candidates that something faster has chosen.

use ndarray::Array2;
use rayon::prelude::*;

use super::{RowSource, SearchParams, row, search};
use crate::{Descriptors, Error, Result, Retrieval};

/// Ranks the candidates of every query by their distance to the full rows, ties by lower index.
///
/// What is found among the candidates is exact; what is not a candidate is lost.
///
/// # Errors
///
/// [`Error::Mismatch`] if dimensions or numbers of queries differ, [`Error::Empty`] if `k` is zero
/// or a query has fewer candidates than `k` while there are more references, [`Error::OutOfRange`]
/// if a candidate does not exist, and those of [`RowSource::block`].
pub fn rescore(
    rows: &(impl RowSource + ?Sized),
    queries: &Descriptors,
    candidates: &[Vec<usize>],
    params: &SearchParams,
) -> Result<Retrieval> {
    let mismatch = |what, expected, actual| Err(Error::Mismatch { what, expected, actual });
    if queries.dim() != rows.dim() {
        return mismatch("dimension of the query descriptors", rows.dim(), queries.dim());
    }
    if queries.len() != candidates.len() {
        return mismatch("lists of candidates, one per query", queries.len(), candidates.len());
    }
    let k = params.k.min(rows.len());
    if k == 0 || candidates.iter().any(|list| list.len() < k) {
        return Err(Error::Empty("candidates left to rank"));
    }
    let ranked: Vec<Vec<(f64, usize)>> = candidates
        .par_iter()
        .enumerate()
        .map_init(Vec::new, |scratch, (query, candidates)| {
            let query = &queries.as_slice()[query * queries.dim()..(query + 1) * queries.dim()];
            let mut ranked = Vec::with_capacity(candidates.len());
            for &index in candidates {
                if index >= rows.len() {
                    return Err(Error::OutOfRange { what: "candidate", index, len: rows.len() });
                }
                ranked.push((params.metric.key(query, row(rows, index, scratch)?), index));
            }
            ranked.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            ranked.dedup();
            Ok(ranked)
        })
        .collect::<Result<_>>()?;
    if ranked.iter().any(|ranked| ranked.len() < k) {
        return Err(Error::Empty("candidates left to rank"));
    }
    let shape = (queries.len(), k);
    Retrieval::new(
        Array2::from_shape_fn(shape, |(query, rank)| ranked[query][rank].1),
        Array2::from_shape_fn(shape, |(query, rank)| {
            params.metric.distance_of_key(ranked[query][rank].0)
        }),
    )
}

/// Smaller stand-ins of the references, and the queries as they are compared with them.
pub struct Coarse<'a, R: ?Sized> {
    /// One row per reference: decoded f16 or int8, or projected by a [`Pca`](super::Pca).
    pub rows: &'a R,
    /// The queries in the space of these rows.
    pub queries: &'a Descriptors,
    /// How many candidates are taken from the coarse rows for every reference wanted; at least 1.
    pub oversample: usize,
}

/// Chooses candidates by smaller rows and ranks them by the full rows, of which only those of
/// the candidates are read.
///
/// # Errors
///
/// [`Error::Mismatch`] if the coarse rows are not as many as the full ones, and those of
/// [`search`] and [`rescore`].
pub fn search_rescored(
    coarse: &Coarse<'_, impl RowSource + ?Sized>,
    full: &(impl RowSource + ?Sized),
    queries: &Descriptors,
    params: &SearchParams,
) -> Result<Retrieval> {
    if coarse.rows.len() != full.len() {
        return Err(Error::Mismatch {
            what: "coarse rows, one per full row",
            expected: full.len(),
            actual: coarse.rows.len(),
        });
    }
    let wanted = SearchParams { k: params.k.saturating_mul(coarse.oversample.max(1)), ..*params };
    let found = search(coarse.rows, coarse.queries, &wanted)?;
    let candidates: Vec<Vec<usize>> =
        (0..found.len()).map(|query| found.indices(query).to_vec()).collect();
    rescore(full, queries, &candidates, params)
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    #[test]
    fn full_rows_decide_the_order_of_the_candidates() {
        let full = Descriptors::new(array![[0.0], [1.0], [1.5], [9.0]]).unwrap();
        let rough = Descriptors::new(array![[1.4], [1.0], [1.2], [9.0]]).unwrap();
        let queries = Descriptors::new(array![[1.4]]).unwrap();
        let coarse = Coarse { rows: &rough, queries: &queries, oversample: 2 };
        let params = SearchParams { k: 1, ..SearchParams::default() };
        let found = search_rescored(&coarse, &full, &queries, &params).unwrap();
        assert_eq!(found.best(), [2]);
    }

    #[test]
    fn too_few_candidates_are_an_error() {
        let rows = Descriptors::new(array![[0.0], [1.0]]).unwrap();
        let params = SearchParams { k: 2, ..SearchParams::default() };
        for candidates in [vec![0], vec![0, 0]] {
            let found = rescore(&rows, &rows, &[candidates.clone(), candidates], &params);
            assert!(matches!(found, Err(Error::Empty(_))));
        }
    }
}
