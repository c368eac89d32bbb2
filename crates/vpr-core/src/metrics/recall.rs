//! Recall@N.

use std::ops::RangeInclusive;

use crate::{Error, GroundTruth, Ranking, Result};

/// The N that released VPR-Bench draws: 1 to 19, although its comment says 20
/// (`compute_RecallRateAtN_forRange`).
pub const PUBLISHED_RECALL_RANGE: RangeInclusive<usize> = 1..=19;

/// Recall@N, `RecallRate@N` of thesis eq. 3.3: the share of queries with a correct reference among
/// the first `n`.
///
/// Queries without any correct reference count as missed, as in VPR-methods-evaluation; drop them
/// first to agree with tools that do. If fewer than `n` references are ranked, those are used (the
/// released VPR-Bench crashes). Rankings break ties by lower index, VPR-Bench's `argpartition` as it
/// happens to; on its 20 published score matrices both give the same recall.
///
/// # Errors
///
/// [`Error::Mismatch`] if ranking and truth are about different numbers of queries,
/// [`Error::Empty`] if there is no query.
pub fn recall_at(n: usize, ranking: &impl AsRef<Ranking>, truth: &GroundTruth) -> Result<f64> {
    let ranking = ranking.as_ref();
    check(ranking, truth)?;
    let found = (0..truth.len()).filter(|&query| {
        ranking.indices(query).iter().take(n).any(|&reference| truth.is_correct(query, reference))
    });
    Ok(found.count() as f64 / truth.len() as f64)
}

/// [`recall_at`] for every N from 1 to `n_max`, in order; `n_max` values that never fall.
///
/// Constant from the number of ranked references on.
///
/// # Errors
///
/// As [`recall_at`].
pub fn recall_curve(
    n_max: usize,
    ranking: &impl AsRef<Ranking>,
    truth: &GroundTruth,
) -> Result<Vec<f64>> {
    let ranking = ranking.as_ref();
    check(ranking, truth)?;
    let mut n_found_at = vec![0_usize; n_max.min(ranking.k())];
    for query in 0..truth.len() {
        let mut ranked = ranking.indices(query).into_iter();
        let rank = ranked.position(|&reference| truth.is_correct(query, reference));
        if let Some(count) = rank.and_then(|rank| n_found_at.get_mut(rank)) {
            *count += 1;
        }
    }
    let mut n_found = 0;
    let recall = (0..n_max).map(|rank| {
        n_found += n_found_at.get(rank).copied().unwrap_or(0);
        n_found as f64 / truth.len() as f64
    });
    Ok(recall.collect())
}

/// One ranked list per query of the truth, and at least one query.
pub(super) fn check(ranking: &Ranking, truth: &GroundTruth) -> Result<()> {
    if ranking.len() != truth.len() {
        let what = "ranked queries, one per query of the ground truth";
        return Err(Error::Mismatch { what, expected: truth.len(), actual: ranking.len() });
    }
    if truth.is_empty() {
        return Err(Error::Empty("queries"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    fn truth() -> GroundTruth {
        GroundTruth::from_lists(vec![vec![2], vec![0, 1], vec![]], 3).unwrap()
    }

    #[test]
    fn the_curve_is_recall_at_every_n() {
        let ranking = Ranking::new(array![[0, 1, 2], [1, 0, 2], [2, 1, 0]]).unwrap();
        let curve = recall_curve(5, &ranking, &truth()).unwrap();
        assert_eq!(curve, [1.0 / 3.0, 1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0]);
        for (n, recall) in (1..).zip(curve) {
            assert_eq!(recall_at(n, &ranking, &truth()).unwrap(), recall);
        }
        assert_eq!(recall_at(0, &ranking, &truth()).unwrap(), 0.0);
    }

    #[test]
    fn queries_must_agree() {
        let ranking = Ranking::new(array![[0, 1, 2]]).unwrap();
        let err = recall_curve(1, &ranking, &truth());
        assert!(matches!(err, Err(Error::Mismatch { expected: 3, actual: 1, .. })));
        let none = GroundTruth::from_lists(vec![], 3).unwrap();
        let nothing = Ranking::new(ndarray::Array2::zeros((0, 1))).unwrap();
        assert!(matches!(recall_at(1, &nothing, &none), Err(Error::Empty(_))));
    }
}
