//! Separation of the best similarity from the others.

use super::{Category, UncertaintyEstimator, check_length, check_ranks, similarity::median_ratio};
use crate::{Neighbors, Result};

/// `s = median(sim) / sim(1)` over the ranked references: near 1 where the best match does not
/// stand out (SD of Miller et al. 2025, arXiv 2510.13464, without parameters).
///
/// The paper's text was at hand as far as its abstract, which says what SD measures; the formula
/// is the one that a public reimplementation of the paper states. Similarities are cosines of unit
/// descriptors, `1 − d²/2`, clamped at 0; rank many references (the paper: the whole map).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SimilarityDistribution;

impl UncertaintyEstimator for SimilarityDistribution {
    type Evidence<'a> = Neighbors<'a>;

    const CATEGORY: Category = Category::Retrieval;

    fn name(&self) -> &'static str {
        "Similarity distribution"
    }

    fn estimate_into(&self, evidence: &Neighbors<'_>, out: &mut [f64]) -> Result<()> {
        check_length(evidence, out)?;
        let retrieval = evidence.retrieval();
        check_ranks(self.name(), 2, retrieval.k())?;
        for (query, out) in out.iter_mut().enumerate() {
            *out = median_ratio(retrieval.distances(query));
        }
        Ok(())
    }
}
