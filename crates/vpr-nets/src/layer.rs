//! Layers shared by all networks; the one place that decides which implementation runs.

pub use burn::nn::conv::{Conv2d, Conv2dConfig};
