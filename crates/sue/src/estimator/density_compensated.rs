//! SUE for maps that are denser in some areas than queries are.

use std::collections::HashSet;

use rayon::prelude::*;
use rstar::RTree;
use vpr_core::{Error, Poses};

use super::{
    Category, Sue, UncertaintyEstimator, check_length, check_ranks,
    spread::{exponentiate, weighted_spread},
};
use crate::{Error as SueError, Places, Result};

/// SUE whose weights are compensated for the density of the map, `w = exp(−λ d) · z²`, where `z` is
/// a reference's distance to its `nth` nearest neighbour in space (thesis eq. 5.12): the prior that
/// queries are spread uniformly over the mapped area.
#[derive(Clone, Debug, PartialEq)]
pub struct DensityCompensatedSue {
    sue: Sue,
    nth: usize,
    log_areas: Vec<f64>,
}

/// Which neighbours in space are counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Density {
    /// Distinct positions: several references at one position (tiles of one panorama) count once,
    /// and their `z` is never 0.
    Distinct,
    /// References, as eq. 5.12 reads: where `nth` others share a position, its `z` and so its
    /// weights are 0 (S-10).
    Plain,
}

impl DensityCompensatedSue {
    /// The estimator that is compensated.
    pub(super) fn sue(&self) -> &Sue {
        &self.sue
    }

    /// Measures the density of a map once.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if `nth` is zero or there are not that many other places;
    /// [`Error::NotFinite`] for a pose that is not finite.
    pub fn new(sue: Sue, poses: &Poses, nth: usize, density: Density) -> Result<Self> {
        poses.check_finite()?;
        if nth == 0 {
            let reason = "must be at least 1";
            return Err(Error::Parameter { name: "nth", value: "0".into(), reason }.into());
        }
        let all: Vec<[f64; 3]> =
            (0..poses.len()).map(|index| poses.position(index).coords.into()).collect();
        let mut counted = all.clone();
        if density == Density::Distinct {
            let mut seen = HashSet::new();
            counted.retain(|place| seen.insert(place.map(|it| (it + 0.0).to_bits())));
        }
        if counted.len() <= nth {
            let reason = "there are not that many other positions in the map";
            return Err(Error::Parameter { name: "nth", value: nth.to_string(), reason }.into());
        }
        let tree = RTree::bulk_load(counted);
        let log_areas = all
            .par_iter()
            .map(|place| {
                let nearest = tree.nearest_neighbor_iter(*place).nth(nth);
                let squared = nearest.map_or(0.0, |other| squared_distance(place, other));
                squared.ln()
            })
            .collect();
        Ok(Self { sue, nth, log_areas })
    }

    /// `z` of every reference, in metres.
    pub fn spacing(&self) -> impl Iterator<Item = f64> {
        self.log_areas.iter().map(|area| (area / 2.0).exp())
    }
}

fn squared_distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

impl UncertaintyEstimator for DensityCompensatedSue {
    type Evidence<'a> = Places<'a>;

    const CATEGORY: Category = Category::Spatial;

    fn name(&self) -> &'static str {
        "SUE, density compensated"
    }

    fn estimate_into(&self, evidence: &Places<'_>, out: &mut [f64]) -> Result<()> {
        check_length(evidence, out)?;
        let params = self.sue.params();
        check_ranks(self.name(), params.k, evidence.retrieval().k())?;
        let (expected, actual) = (self.log_areas.len(), evidence.poses().len());
        if expected != actual {
            let what = "references of the map whose density was measured";
            return Err(Error::Mismatch { what, expected, actual }.into());
        }
        let mut weights = vec![0.0; params.k];
        for (query, out) in out.iter_mut().enumerate() {
            let distances = evidence.retrieval().distances(query);
            let references = evidence.retrieval().indices(query);
            let references = references.slice_move(ndarray::s![..params.k]);
            for ((weight, &nearby), &reference) in weights.iter_mut().zip(distances).zip(references)
            {
                let decay = params.lambda * params.distance.of(nearby);
                *weight = self.log_areas[reference] - decay;
            }
            if !exponentiate(&mut weights) {
                return Err(SueError::NoDensity { query, k: params.k, nth: self.nth });
            }
            *out = weighted_spread(references, evidence.poses(), &weights);
        }
        Ok(())
    }
}
