//! Training: images in memory, their variants and batches by number; optimisers, schedules, weights
//! drawn from a seed, the loop and whitening; runs that go on after a kill, with their log.
//!
//! A training program opens a [`Run`] with everything that decides its result, gives it a
//! [`Descent`], a module and batches by number, and writes the weights with
//! [`crate::weights::save`].

mod adam;
mod augment;
mod batches;
mod checkpoint;
mod descent;
mod log;
mod optimizer;
mod pixels;
mod run;
mod schedule;
mod seed;
mod whitening;

pub use augment::augment;
pub use batches::{Arrangement, Batches, Chosen, Sizes, variants};
pub use checkpoint::Checkpoint;
pub use descent::{Batch, Descent, Learner, Report, Trainable};
pub use log::Log;
pub use optimizer::Optimizer;
pub use pixels::{Album, Pixels, planes};
pub(crate) use run::listed;
pub use run::{Difference, Run};
pub use schedule::Schedule;
pub use seed::seeded;
pub use whitening::{Affine, learned_whitening};

/// The device that networks are trained on: the default CPU backend with gradients.
#[must_use]
pub fn device() -> burn::tensor::Device {
    burn::tensor::Device::flex().autodiff()
}
