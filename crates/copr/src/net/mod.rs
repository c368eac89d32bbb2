//! Networks of the chapter: H, from one anchor and a relative pose to a descriptor (thesis §6.2.2),
//! encoders under three losses (§6.2.3), and the pose between two descriptors (§6.2.4).

mod best;
mod encoder;
mod head;
mod pairs;
mod pose;
mod regressor;
mod relative;
mod training;
mod views;

pub use encoder::{EncoderLoss, EncoderTraining, default_network, train_encoder};
pub use pairs::{PairBatch, Pairs};
pub use pose::{PoseNetwork, train_pose};
pub use regressor::NetworkRegressor;
pub use relative::{mirrored, relative_pose};
pub use training::{Training, train};
pub use views::{Reach, ViewBatch, Views};
