//! Training: optimisers, schedules, checkpoints, weights drawn from a seed, the loop, and whitening.

mod adam;
mod checkpoint;
mod descent;
mod optimizer;
mod schedule;
mod seed;
mod whitening;

pub use checkpoint::Checkpoint;
pub use descent::{Batch, Descent, Report, Trainable};
pub use optimizer::Optimizer;
pub use schedule::Schedule;
pub use seed::seeded;
pub use whitening::{Affine, learned_whitening};

/// The device that networks are trained on: the default CPU backend with gradients.
#[must_use]
pub fn device() -> burn::tensor::Device {
    burn::tensor::Device::flex().autodiff()
}
