//! Ratio of the two nearest distances.

use super::{Category, UncertaintyEstimator, check_length, check_ranks};
use crate::{Neighbors, Result};

/// `s = d(1) / d(2)`, near 1 where the second-best reference is as good as the best (thesis §5.2.3;
/// called perceptual aliasing score after Hausler et al. 2021, and Lowe's ratio for local features).
///
/// Two references at distance 0 are as ambiguous as can be: 1, where the released script has 0/0.
/// Squared distances, as released, order queries alike.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PaScore;

impl UncertaintyEstimator for PaScore {
    type Evidence<'a> = Neighbors<'a>;

    const CATEGORY: Category = Category::Retrieval;

    fn name(&self) -> &'static str {
        "PA-Score"
    }

    fn estimate_into(&self, evidence: &Neighbors<'_>, out: &mut [f64]) -> Result<()> {
        check_length(evidence, out)?;
        let retrieval = evidence.retrieval();
        check_ranks(self.name(), 2, retrieval.k())?;
        for (query, out) in out.iter_mut().enumerate() {
            let distances = retrieval.distances(query);
            let (first, second) = (f64::from(distances[0]), f64::from(distances[1]));
            *out = if second == 0.0 { 1.0 } else { first / second };
        }
        Ok(())
    }
}
