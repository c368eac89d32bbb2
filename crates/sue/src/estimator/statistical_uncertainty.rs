//! Both readings of the similarities together.

use super::{
    Category, UncertaintyEstimator, check_length, check_ranks,
    similarity::{mean_ratio, median_ratio},
};
use crate::{Neighbors, Result};

/// The mean of [`RatioSpread`](super::RatioSpread) and
/// [`SimilarityDistribution`](super::SimilarityDistribution) (SU of Miller et al. 2025, arXiv
/// 2510.13464, without parameters: both weigh the same).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StatisticalUncertainty;

impl UncertaintyEstimator for StatisticalUncertainty {
    type Evidence<'a> = Neighbors<'a>;

    const CATEGORY: Category = Category::Retrieval;

    fn name(&self) -> &'static str {
        "Statistical uncertainty"
    }

    fn estimate_into(&self, evidence: &Neighbors<'_>, out: &mut [f64]) -> Result<()> {
        check_length(evidence, out)?;
        let retrieval = evidence.retrieval();
        check_ranks(self.name(), 2, retrieval.k())?;
        for (query, out) in out.iter_mut().enumerate() {
            let distances = retrieval.distances(query);
            *out = f64::midpoint(mean_ratio(distances), median_ratio(distances));
        }
        Ok(())
    }
}
