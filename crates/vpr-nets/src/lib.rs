//! Networks of visual place recognition, on burn.

pub mod aggregate;
pub mod backbone;
pub mod encode;
pub mod layer;
pub mod local;
pub mod loss;
pub mod model;
pub mod train;
pub mod weights;

/// The device that networks run on: the default CPU backend.
#[must_use]
pub fn device() -> burn::tensor::Device {
    burn::tensor::Device::flex()
}
