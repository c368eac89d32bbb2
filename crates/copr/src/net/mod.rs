//! The regression network H: from one anchor and a relative pose to a descriptor; thesis §6.2.2.

mod pairs;
mod regressor;
mod relative;
mod training;

pub use pairs::{PairBatch, Pairs};
pub use regressor::NetworkRegressor;
pub use relative::{mirrored, relative_pose};
pub use training::{Training, train};
