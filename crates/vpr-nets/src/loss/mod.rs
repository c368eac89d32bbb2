//! Losses of place-recognition training.
//!
//! Each takes rows of a batch and gives one number, a tensor of shape `[1]`; sizes are checked by
//! the tensors' own operations.

mod bayesian_triplet;
mod distance;
mod multi_similarity;
mod relative_pose;
mod self_teaching;
mod supervised_contrastive;
mod triplet;

pub use bayesian_triplet::{BayesianTriplet, positive};
pub use distance::distance_based;
pub use multi_similarity::MultiSimilarity;
pub use relative_pose::relative_pose;
pub use self_teaching::{LogVariance, SelfTeaching};
pub use supervised_contrastive::SupervisedContrastive;
pub use triplet::Triplet;

use burn::tensor::Tensor;

/// Euclidean distances between rows of two tensors, `n × 1`. The square root starts at 1e-12, so
/// that equal rows have a gradient of zero instead of none.
fn distances(a: Tensor<2>, b: Tensor<2>) -> Tensor<2> {
    ((a - b).square().sum_dim(1) + 1e-12).sqrt()
}

#[cfg(test)]
pub(crate) mod check;
