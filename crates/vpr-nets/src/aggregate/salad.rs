//! SALAD: clusters assigned by optimal transport, with a dustbin, beside a global token.

use burn::config::Config;
use burn::module::{Initializer, Module, Param};
use burn::nn::{Dropout, DropoutConfig, Linear, LinearConfig};
use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor};

use crate::Result;
use crate::layer::l2_normalize;
use crate::layer::{Conv2d, Conv2dConfig};
use crate::weights::Shapes;
use crate::weights::Weights;

/// Izquierdo and Civera, *Optimal Transport Aggregation for Visual Place Recognition* (2024);
/// `serizba/salad`.
#[derive(Module, Debug)]
pub struct Salad {
    token_features: Perceptron,
    cluster_features: Reduction,
    score: Reduction,
    /// The score of the dustbin, one number.
    dust_bin: Param<Tensor<1>>,
    iterations: usize,
}

/// Official keys (three `Sequential`s) to the fields of [`Salad`].
const RENAMES: [(&str, &str); 4] = [
    (r"token_features\.0\.", "token_features.inner."),
    (r"token_features\.2\.", "token_features.outer."),
    (r"(cluster_features|score)\.0\.", "$1.inner."),
    (r"(cluster_features|score)\.3\.", "$1.outer."),
];

/// Weights with official keys, under the names of the fields of [`Salad`].
///
/// # Errors
///
/// [`vpr_core::Error::Format`] if two keys become one.
pub fn from_official(weights: Weights) -> Result<Weights> {
    let vector = |key: String, mut tensor: crate::weights::Tensor| {
        // A number without axes; parameters here have at least one.
        if key.ends_with("dust_bin") && tensor.shape.is_empty() {
            tensor.shape = vec![1];
        }
        Some((key, tensor))
    };
    weights.mapped(vector).renamed(&RENAMES)
}

/// Configuration of [`Salad`].
#[derive(Config, Debug, PartialEq)]
pub struct SaladConfig {
    /// Channels of the map and of the token.
    pub channels: usize,
    /// Number of clusters.
    #[config(default = 64)]
    pub clusters: usize,
    /// Channels of a cluster.
    #[config(default = 128)]
    pub cluster_dim: usize,
    /// Channels of the global token in the descriptor.
    #[config(default = 256)]
    pub token_dim: usize,
    /// Width of the hidden layers.
    #[config(default = 512)]
    pub hidden: usize,
    /// Dropout while training.
    #[config(default = 0.3)]
    pub dropout: f64,
    /// Sinkhorn iterations.
    #[config(default = 3)]
    pub iterations: usize,
}

impl SaladConfig {
    /// The sizes of a checkpoint, after [`from_official`]; `prefix` is what its keys begin with.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Weights`] or [`vpr_core::Error::Format`] if a key is missing or misshaped.
    pub fn from_weights(weights: &Weights, prefix: &str) -> Result<Self> {
        let shapes = Shapes::new(weights, prefix);
        Ok(Self::new(shapes.axis("score.inner.weight", 1)?)
            .with_clusters(shapes.axis("score.outer.weight", 0)?)
            .with_cluster_dim(shapes.axis("cluster_features.outer.weight", 0)?)
            .with_token_dim(shapes.axis("token_features.outer.weight", 0)?)
            .with_hidden(shapes.axis("score.inner.weight", 0)?))
    }

    /// A head with random weights, the dustbin at 1.
    #[must_use]
    pub fn init(&self, device: &Device) -> Salad {
        let reduction = |out| Reduction {
            inner: Conv2dConfig::new([self.channels, self.hidden], [1, 1]).init(device),
            outer: Conv2dConfig::new([self.hidden, out], [1, 1]).init(device),
            dropout: DropoutConfig::new(self.dropout).init(),
        };
        Salad {
            token_features: Perceptron {
                inner: LinearConfig::new(self.channels, self.hidden).init(device),
                outer: LinearConfig::new(self.hidden, self.token_dim).init(device),
            },
            cluster_features: reduction(self.cluster_dim),
            score: reduction(self.clusters),
            dust_bin: Initializer::Ones.init([1], device),
            iterations: self.iterations,
        }
    }

    /// Length of the descriptor.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.token_dim + self.clusters * self.cluster_dim
    }
}

impl Salad {
    /// Aggregates a map (`batch × channels × rows × columns`) and a class token (`batch × channels`)
    /// to unit descriptors, `batch × token_dim + cluster_dim · clusters`.
    ///
    /// # Panics
    ///
    /// If there are not more positions than clusters: the dustbin would have no mass.
    #[must_use]
    pub fn forward(&self, map: Tensor<4>, token: Tensor<2>) -> Tensor<2> {
        let features = self.cluster_features.forward(map.clone());
        let scores = self.score.forward(map);
        let assignment = transport(scores, self.dust_bin.val(), self.iterations);
        let clusters = l2_normalize(features.matmul(assignment.swap_dims(1, 2)), 1);
        let token = l2_normalize(self.token_features.forward(token), 1);
        l2_normalize(Tensor::cat(vec![token, clusters.flatten(1, 2)], 1), 1)
    }
}

