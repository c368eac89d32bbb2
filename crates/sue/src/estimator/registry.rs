//! Estimators by name, for command lines and experiment files.

use serde::{Deserialize, Serialize};
use vpr_core::{Error, Poses, Retrieval};

use super::{
    Category, Density, DensityCompensatedSue, L2Distance, PaScore, RatioSpread,
    SimilarityDistribution, StatisticalUncertainty, Sue, SueDefinition, SueParams,
    UncertaintyEstimator, Uniform,
};
use crate::{Evidence, Needs, Neighbors, Places, Result};

/// An estimator that needs no more than a map and the queries' descriptors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum EstimatorChoice {
    /// Distance to the best match
    L2,
    /// Ratio of the two nearest distances
    Pa,
    /// Median similarity relative to the best
    SimilarityDistribution,
    /// Mean similarity of the others relative to the best
    RatioSpread,
    /// The mean of the two before
    StatisticalUncertainty,
    /// Spatial spread of the best references, stable for any scale
    Sue,
    /// Spatial spread as the released script computes it
    SuePublished,
    /// Spatial spread as thesis eqs. 5.1 to 5.3 are written
    SueThesis,
    /// Spatial spread, compensated for the density of the map
    SueDensity,
    /// Spatial spread, all references weighing the same
    Uniform,
}

/// What the estimators can be told.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EstimatorSettings {
    /// Parameters of SUE; its definition is that of the choice.
    pub sue: SueParams,
    /// Which neighbour in space measures the density of the map.
    pub nth: usize,
}

impl Default for EstimatorSettings {
    fn default() -> Self {
        Self { sue: *Sue::corrected().params(), nth: 1 }
    }
}

/// An estimator, ready for any number of batches of queries to one map.
#[derive(Clone, Debug)]
pub struct Prepared<'a> {
    kind: Kind,
    poses: Option<&'a Poses>,
}

#[derive(Clone, Debug)]
enum Kind {
    L2,
    Pa,
    SimilarityDistribution,
    RatioSpread,
    StatisticalUncertainty,
    Sue(Sue),
    Density(DensityCompensatedSue),
    Uniform(Uniform),
}

impl EstimatorChoice {
    /// All, in the order of tables.
    pub const ALL: [Self; 10] = [
        Self::L2,
        Self::Pa,
        Self::SimilarityDistribution,
        Self::RatioSpread,
        Self::StatisticalUncertainty,
        Self::Sue,
        Self::SuePublished,
        Self::SueThesis,
        Self::SueDensity,
        Self::Uniform,
    ];

    /// Whether its uncertainty is made for descriptors of length 1: weights decay with distance,
    /// similarities are cosines.
    #[must_use]
    pub fn depends_on_length(self) -> bool {
        !matches!(self, Self::L2 | Self::Pa | Self::Uniform)
    }

    /// Its family.
    #[must_use]
    pub fn category(self) -> Category {
        if self.needs_poses() { Category::Spatial } else { Category::Retrieval }
    }

    /// What it needs.
    #[must_use]
    pub fn needs(self) -> Needs {
        if self.needs_poses() { Places::NEEDS } else { Neighbors::NEEDS }
    }

    fn needs_poses(self) -> bool {
        match self {
            Self::L2
            | Self::Pa
            | Self::SimilarityDistribution
            | Self::RatioSpread
            | Self::StatisticalUncertainty => false,
            Self::Sue | Self::SuePublished | Self::SueThesis | Self::SueDensity | Self::Uniform => {
                true
            }
        }
    }

    /// Readies it for a map; `poses` are those of the references.
    ///
    /// `published` and `thesis` take their own distance and clip, whatever the settings say, and K
    /// and λ from the settings.
    ///
    /// # Errors
    ///
    /// [`Error::PoseKind`] if it needs poses and there are none, and what the estimators say of
    /// their parameters.
    pub fn prepare<'a>(
        self,
        settings: &EstimatorSettings,
        poses: Option<&'a Poses>,
    ) -> Result<Prepared<'a>> {
        if self.needs_poses() && poses.is_none() {
            return Err(Error::PoseKind { needed: "any kind of", actual: "no" }.into());
        }
        let SueParams { k, lambda, .. } = settings.sue;
        let with = |base: Sue| Sue::new(SueParams { k, lambda, ..*base.params() });
        let corrected =
            || Sue::new(SueParams { definition: SueDefinition::Corrected, ..settings.sue });
        let kind = match (self, poses) {
            (Self::L2, _) => Kind::L2,
            (Self::Pa, _) => Kind::Pa,
            (Self::SimilarityDistribution, _) => Kind::SimilarityDistribution,
            (Self::RatioSpread, _) => Kind::RatioSpread,
            (Self::StatisticalUncertainty, _) => Kind::StatisticalUncertainty,
            (Self::SueDensity, Some(poses)) => {
                let density = Density::Distinct;
                let sue = corrected()?;
                Kind::Density(DensityCompensatedSue::new(sue, poses, settings.nth, density)?)
            }
            (Self::SuePublished, _) => Kind::Sue(with(Sue::published())?),
            (Self::SueThesis, _) => Kind::Sue(with(Sue::thesis())?),
            (Self::Uniform, _) => Kind::Uniform(Uniform::new(k)?),
            (Self::Sue | Self::SueDensity, _) => Kind::Sue(corrected()?),
        };
        Ok(Prepared { kind, poses })
    }
}

