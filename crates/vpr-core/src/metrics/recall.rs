//! Recall@N.

use crate::{Error, GroundTruth, Ranking, Result};

/// Recall@N, `RecallRate@N` of thesis eq. 3.3: the share of queries with a correct reference among
/// the first `n`.
///
/// Queries without any correct reference count as missed, as in VPR-methods-evaluation; drop them
/// first to agree with tools that do. If fewer than `n` references are ranked, those are used.
///
/// # Errors
///
/// [`Error::Mismatch`] if ranking and truth are about different numbers of queries,
/// [`Error::Empty`] if there is no query.
pub fn recall_at(n: usize, ranking: &impl AsRef<Ranking>, truth: &GroundTruth) -> Result<f64> {
    let ranking = ranking.as_ref();
    if ranking.len() != truth.len() {
        let what = "ranked queries, one per query of the ground truth";
        return Err(Error::Mismatch { what, expected: truth.len(), actual: ranking.len() });
    }
    if truth.is_empty() {
        return Err(Error::Empty("queries"));
    }
    let found = (0..truth.len()).filter(|&query| {
        ranking.indices(query).iter().take(n).any(|&reference| truth.is_correct(query, reference))
    });
    Ok(found.count() as f64 / truth.len() as f64)
}
