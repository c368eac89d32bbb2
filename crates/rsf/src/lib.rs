//! RSF, chapter 4 of the thesis: an encoder that has read its map.
//!
//! An encoder trained on streets fails on rails and in archives, and the map of the target place is
//! there before any query. Its references, changed as queries may be, are the whole fine-tuning set:
//!
//! ```
//! use ndarray::array;
//! use rand::SeedableRng;
//! use rsf::{MiningParams, Preset, Triplet};
//! use vpr_core::{Descriptors, PlanarPosition, Poses};
//!
//! // Three references; the third looks like the first and lies 200 m away.
//! let rows = Descriptors::new(array![[1.0, 0.0], [0.0, 1.0], [0.9, 0.1]])?;
//! let poses = [0.0, 40.0, 200.0].map(|x| PlanarPosition::new(x, 0.0)).to_vec();
//! let params = MiningParams { hardest: 1, ..MiningParams::default() };
//! let mined = params.with_poses(&rows, &Poses::Planar(poses), &[0, 1, 2])?;
//! let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
//! let triplet = mined.triplet(0, &mut random);
//! assert_eq!(triplet, Some(Triplet { query: 0, positive: 0, negative: 2 }));
//!
//! // The query is an augmentation of its reference.
//! let size = vpr_vision::image::ImageSize { width: 4, height: 2 };
//! let reference = vpr_vision::image::from_pixels(size, vec![90; 24]);
//! let query = Preset::All.augmentations().apply(&reference, 7);
//! assert_eq!(query.size(), reference.size());
//! # Ok::<(), rsf::Error>(())
//! ```

pub mod augmentation;
mod error;
pub mod gap;
mod mining;
#[cfg(feature = "networks")]
pub mod net;
mod reference_set;
#[cfg(feature = "study")]
pub mod study;

pub use augmentation::{Augmentation, Augmentations, Operation, Preset};
pub use error::{Error, Result};
pub use mining::{Mined, MiningParams, Triplet};
pub use reference_set::{ReferenceSet, Split};

/// The examples of the README, as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
