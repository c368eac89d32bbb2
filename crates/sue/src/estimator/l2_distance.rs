//! Distance to the best match.

use super::{Category, UncertaintyEstimator, check_length};
use crate::{Neighbors, Result};

/// `s = d(1)`, the distance between the descriptors of the query and its best reference (thesis
/// §5.2.3, retrieval-based).
///
/// The released script takes squared distances, which order queries alike.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct L2Distance;

impl UncertaintyEstimator for L2Distance {
    type Evidence<'a> = Neighbors<'a>;

    const CATEGORY: Category = Category::Retrieval;

    fn name(&self) -> &'static str {
        "L2-distance"
    }

    fn estimate_into(&self, evidence: &Neighbors<'_>, out: &mut [f64]) -> Result<()> {
        check_length(evidence, out)?;
        let retrieval = evidence.retrieval();
        for (query, out) in out.iter_mut().enumerate() {
            *out = f64::from(retrieval.distances(query)[0]);
        }
        Ok(())
    }
}
