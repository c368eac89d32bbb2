//! How close the competitors come to the best similarity.

use super::{Category, UncertaintyEstimator, check_length, check_ranks, similarity::mean_ratio};
use crate::{Neighbors, Result};

/// `s = mean over i ≥ 2 of sim(i) / sim(1)` over the ranked references (RS of Miller et al. 2025,
/// arXiv 2510.13464, without parameters).
///
/// For the formula's source and the similarities see
/// [`SimilarityDistribution`](super::SimilarityDistribution).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RatioSpread;

impl UncertaintyEstimator for RatioSpread {
    type Evidence<'a> = Neighbors<'a>;

    const CATEGORY: Category = Category::Retrieval;

    fn name(&self) -> &'static str {
        "Ratio spread"
    }

    fn estimate_into(&self, evidence: &Neighbors<'_>, out: &mut [f64]) -> Result<()> {
        check_length(evidence, out)?;
        let retrieval = evidence.retrieval();
        check_ranks(self.name(), 2, retrieval.k())?;
        for (query, out) in out.iter_mut().enumerate() {
            *out = mean_ratio(retrieval.distances(query));
        }
        Ok(())
    }
}