impl Salad {
    /// Number of clusters; an image needs more positions.
    #[must_use]
    pub fn clusters(&self) -> usize {
        self.score.outer.weight.dims()[0]
    }
}

/// Sinkhorn's algorithm in the log domain: `batch × clusters × n` scores to the share of every
/// position that goes to each cluster (the rest goes to the dustbin and is left out).
///
/// Every cluster takes the mass of one position, the dustbin that of the remaining n − clusters.
///
/// # Panics
///
/// If n ≤ clusters.
#[expect(clippy::cast_possible_truncation, reason = "masses are f32")]
fn transport(scores: Tensor<3>, dustbin: Tensor<1>, iterations: usize) -> Tensor<3> {
    let [batch, clusters, positions] = scores.dims();
    assert!(
        positions > clusters,
        "{positions} positions are too few for {clusters} clusters and a dustbin"
    );
    let device = scores.device();
    let dustbin = dustbin.reshape([1, 1, 1]).expand([batch, 1, positions]);
    let scores = Tensor::cat(vec![scores, dustbin], 1);
    let norm = -((positions + clusters) as f64).ln();
    let mut log_rows = vec![norm as f32; clusters + 1];
    log_rows[clusters] += ((positions - clusters) as f64).ln() as f32;
    let log_rows =
        Tensor::<1>::from_floats(log_rows.as_slice(), &device).reshape([1, clusters + 1, 1]);

    let mut row_shift = log_rows.clone() - log_sum_exp(scores.clone(), 2);
    let mut column_shift =
        log_sum_exp(scores.clone() + row_shift.clone(), 1).neg().add_scalar(norm);
    for _ in 1..iterations {
        row_shift = log_rows.clone() - log_sum_exp(scores.clone() + column_shift.clone(), 2);
        column_shift = log_sum_exp(scores.clone() + row_shift.clone(), 1).neg().add_scalar(norm);
    }
    let log_plan = (scores + row_shift + column_shift).sub_scalar(norm);
    log_plan.narrow(1, 0, clusters).exp()
}

/// ln Σ exp along `dim`, which stays with length 1.
fn log_sum_exp(x: Tensor<3>, dim: usize) -> Tensor<3> {
    let largest = x.clone().detach().max_dim(dim);
    (x - largest.clone()).exp().sum_dim(dim).log() + largest
}

/// Two linear layers with `ReLU` between.
#[derive(Module, Debug)]
struct Perceptron {
    inner: Linear,
    outer: Linear,
}

impl Perceptron {
    fn forward(&self, x: Tensor<2>) -> Tensor<2> {
        self.outer.forward(relu(self.inner.forward(x)))
    }
}

/// Two 1×1 convolutions with dropout and `ReLU` between.
#[derive(Module, Debug)]
struct Reduction {
    inner: Conv2d,
    outer: Conv2d,
    dropout: Dropout,
}

impl Reduction {
    /// `batch × channels × rows × columns` to `batch × out × positions`.
    fn forward(&self, map: Tensor<4>) -> Tensor<3> {
        let inner = relu(self.dropout.forward(self.inner.forward(map)));
        self.outer.forward(inner).flatten(2, 3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loss::check::{head_gradient, unit_rows};

    #[test]
    fn its_gradient_is_that_of_finite_differences() {
        let config = SaladConfig::new(6)
            .with_clusters(3)
            .with_cluster_dim(4)
            .with_token_dim(5)
            .with_hidden(8)
            .with_dropout(0.0);
        let head = config.init(&Device::flex().autodiff());
        // Rows 0 to 11 are positions of the map, the last is the token.
        head_gradient(head, unit_rows(13, 6, 1), |head, rows| {
            let map = rows.clone().narrow(0, 0, 12).transpose().reshape([1, 6, 3, 4]);
            head.forward(map, rows.narrow(0, 12, 1))
        });
    }

    #[test]
    fn every_cluster_and_every_position_has_its_mass() {
        let device = Device::flex();
        let scores = Tensor::<3>::random([2, 3, 20], burn::tensor::Distribution::Default, &device);
        let plan = transport(scores, Tensor::from_floats([1.0], &device), 50);
        for mass in plan.clone().sum_dim(2).into_data().try_to_vec::<f32>().unwrap() {
            approx::assert_abs_diff_eq!(mass, 1.0, epsilon = 1e-3);
        }
        for mass in plan.sum_dim(1).into_data().try_to_vec::<f32>().unwrap() {
            assert!(mass < 1.0 + 1e-5);
        }
    }
}
