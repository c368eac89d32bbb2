//! Shared vocabulary of map-aware visual place recognition.
//!
//! Data flows one way: images → descriptors → map → retrieval → metrics → table.
//!
//! ```
//! use ndarray::array;
//! use vpr_core::{Descriptors, GroundTruth, metrics, retrieve};
//!
//! let references = Descriptors::new(array![[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])?;
//! let queries = Descriptors::new(array![[0.9, 0.1]])?;
//!
//! let retrieval = retrieve(&queries, &references, 2)?;
//! assert_eq!(retrieval.best(), [0]);
//!
//! let truth = GroundTruth::from_lists(vec![vec![0]], references.len())?;
//! assert_eq!(metrics::recall_at(1, &retrieval, &truth)?, 1.0);
//! # Ok::<(), vpr_core::Error>(())
//! ```
//!
//! Conventions: descriptors are f32, poses and metrics f64; Euclidean distances are not squared
//! unless named so; a lower distance is nearer, a higher similarity or confidence is more certain;
//! ties break by lower index; every result is the same for any number of threads.

mod definition;
mod descriptors;
mod error;
mod evaluation;
mod ground_truth;
pub mod knn;
pub mod map;
pub mod metrics;
mod observer;
mod pose;
mod provenance;
mod ranking;
mod retrieval;
mod scores;

pub use definition::Definition;
pub use descriptors::Descriptors;
pub use error::{Error, Result};
pub use evaluation::{Evaluation, Judged, Summary, best_by_auc_pr, best_by_hits};
pub use ground_truth::GroundTruth;
pub use map::Map;
pub use observer::Observer;
pub use pose::{PlanarPosition, Pose, Poses, Position};
pub use provenance::Provenance;
pub use ranking::Ranking;
pub use retrieval::{Retrieval, retrieve};
pub use scores::{BestMatches, Similarities};

/// The examples of the README, as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
