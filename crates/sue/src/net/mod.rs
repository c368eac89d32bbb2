//! Learned uncertainty: networks that say with each descriptor how sure it is.
//!
//! [`Btl`] (Warburg, Jørgensen, Civera and Hauberg, ICCV 2021) has one variance for all dimensions
//! of a descriptor and learns it from triplets; [`Stun`] (Cai, Lu and Huang, IROS 2022) has one per
//! dimension and learns it from a teacher. Both sit on any [`Backbone`]: the default network, which
//! can be trained here, or ResNet-50 with generalised-mean pooling, as published.

mod backbone;
mod btl;
mod learned;
mod stun;
#[cfg(test)]
mod tests;
mod training;
mod triplets;
mod variance_head;

pub use backbone::{Backbone, Features, ResNetGem, ResNetTwoGem};
pub use btl::Btl;
pub use learned::{Embedded, Learned, LearnedEncoder};
pub use stun::{SelfTaught, Stun};
pub use training::{Lesson, Training, default_network};
pub use triplets::{Negatives, Triplets, mine};
pub use variance_head::VarianceHead;
