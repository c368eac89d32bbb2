//! Networks of visual place recognition, on burn.
//!
//! ```no_run
//! use vpr_nets::encode::{Options, by_name, encode_files};
//!
//! // Weights are in `data/weights/`; `bench methods` says where they are from.
//! let encoder = by_name("netvlad-mobilenetv2-rgb", None, &["data".into()])?;
//! let images = ["a.jpg".into(), "b.jpg".into()];
//! let descriptors = encode_files(&*encoder, &images, &Options::default(), &mut |_| ())?;
//! assert_eq!(descriptors.dim(), encoder.dimension());
//! # Ok::<(), vpr_nets::Error>(())
//! ```

pub mod aggregate;
pub mod backbone;
mod device;
pub mod encode;
mod error;
pub mod layer;
pub mod local;
pub mod loss;
pub mod model;
pub mod regress;
pub mod train;
pub mod transformer;
pub mod weights;

pub use device::DeviceChoice;
pub use error::{Error, Mismatch, Result};

/// The examples of the README, as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;

/// The device that networks run on: the default CPU backend.
#[must_use]
pub fn device() -> burn::tensor::Device {
    burn::tensor::Device::flex()
}

/// Version of the numbers: raised when a network or kernel gives other bits for the same input.
/// Whoever keeps results keeps it with them, so that they are not taken for another version's.
pub const NUMERICS: u32 = 4;
