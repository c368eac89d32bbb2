//! Training images of the default network: generated cities, and batches of them by number.
//!
//! The program of this package trains the network; other heads on its trunk train on the same
//! images.

pub mod augment;
pub mod batches;
pub mod cities;
pub mod pixels;
