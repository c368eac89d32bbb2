//! Layers shared by all networks; the one place that decides which implementation runs.

mod conv2d;
mod conv_norm;
mod dense;
mod gradient;
mod kernel;
mod l2;
pub(crate) mod memory;
mod normalize;
pub(crate) mod one_pass;
mod portable;

pub use conv_norm::conv_norm;
pub use conv2d::{Conv2d, Conv2dConfig};
pub use dense::{dense, dense_gelu};
pub use kernel::Activation;
pub(crate) use kernel::{Heads, attend, product};
pub use l2::{l2_normalize, l2_normalize_rows};
pub use portable::{group_norm, linear, standardize};