impl Prepared<'_> {
    /// Its name in tables.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match &self.kind {
            Kind::L2 => L2Distance.name(),
            Kind::Pa => PaScore.name(),
            Kind::SimilarityDistribution => SimilarityDistribution.name(),
            Kind::RatioSpread => RatioSpread.name(),
            Kind::StatisticalUncertainty => StatisticalUncertainty.name(),
            Kind::Sue(sue) => sue.name(),
            Kind::Density(sue) => sue.name(),
            Kind::Uniform(uniform) => uniform.name(),
        }
    }

    /// How many queries have a best reference that weighs a thousand times as much as the next: the
    /// spread around it is near 0, however wrong the match is. 0 for estimators without weights.
    #[must_use]
    pub fn n_lone(&self, retrieval: &Retrieval) -> usize {
        const OUTWEIGHED: f64 = 1e3;
        let SueParams { k, lambda, distance, .. } = match &self.kind {
            Kind::Sue(sue) => *sue.params(),
            Kind::Density(density) => *density.sue().params(),
            _ => return 0,
        };
        if k.min(retrieval.k()) < 2 {
            return 0;
        }
        let is_lone = |&query: &usize| {
            let distances = retrieval.distances(query);
            lambda * (distance.of(distances[1]) - distance.of(distances[0])) > OUTWEIGHED.ln()
        };
        (0..retrieval.len()).filter(is_lone).count()
    }

    /// One uncertainty per query, in order.
    ///
    /// # Errors
    ///
    /// Those of [`Neighbors::new`], [`Places::from_poses`] and the estimator.
    pub fn estimate(&self, retrieval: &Retrieval) -> Result<Vec<f64>> {
        let neighbors = || Neighbors::new(retrieval);
        let places = || {
            let none = Error::PoseKind { needed: "any kind of", actual: "no" };
            Places::from_poses(retrieval, self.poses.ok_or(none)?)
        };
        match &self.kind {
            Kind::L2 => L2Distance.estimate(&neighbors()?),
            Kind::Pa => PaScore.estimate(&neighbors()?),
            Kind::SimilarityDistribution => SimilarityDistribution.estimate(&neighbors()?),
            Kind::RatioSpread => RatioSpread.estimate(&neighbors()?),
            Kind::StatisticalUncertainty => StatisticalUncertainty.estimate(&neighbors()?),
            Kind::Sue(sue) => sue.estimate(&places()?),
            Kind::Density(sue) => sue.estimate(&places()?),
            Kind::Uniform(uniform) => uniform.estimate(&places()?),
        }
    }
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    #[test]
    fn references_that_weigh_alone_are_counted() {
        // Squared distances .04 and .0404 count about the same; at .09 the next counts e^-17.5.
        let distances = array![[0.2, 0.201], [0.2, 0.3]];
        let retrieval = Retrieval::new(array![[0, 1], [1, 2]], distances).unwrap();
        let poses = [0.0, 1.0, 2.0].map(|x| vpr_core::PlanarPosition::new(x, 0.0));
        let poses = Poses::Planar(poses.to_vec());
        let count = |choice: EstimatorChoice, k| {
            let sue = SueParams { k, ..*Sue::corrected().params() };
            let settings = EstimatorSettings { sue, nth: 1 };
            choice.prepare(&settings, Some(&poses)).unwrap().n_lone(&retrieval)
        };
        assert_eq!(count(EstimatorChoice::Sue, 2), 1);
        assert_eq!(count(EstimatorChoice::SueDensity, 2), 1);
        assert_eq!(count(EstimatorChoice::Sue, 1), 0, "a spread of one reference is 0 by design");
        assert_eq!(count(EstimatorChoice::L2, 2), 0);
    }
}
