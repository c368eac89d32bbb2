//! The nearest references of a query in another order: by how many local features agree.

use std::path::PathBuf;

use ndarray::Array2;
use rayon::prelude::*;
use vpr_core::{Error, Observer, Ranking, Result};
use vpr_study::verification::Verifier;

/// The first references of every query, most inliers first, and how many those have.
#[derive(Clone, Debug, PartialEq)]
pub struct Reranked {
    /// The whole ranking: beyond the first ones it stays as it was.
    pub ranking: Ranking,
    /// Where each reference of the new ranking was in the old one, query by query.
    pub ranks: Vec<Vec<usize>>,
    /// Inliers of the best reference of every query.
    pub inliers: Vec<usize>,
}

/// Orders the first `k` references of every query by inliers; of equals, the one that was nearer stays
/// first.
///
/// The features of each image are found once for every query that needs them.
///
/// # Errors
///
/// [`Error::Parameter`] if the ranking is shorter than `k` or `k` is zero; an image that cannot be read, by
/// its path.
pub fn rerank(
    verifier: &Verifier,
    [queries, references]: [&[PathBuf]; 2],
    ranking: &Ranking,
    k: usize,
    observer: &dyn Observer,
) -> Result<Reranked> {
    if k == 0 || k > ranking.k() {
        let reason = "must be positive and at most the number of ranked references";
        return Err(Error::Parameter { name: "rerank", value: k.to_string(), reason });
    }
    observer.start("re-ranking", queries.len());
    let ordered: Vec<Result<(Vec<usize>, usize)>> = queries
        .par_iter()
        .enumerate()
        .map(|(query, path)| {
            let features = verifier.detect(path)?;
            let count = |&reference: &usize| {
                verifier.verify(&features, &verifier.detect(&references[reference])?)
            };
            let first: Vec<usize> = ranking.indices(query).iter().take(k).copied().collect();
            let inliers = first.iter().map(count).collect::<Result<Vec<usize>>>()?;
            observer.step();
            Ok(by_inliers(&inliers, ranking.k()))
        })
        .collect();
    observer.end();
    let (ranks, inliers): (Vec<Vec<usize>>, Vec<usize>) =
        ordered.into_iter().collect::<Result<Vec<_>>>()?.into_iter().unzip();
    let shape = (ranking.len(), ranking.k());
    let indices =
        Array2::from_shape_fn(shape, |(query, rank)| ranking.indices(query)[ranks[query][rank]]);
    Ok(Reranked { ranking: Ranking::new(indices)?, ranks, inliers })
}

/// Old ranks in their new order, and the most inliers; ranks without a count stay.
fn by_inliers(inliers: &[usize], k: usize) -> (Vec<usize>, usize) {
    let mut order: Vec<usize> = (0..k).collect();
    order[..inliers.len()].sort_by_key(|&rank| std::cmp::Reverse(inliers[rank]));
    let most = inliers.iter().copied().max().unwrap_or(0);
    (order, most)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn most_inliers_come_first_and_equals_stay() {
        assert_eq!(by_inliers(&[4, 9, 4, 0], 6), (vec![1, 0, 2, 3, 4, 5], 9));
        assert_eq!(by_inliers(&[0, 0], 2), (vec![0, 1], 0));
    }
}
