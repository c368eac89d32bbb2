//! Geometric verification: how many matches one geometry explains, by RANSAC.
//!
//! Samples depend on the seed alone, and their number not on what is found unless asked for. The model of a sample that
//! explains most is replaced by that of all its inliers where it explains no fewer.

#![expect(clippy::many_single_char_names, reason = "coordinates and entries of matrices")]
#![expect(clippy::inline_always, reason = "what is inlined uses the caller's instruction set")]

mod algebra;
mod essential;
mod fundamental;
mod geometry;
mod homography;
mod polynomial;
mod sampling;
mod search;

use serde::{Deserialize, Serialize};
use vpr_core::{Error, Result};

use self::{
    essential::Essential, fundamental::Fundamental, geometry::Geometry, homography::Homography,
    search::search,
};
use crate::{features::LocalFeatures, matching::Match};

/// Where a point of the query image is seen in the reference image: (x, y) in pixels of each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correspondence {
    /// Position in the query image.
    pub query: [f64; 2],
    /// Position in the reference image.
    pub reference: [f64; 2],
}

/// The positions of matched features.
///
/// # Panics
///
/// If a match names a feature that is not there.
#[must_use]
pub fn correspondences(
    query: &LocalFeatures,
    reference: &LocalFeatures,
    matches: &[Match],
) -> Vec<Correspondence> {
    let of = |it: &Match| Correspondence {
        query: query.keypoints()[it.query].map(f64::from),
        reference: reference.keypoints()[it.reference].map(f64::from),
    };
    matches.iter().map(of).collect()
}

/// How long is searched and what counts as an inlier.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RansacParams {
    /// Inliers are nearer than this, in pixels: to the predicted point of the reference image for a homography, to
    /// the epipolar geometry (Sampson distance) otherwise.
    pub threshold: f64,
    /// Samples that are drawn, exactly so many unless `confidence` is set.
    pub iterations: u32,
    /// Stop as soon as a sample of inliers alone was drawn with this probability, judged by the best model so far.
    #[serde(default)]
    pub confidence: Option<f64>,
    /// Seed of the draws (`ChaCha8`).
    #[serde(default)]
    pub seed: u64,
}

impl RansacParams {
    /// 1 000 iterations as in the thesis (chapter 5), 5 pixels as in its released code.
    pub const HOMOGRAPHY: Self =
        Self { threshold: 5.0, iterations: 1000, confidence: None, seed: 0 };

    /// 1 000 iterations and 3 pixels, OpenCV's default for a fundamental matrix.
    pub const EPIPOLAR: Self = Self { threshold: 3.0, iterations: 1000, confidence: None, seed: 0 };

    fn check(&self) -> Result<()> {
        let refuse = |name, value: String, reason| Err(Error::Parameter { name, value, reason });
        if !(self.threshold.is_finite() && self.threshold > 0.0) {
            return refuse("threshold", self.threshold.to_string(), "must be a number above 0");
        }
        if self.iterations == 0 {
            return refuse("iterations", "0".to_owned(), "must be at least 1");
        }
        match self.confidence {
            Some(it) if !(it > 0.0 && it < 1.0) => {
                refuse("confidence", it.to_string(), "must be between 0 and 1")
            }
            _ => Ok(()),
        }
    }
}

/// The geometry that explains most matches, and which it explains.
#[derive(Clone, Debug, PartialEq)]
pub struct Inliers {
    /// 3 × 3, row by row; `None` if no sample gave a model. Maps (x, y, 1) of the query image to the reference image
    /// for a homography; bᵀ M a = 0 otherwise, a in the query image.
    pub model: Option<[[f64; 3]; 3]>,
    /// One entry per correspondence; all false without a model.
    pub mask: Vec<bool>,
    /// Samples that were drawn.
    pub iterations: u32,
}

impl Inliers {
    /// Number of inliers: the confidence of geometric verification.
    #[must_use]
    pub fn count(&self) -> usize {
        self.mask.iter().filter(|&&inlier| inlier).count()
    }
}

/// A pinhole camera without distortion, in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Intrinsics {
    /// Focal lengths along x and y.
    pub focal: [f64; 2],
    /// The principal point (x, y).
    pub center: [f64; 2],
}

