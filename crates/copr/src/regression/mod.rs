//! Descriptors at poses that no camera visited, one file per strategy.

mod blended;
mod control;
mod gaussian;
mod linear;
mod plane;

use rayon::prelude::*;
use vpr_core::Pose;

pub use blended::Blended;
pub use control::{Control, Controlled};
pub use gaussian::{GaussianParams, GaussianProcess};
pub use linear::LinearInterpolation;
pub use plane::{Outside, PlaneFit, PlaneParams};

use crate::{Error, Result, Selection};

/// A reference that a target is regressed from.
#[derive(Clone, Copy, Debug)]
pub struct Anchor<'a> {
    /// Where it was taken, `world_from_camera`.
    pub pose: &'a Pose,
    /// Its descriptor.
    pub descriptor: &'a [f32],
}

/// One descriptor that is wanted.
#[derive(Clone, Debug)]
pub struct Request<'a> {
    /// Number of the target, for messages.
    pub target: usize,
    /// Where, `world_from_camera`.
    pub pose: Pose,
    /// What it is regressed from, as [`Regressor::selection`] chooses.
    pub anchors: Vec<Anchor<'a>>,
}

/// What a reader of regressed descriptors should know.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Told {
    /// Targets outside of what their anchors span, regressed as if they lay at the nearest point
    /// that they do span.
    pub n_flat: usize,
    /// The first of them.
    pub first_flat: Option<usize>,
}

impl Told {
    /// Both together; `self` came first.
    #[must_use]
    pub fn and(self, later: Self) -> Self {
        Self {
            n_flat: self.n_flat + later.n_flat,
            first_flat: self.first_flat.or(later.first_flat),
        }
    }

    fn flat(target: usize) -> Self {
        Self { n_flat: 1, first_flat: Some(target) }
    }
}

/// A strategy of thesis §6.2.2: from anchors and a pose to a descriptor.
pub trait Regressor: Sync {
    /// Its name in tables.
    fn name(&self) -> &'static str;

    /// Which anchors it looks at.
    fn selection(&self) -> Selection;

    /// Regresses descriptors: `out` holds one after the other, each as long as those of the anchors.
    ///
    /// # Errors
    ///
    /// The first target that has no value, and why.
    fn regress(&self, requests: &[Request<'_>], out: &mut [f32]) -> Result<Told>;
}

/// Regresses each descriptor as a weighted sum of its anchors; `weights` gives a weight for each.
fn combine(
    requests: &[Request<'_>],
    out: &mut [f32],
    weights: impl Fn(&Request<'_>) -> Result<(Vec<f64>, Told)> + Sync,
) -> Result<Told> {
    let dim = (out.len() / requests.len().max(1)).max(1);
    let told: Vec<Result<Told>> = requests
        .par_iter()
        .zip(out.par_chunks_mut(dim))
        .map(|(request, out)| {
            let (weights, told) = weights(request)?;
            for (column, out) in out.iter_mut().enumerate() {
                let terms = request.anchors.iter().zip(&weights);
                let value: f64 =
                    terms.map(|(it, weight)| weight * f64::from(it.descriptor[column])).sum();
                *out = narrow(value);
                if !out.is_finite() {
                    return Err(Error::NotFinite { target: request.target, column, value });
                }
            }
            Ok(told)
        })
        .collect();
    // In order, so that the first error is the same on any number of threads.
    told.into_iter().try_fold(Told::default(), |all, one| Ok(all.and(one?)))
}

/// The one place where a regressed value becomes f32.
#[expect(clippy::cast_possible_truncation, reason = "descriptors are f32")]
pub(crate) fn narrow(value: f64) -> f32 {
    value as f32
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// What a regressor makes of one target.
    pub(crate) fn one(
        regressor: &dyn Regressor,
        pose: Pose,
        anchors: &[(Pose, Vec<f32>)],
    ) -> Result<(Vec<f32>, Told)> {
        let dim = anchors[0].1.len();
        let anchors = anchors.iter().map(|(pose, descriptor)| Anchor { pose, descriptor });
        let requests = [Request { target: 7, pose, anchors: anchors.collect() }];
        let mut out = vec![0.0; dim];
        let told = regressor.regress(&requests, &mut out)?;
        Ok((out, told))
    }

    pub(crate) fn at(x: f64, y: f64, z: f64) -> Pose {
        Pose::translation(x, y, z)
    }
}
