//! Spread without weights.

use super::{Category, UncertaintyEstimator, check_length, check_ranks, spread::weighted_spread};
use crate::{Places, Result};

/// Trace of the covariance of the positions of the `k` best references, all weighing the same
/// (thesis table 5.4, row "Uniform"), in metres².
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Uniform {
    k: usize,
}

impl Default for Uniform {
    /// The thesis' K = 10.
    fn default() -> Self {
        Self { k: 10 }
    }
}

impl Uniform {
    /// Takes the number of best references.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::Parameter`] if it is zero.
    pub fn new(k: usize) -> Result<Self> {
        if k == 0 {
            let reason = "must be at least 1";
            return Err(vpr_core::Error::Parameter { name: "k", value: "0".into(), reason }.into());
        }
        Ok(Self { k })
    }
}

impl UncertaintyEstimator for Uniform {
    type Evidence<'a> = Places<'a>;

    const CATEGORY: Category = Category::Spatial;

    fn name(&self) -> &'static str {
        "Uniform"
    }

    fn estimate_into(&self, evidence: &Places<'_>, out: &mut [f64]) -> Result<()> {
        check_length(evidence, out)?;
        check_ranks(self.name(), self.k, evidence.retrieval().k())?;
        let weights = vec![1.0; self.k];
        for (query, out) in out.iter_mut().enumerate() {
            let references = evidence.retrieval().indices(query);
            let references = references.slice_move(ndarray::s![..self.k]);
            *out = weighted_spread(references, evidence.poses(), &weights);
        }
        Ok(())
    }
}
