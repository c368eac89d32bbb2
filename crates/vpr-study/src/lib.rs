//! The storey between a dataset with a technique and a cell of a table; every chapter stands on it.
//!
//! A technique is named once, in [`technique`]; what it finds on a dataset is computed once, by
//! [`Sources::scores`], and kept under one key, in [`Store`]. A chapter only says what it makes of
//! them:
//!
//! ```
//! use vpr_core::metrics::recall_at;
//! use vpr_study::{Direction, Sources};
//!
//! let cache = tempfile::tempdir()?;
//! let sources = Sources::new(["data".as_ref()], cache.path(), &());
//! let world = "world/street?places=3&camera.width=80&camera.height=60";
//! let dataset = sources.images(world)?.expect("it is rendered on the spot");
//! let hog = sources.runner("hog")?.expect("it needs no weights");
//! let scores = sources.scores(&hog, &dataset, Direction::AsReleased)?;
//! // Three places are hard for HOG from a pose nearby: it finds one.
//! assert_eq!(recall_at(1, scores.ranking()?, &dataset.truth)?, 1.0 / 3.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod describe;
mod dial;
mod hand_crafted;
mod memo;
#[cfg(feature = "networks")]
mod network;
#[cfg(feature = "cli")]
pub mod reading;
mod scored;
mod sheet;
mod sources;
mod store;
mod stored;
mod subject;
pub mod technique;
mod thumbnail;
#[cfg(feature = "cli")]
mod truth;
pub mod verification;

pub use describe::{Describe, Features, Matched};
pub use dial::Dial;
pub use hand_crafted::{HandCrafted, Vlad};
pub use memo::Memo;
#[cfg(feature = "networks")]
pub use network::Network;
pub use scored::{Direction, MAX_RANK, Scores};
pub use sheet::{ContactSheet, Frame, Tile};
pub use sources::Sources;
pub use store::Store;
pub use stored::Stored;
pub use subject::Subject;
pub use technique::{Runner, Technique};
pub use thumbnail::thumbnails;
#[cfg(feature = "cli")]
pub use truth::TruthArgs;

/// The examples of the README, as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
