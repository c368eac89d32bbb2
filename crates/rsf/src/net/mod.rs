//! Fine-tuning of the default network on a map, and what is cheaper.

#[cfg(feature = "study")]
mod attention;
mod best;
mod finetune;
mod lessons;
mod low_rank;
mod material;
mod mixture;
mod parts;
mod settings;
mod student;
#[cfg(test)]
mod tests;
mod trial;
mod whitening;

#[cfg(feature = "study")]
pub(crate) use attention::looks;
pub use finetune::{Outcome, finetune, last};
pub use lessons::{Lessons, TripletBatch};
pub use material::{Material, default_network};
pub use parts::Parts;
pub use settings::{Finetuning, run_log};
pub use student::Student;
pub use trial::{Score, Trial};
pub use whitening::{Whitening, projected, whiten};
#[cfg(feature = "study")]
pub(crate) use whitening::{features, pooled_features, projection};
