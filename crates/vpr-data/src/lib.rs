//! Datasets on disk: what they are called, where they lie, how they are laid out, what is wrong
//! with them, and the formats in which other tools exchange descriptors and poses.
//!
//! ```
//! use vpr_data::{Dataset, DatasetEntry, Layout, Manifest};
//!
//! // What is known of a dataset before anything is at hand.
//! let manifest = Manifest::builtin();
//! let corridor = manifest.find("corridor")?;
//! assert_eq!((corridor.name.as_str(), corridor.layout), ("Corridor", Layout::VprBench));
//! assert!(manifest.find("corrido").is_err());
//! # Ok::<(), vpr_core::Error>(())
//! ```

mod dataset;
pub mod exchange;
pub mod layout;
pub mod manifest;
mod open;
pub mod truth;
pub mod validate;
mod zone;

pub use dataset::Dataset;
pub use manifest::{DataRoots, DatasetEntry, Layout, Manifest, Tolerance};
pub use open::{AtHand, Datasets, Generator};
pub use validate::{Problem, Severity, validate, validate_with};
pub use zone::ZoneChoice;

/// The examples of the README, as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
