//! Networks of visual place recognition, on burn.

pub mod aggregate;
pub mod backbone;
pub mod encode;
pub mod layer;
pub mod local;
pub mod loss;
pub mod train;
pub mod weights;
