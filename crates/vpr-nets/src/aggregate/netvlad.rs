//! NetVLAD: residuals to cluster centres, weighted by a soft assignment.

use burn::config::Config;
use burn::module::{Initializer, Module, Param};
use burn::tensor::activation::softmax;
use burn::tensor::module::linear;
use burn::tensor::{Device, Tensor};
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::layer::l2_normalize;
use crate::weights::Shapes;
use crate::weights::Weights;

/// What is done with the cluster centres: the sign differs between published weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Centres {
    /// x − c, as in the paper, hloc and pytorch-NetVlad.
    Subtracted,
    /// x + c: the MATLAB release, and Keras ports of it, store −c.
    Added,
}

/// The order of a flattened K × D matrix of residuals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Order {
    /// Channel by channel, all clusters of each (hloc, MATLAB).
    ChannelMajor,
    /// Cluster by cluster, all channels of each (pytorch-NetVlad).
    ClusterMajor,
}

/// How residuals become a descriptor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct VladForm {
    /// Sign of the centres.
    pub centres: Centres,
    /// Order of the descriptor.
    pub order: Order,
    /// Whether the residual of every cluster is normalised before the whole is.
    pub intra_normalise: bool,
}

impl Default for VladForm {
    /// As hloc: centres subtracted, channel by channel, clusters normalised.
    fn default() -> Self {
        Self { centres: Centres::Subtracted, order: Order::ChannelMajor, intra_normalise: true }
    }
}

/// VLAD of `features` (`batch × dim × n`) with an assignment (`batch × clusters × n`) and centres
/// (`dim × clusters`): unit descriptors, `batch × dim · clusters`.
///
/// Arandjelović et al., *NetVLAD: CNN Architecture for Weakly Supervised Place Recognition* (2016), eq. 1;
/// the sum over positions is taken as two matrix products, never a `dim × clusters × n` tensor.
#[must_use]
pub fn vlad(
    features: Tensor<3>,
    assignment: Tensor<3>,
    centres: Tensor<2>,
    form: VladForm,
) -> Tensor<2> {
    let mass = assignment.clone().sum_dim(2).swap_dims(1, 2);
    let sums = features.matmul(assignment.swap_dims(1, 2));
    let shift = centres.unsqueeze::<3>() * mass;
    let residuals = match form.centres {
        Centres::Subtracted => sums - shift,
        Centres::Added => sums + shift,
    };
    let residuals = if form.intra_normalise { l2_normalize(residuals, 1) } else { residuals };
    let ordered = match form.order {
        Order::ChannelMajor => residuals,
        Order::ClusterMajor => residuals.swap_dims(1, 2),
    };
    l2_normalize(ordered.flatten(1, 2), 1)
}

/// NetVLAD with the keys and shapes of hloc: `score_proj.weight` (clusters × dim × 1), `centers` (dim × clusters).
#[derive(Module, Debug)]
pub struct NetVlad {
    score_proj: ScoreProjection,
    centers: Param<Tensor<2>>,
    normalise_input: bool,
    #[module(skip)]
    form: VladForm,
}

/// The soft assignment's scores, a convolution of width 1.
#[derive(Module, Debug)]
struct ScoreProjection {
    weight: Param<Tensor<3>>,
    bias: Option<Param<Tensor<1>>>,
}

/// Configuration of [`NetVlad`].
#[derive(Config, Debug)]
pub struct NetVladConfig {
    /// Channels of the features.
    #[config(default = 512)]
    pub dim: usize,
    /// Number of clusters.
    #[config(default = 64)]
    pub clusters: usize,
    /// Whether scores have a bias (`vladv2`).
    #[config(default = false)]
    pub bias: bool,
    /// Whether every feature is normalised before anything else; the layer of hloc expects that done.
    #[config(default = false)]
    pub normalise_input: bool,
    /// From residuals to descriptor.
    #[config(default = "VladForm::default()")]
    pub form: VladForm,
}

