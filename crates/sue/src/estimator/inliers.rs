//! Geometric verification.

use super::{Category, UncertaintyEstimator, check_length};
use crate::{InlierCounts, Result};

/// `s = −c`, where `c` local features of the query agree with the best reference in one geometric
/// model (thesis §5.2.3, geometric verification).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Inliers {
    name: &'static str,
}

impl Inliers {
    /// SIFT features.
    pub const SIFT: Self = Self { name: "SIFT-RANSAC" };

    /// Other local features, called `name` in tables.
    #[must_use]
    pub fn named(name: &'static str) -> Self {
        Self { name }
    }
}

impl UncertaintyEstimator for Inliers {
    type Evidence<'a> = InlierCounts<'a>;

    const CATEGORY: Category = Category::Geometric;

    fn name(&self) -> &'static str {
        self.name
    }

    fn estimate_into(&self, evidence: &InlierCounts<'_>, out: &mut [f64]) -> Result<()> {
        check_length(evidence, out)?;
        for (&count, out) in evidence.counts().iter().zip(out) {
            *out = -(count as f64);
        }
        Ok(())
    }
}
