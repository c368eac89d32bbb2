//! Estimators of how uncertain the best match of a query is, one file each, and all by name.

mod density_compensated;
mod inliers;
mod l2_distance;
mod pa_score;
mod ratio_spread;
mod registry;
mod similarity;
mod similarity_distribution;
mod spread;
mod statistical_uncertainty;
mod sue;
mod uniform;
mod variance;

pub use density_compensated::{Density, DensityCompensatedSue};
pub use inliers::Inliers;
pub use l2_distance::L2Distance;
pub use pa_score::PaScore;
pub use ratio_spread::RatioSpread;
pub use registry::{EstimatorChoice, EstimatorSettings, Prepared};
pub use similarity_distribution::SimilarityDistribution;
pub use statistical_uncertainty::StatisticalUncertainty;
pub use sue::{DistanceKind, Sue, SueDefinition, SueParams};
pub use uniform::Uniform;
pub use variance::Variance;

use crate::{Error, Evidence, Result};

/// A family of methods, as thesis chapter 5 names them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Category {
    /// Retrieval-based: from distances between descriptors (RUE).
    Retrieval,
    /// Data-driven: predicted by a trained encoder (DUE).
    DataDriven,
    /// Spatial: from the poses of the references (SUE).
    Spatial,
    /// Geometric verification of the images (GV).
    Geometric,
}

impl Category {
    /// The abbreviation of thesis tables 5.1 and 5.2.
    #[must_use]
    pub fn label(self) -> &'static str {
        match self {
            Self::Retrieval => "RUE",
            Self::DataDriven => "DUE",
            Self::Spatial => "SUE",
            Self::Geometric => "GV",
        }
    }
}

/// Says for every query how uncertain it is that its best reference is correct.
///
/// **Higher is less certain.** The scale is each estimator's own; only the order and thresholds
/// found by [`calibrate`](crate::calibrate) mean something. What a method needs is in its type:
/// [`Self::Evidence`] cannot be made without it.
pub trait UncertaintyEstimator {
    /// What it looks at.
    type Evidence<'a>: Evidence;

    /// Its family.
    const CATEGORY: Category;

    /// Its name in tables.
    fn name(&self) -> &'static str;

    /// Writes one uncertainty per query, in order, without allocating.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::Mismatch`] if `out` is not as long as the evidence; what the estimator
    /// says of its parameters; and the query for which it has no value.
    fn estimate_into(&self, evidence: &Self::Evidence<'_>, out: &mut [f64]) -> Result<()>;

    /// One uncertainty per query, in order.
    ///
    /// # Errors
    ///
    /// As [`Self::estimate_into`].
    fn estimate(&self, evidence: &Self::Evidence<'_>) -> Result<Vec<f64>> {
        let mut out = vec![0.0; evidence.len()];
        self.estimate_into(evidence, &mut out)?;
        Ok(out)
    }
}

/// Refuses an output of another length than the evidence.
fn check_length(evidence: &impl Evidence, out: &[f64]) -> Result<()> {
    if evidence.len() == out.len() {
        return Ok(());
    }
    let what = "places for uncertainties, one per query";
    let (expected, actual) = (evidence.len(), out.len());
    Err(vpr_core::Error::Mismatch { what, expected, actual }.into())
}

/// Refuses a retrieval with fewer than `needed` ranks.
fn check_ranks(estimator: &'static str, needed: usize, available: usize) -> Result<()> {
    if available >= needed {
        return Ok(());
    }
    Err(Error::TooFewNeighbors { estimator, needed, available })
}
