//! `CoPR`, chapter 6 of the thesis: a reference map that is denser than its images.
//!
//! A map knows places only where a camera stood, so the best retrieval is wrong by the distance to
//! the nearest of them. Descriptors regressed at poses in between, or beside, make it denser without
//! an image:
//!
//! ```
//! use copr::{Anchors, LinearInterpolation, Options, PoseErrors, Targets, oracle, regressed, sequences};
//! use ndarray::array;
//! use vpr_core::{Descriptors, Map, Pose, Poses, retrieve};
//!
//! // Three images, four metres apart.
//! let poses: Vec<Pose> = [0.0, 4.0, 8.0].map(|x| Pose::translation(x, 0.0, 0.0)).to_vec();
//! let rows = Descriptors::new(array![[1.0, 0.0], [0.5, 0.5], [0.0, 1.0]])?;
//! let sparse = Map::new(rows, Poses::SixDof(poses.clone()))?;
//!
//! let anchors = Anchors::every(&poses, &sequences(None, 3), 1)?;
//! let targets = Targets::between(&anchors, 3)?; // every metre
//! let (dense, _) = regressed(&sparse, &targets, &LinearInterpolation, Options::default())?;
//!
//! let queries = Descriptors::new(array![[0.62, 0.38]])?; // taken at 3 m
//! let truth = Poses::SixDof(vec![Pose::translation(3.0, 0.0, 0.0)]);
//! let mte = |map: &Map| -> Result<f64, copr::Error> {
//!     let best = retrieve(&queries, map.descriptors(), 1)?.best();
//!     Ok(PoseErrors::of_retrieval(&best, map.poses(), &truth)?.translation_m[0])
//! };
//! assert_eq!((mte(&sparse)?, mte(&dense)?), (1.0, 0.0));
//! assert_eq!(oracle(&truth, dense.poses())?, [2]);
//! # Ok::<(), copr::Error>(())
//! ```
//!
//! [`densify`] writes the rows to a map file as they come. Which rows were measured and which are
//! regressed, and from which anchors, stays in the map ([`vpr_core::map::Origins`]), so that
//! whoever trusts images only can leave them out.

mod anchors;
mod densify;
mod error;
mod localize;
#[cfg(feature = "networks")]
pub mod net;
pub mod regression;
#[cfg(feature = "study")]
pub mod study;
pub mod targets;

pub use anchors::{Anchors, Selection, sequences};
pub use densify::{Options, Piece, densify, regress, regressed};
pub use error::{Error, Result};
pub use localize::{
    Accuracy, PoseErrors, WITHIN, oracle, rotation_error, target_from_anchor, translation_error,
    world_offset,
};
pub use regression::{
    Blended, Control, Controlled, GaussianParams, GaussianProcess, LinearInterpolation, Outside,
    PlaneFit, PlaneParams, Regressor, Told,
};
pub use targets::{Frame, Grid, MOST_TARGETS, Target, Targets};

/// The examples of the README, as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