impl Intrinsics {
    fn normalize(&self, point: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| (point[axis] - self.center[axis]) / self.focal[axis])
    }

    fn mean_focal(&self) -> f64 {
        0.5 * (self.focal[0] + self.focal[1])
    }

    fn check(&self) -> Result<()> {
        let usable = |&it: &f64| it.is_finite() && it > 0.0;
        if self.focal.iter().all(usable) && self.center.iter().all(|it| it.is_finite()) {
            return Ok(());
        }
        Err(Error::Parameter {
            name: "intrinsics",
            value: format!("{:?}, {:?}", self.focal, self.center),
            reason: "focal lengths must be above 0 and all numbers finite",
        })
    }
}

/// Inliers of a plane-to-plane mapping; needs 4 correspondences.
///
/// Samples in which three points are on a line, or that a mapping without reflection cannot explain, are drawn again.
/// The error is the distance in the reference image alone, as in OpenCV's `findHomography`. Exactly four
/// correspondences are no matter of samples: as there, the mapping nearest to all four is taken.
///
/// # Errors
///
/// [`Error::Parameter`] if a parameter is out of range or a coordinate beyond 1e9, [`Error::NotFinite`] if one is NaN or
/// infinite. Too few or degenerate correspondences are no error: they give no model and no inlier.
pub fn homography(points: &[Correspondence], params: &RansacParams) -> Result<Inliers> {
    let points = checked(points, |it| it, |it| it)?;
    if points.len() == Homography::SAMPLE {
        params.check()?;
        return Ok(of_four(&points, params.threshold));
    }
    search::<Homography>(&points, params, params.threshold)
}

/// The mapping of four correspondences, which may coincide, and those that it explains.
fn of_four(points: &[Correspondence], threshold: f64) -> Inliers {
    let model = homography::nearest(points);
    let below = threshold * threshold;
    let mask = match &model {
        Some(model) => search::mask::<Homography>(model, points, below),
        None => vec![false; points.len()],
    };
    Inliers { model, mask, iterations: 1 }
}

/// Inliers of the epipolar geometry of two uncalibrated images; needs 8 correspondences.
///
/// # Errors
///
/// As [`homography`].
pub fn fundamental(points: &[Correspondence], params: &RansacParams) -> Result<Inliers> {
    let points = checked(points, |it| it, |it| it)?;
    search::<Fundamental>(&points, params, params.threshold)
}

/// Inliers of the epipolar geometry of two calibrated images, by the five-point method; needs 5 correspondences.
///
/// The threshold is divided by the mean focal length of both cameras, and the model is the essential matrix of
/// normalised coordinates.
///
/// # Errors
///
/// As [`homography`], and [`Error::Parameter`] for a focal length that is not positive.
pub fn essential(
    points: &[Correspondence],
    cameras: [Intrinsics; 2],
    params: &RansacParams,
) -> Result<Inliers> {
    cameras.iter().try_for_each(Intrinsics::check)?;
    let [query, reference] = cameras;
    let points = checked(points, |it| query.normalize(it), |it| reference.normalize(it))?;
    let focal = 0.5 * (query.mean_focal() + reference.mean_focal());
    search::<Essential>(&points, params, params.threshold / focal)
}

/// Coordinates beyond this are no pixels, and their squares would not be finite in every solver.
const FARTHEST: f64 = 1e9;

fn checked(
    points: &[Correspondence],
    query: impl Fn([f64; 2]) -> [f64; 2],
    reference: impl Fn([f64; 2]) -> [f64; 2],
) -> Result<Vec<Correspondence>> {
    let of = |(row, it): (usize, &Correspondence)| {
        let given = [it.query, it.reference];
        let used = [query(it.query), reference(it.reference)];
        if let Some(column) = given.as_flattened().iter().position(|value| !value.is_finite()) {
            let value = given.as_flattened()[column];
            return Err(Error::NotFinite { what: "correspondences", row, column, value });
        }
        if used.as_flattened().iter().any(|value| value.abs() > FARTHEST) {
            let value = format!("row {row}: {given:?}");
            let reason = "coordinates must be within 1e9, of normalised images too";
            return Err(Error::Parameter { name: "correspondences", value, reason });
        }
        Ok(Correspondence { query: used[0], reference: used[1] })
    };
    points.iter().enumerate().map(of).collect()
}

#[cfg(test)]
mod tests;