impl NetVladConfig {
    /// The sizes of a checkpoint; `prefix` is what its keys begin with.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Weights`] or [`vpr_core::Error::Format`] if a key is missing or misshaped.
    pub fn from_weights(weights: &Weights, prefix: &str) -> Result<Self> {
        let shapes = Shapes::new(weights, prefix);
        Ok(Self::new()
            .with_dim(shapes.axis("centers", 0)?)
            .with_clusters(shapes.axis("centers", 1)?)
            .with_bias(shapes.has("score_proj.bias")))
    }

    /// A layer with random weights.
    #[must_use]
    pub fn init(&self, device: &Device) -> NetVlad {
        let (dim, clusters) = (self.dim, self.clusters);
        let scores = Initializer::KaimingUniform { gain: 1.0 / 3f64.sqrt(), fan_out_only: false };
        let xavier = Initializer::XavierUniform { gain: 1.0 };
        NetVlad {
            score_proj: ScoreProjection {
                weight: scores.init_with([clusters, dim, 1], Some(dim), Some(clusters), device),
                bias: self
                    .bias
                    .then(|| scores.init_with([clusters], Some(dim), Some(clusters), device)),
            },
            centers: xavier.init_with([dim, clusters], Some(clusters), Some(dim), device),
            normalise_input: self.normalise_input,
            form: self.form,
        }
    }
}

impl NetVlad {
    /// `batch × dim × n` features to unit descriptors, `batch × dim · clusters`.
    #[must_use]
    pub fn forward(&self, features: Tensor<3>) -> Tensor<2> {
        let features = if self.normalise_input { l2_normalize(features, 1) } else { features };
        let weight = self.score_proj.weight.val();
        let [clusters, dim, _] = weight.dims();
        let bias = self.score_proj.bias.as_ref().map(Param::val);
        let weight = weight.reshape([clusters, dim]).transpose();
        let scores = linear(features.clone().swap_dims(1, 2), weight, bias);
        let assignment = softmax(scores, 2).swap_dims(1, 2);
        vlad(features, assignment, self.centers.val(), self.form)
    }
}

/// NetVLAD with the keys and shapes of pytorch-NetVlad: `conv.weight` (clusters × dim × 1 × 1), `centroids` (clusters × dim).
///
/// Features are normalised first, and descriptors are cluster by cluster.
#[derive(Module, Debug)]
pub struct PytorchNetVlad {
    conv: crate::layer::Conv2d,
    centroids: Param<Tensor<2>>,
}

/// Configuration of [`PytorchNetVlad`].
#[derive(Config, Debug)]
pub struct PytorchNetVladConfig {
    /// Channels of the map.
    #[config(default = 512)]
    pub dim: usize,
    /// Number of clusters.
    #[config(default = 64)]
    pub clusters: usize,
    /// Whether scores have a bias (`vladv2`).
    #[config(default = false)]
    pub bias: bool,
}

impl PytorchNetVladConfig {
    /// The sizes of a checkpoint; `prefix` is what its keys begin with.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Weights`] or [`vpr_core::Error::Format`] if a key is missing or misshaped.
    pub fn from_weights(weights: &Weights, prefix: &str) -> Result<Self> {
        let shapes = Shapes::new(weights, prefix);
        Ok(Self {
            dim: shapes.axis("centroids", 1)?,
            clusters: shapes.axis("centroids", 0)?,
            bias: shapes.has("conv.bias"),
        })
    }

    /// A layer with random weights.
    #[must_use]
    pub fn init(&self, device: &Device) -> PytorchNetVlad {
        PytorchNetVlad {
            conv: crate::layer::Conv2dConfig::new([self.dim, self.clusters], [1, 1])
                .with_bias(self.bias)
                .init(device),
            centroids: Initializer::Uniform { min: 0.0, max: 1.0 }
                .init([self.clusters, self.dim], device),
        }
    }
}

impl PytorchNetVlad {
    /// `batch × dim × rows × columns` to unit descriptors, `batch × clusters · dim`.
    #[must_use]
    pub fn forward(&self, map: Tensor<4>) -> Tensor<2> {
        let map = l2_normalize(map, 1);
        let assignment = softmax(self.conv.forward(map.clone()).flatten::<3>(2, 3), 1);
        let form = VladForm { order: Order::ClusterMajor, ..VladForm::default() };
        vlad(map.flatten(2, 3), assignment, self.centroids.val().transpose(), form)
    }
}
