//! SUE, chapter 5 of the thesis: how far to trust the best match of a query.
//!
//! From what was retrieved and the map it was retrieved from to accepting or rejecting:
//!
//! ```
//! use ndarray::array;
//! use sue::{Places, Sue, SueParams, Threshold, UncertaintyEstimator};
//! use vpr_core::{Descriptors, Map, PlanarPosition, Poses, retrieve};
//!
//! // Two references of one place, and one that looks alike 300 m away.
//! let places = [(0.0, 0.0), (2.0, 0.0), (300.0, 0.0)].map(|(x, y)| PlanarPosition::new(x, y));
//! let references = Descriptors::new(array![[1.0, 0.0], [0.9, 0.1], [0.0, 1.0]])?.normalized();
//! let map = Map::new(references, Poses::Planar(places.to_vec()))?;
//! let queries = Descriptors::new(array![[1.0, 0.1], [0.7, 0.7]])?.normalized();
//! let retrieval = retrieve(&queries, map.descriptors(), 3)?;
//! let sue = Sue::new(SueParams { k: 3, lambda: 10.0, ..*Sue::corrected().params() })?;
//! let uncertainty = sue.estimate(&Places::new(&retrieval, &map)?)?; // metres², higher is less certain
//! let threshold = Threshold::below(100.0)?; // or from `calibrate`, with a guarantee
//! assert_eq!(uncertainty.iter().map(|&it| threshold.accepts(it)).collect::<Vec<_>>(), [true, false]);
//! # Ok::<(), sue::Error>(())
//! ```
//!
//! What an estimator needs is the type of its evidence: [`Neighbors`] for those that look at
//! distances, [`Places`] for those that also look at the map, [`Variances`] for learned ones,
//! [`InlierCounts`] for geometric verification.

pub mod calibrate;
#[cfg(feature = "study")]
pub mod corpus;
mod decision;
mod error;
mod estimator;
mod evidence;
pub mod fusion;
#[cfg(feature = "study")]
pub mod net;
#[cfg(feature = "study")]
pub mod study;

pub use decision::Threshold;
pub use error::{Error, Result};
pub use estimator::{
    Category, Density, DensityCompensatedSue, DistanceKind, EstimatorChoice, EstimatorSettings,
    Inliers, L2Distance, PaScore, Prepared, RatioSpread, SimilarityDistribution,
    StatisticalUncertainty, Sue, SueDefinition, SueParams, UncertaintyEstimator, Uniform, Variance,
};
pub use evidence::{Evidence, InlierCounts, Needs, Neighbors, Places, Share, Variances};

/// The examples of the README, as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
