//! Networks of the chapter: H, from one anchor and a relative pose to a descriptor (thesis §6.2.2), and
//! encoders under three losses (§6.2.3).

mod best;
mod encoder;
mod pairs;
mod regressor;
mod relative;
mod training;
mod views;

pub use encoder::{EncoderLoss, EncoderTraining, default_network, train_encoder};
pub use pairs::{PairBatch, Pairs};
pub use regressor::NetworkRegressor;
pub use relative::{mirrored, relative_pose};
pub use training::{Training, train};
pub use views::{Reach, ViewBatch, Views};
