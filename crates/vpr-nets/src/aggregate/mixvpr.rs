//! MixVPR: multi-layer perceptrons over the positions of a map.

use burn::config::Config;
use burn::module::Module;
use burn::nn::{LayerNorm, LayerNormConfig, Linear, LinearConfig};
use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor};

use crate::Result;
use crate::layer::l2_normalize;
use crate::weights::Shapes;
use crate::weights::Weights;

/// Ali-bey et al., *MixVPR: Feature Mixing for Visual Place Recognition* (2023); `amaralibey/MixVPR`.
///
/// The number of positions is part of the weights: an image of another size needs another network.
#[derive(Module, Debug)]
pub struct MixVpr {
    mix: Vec<Mixer>,
    channel_proj: Linear,
    row_proj: Linear,
}

/// Official keys (each mixer is a `Sequential`) to the fields of [`MixVpr`].
const RENAMES: [(&str, &str); 3] = [
    (r"mix\.(\d+)\.mix\.0\.", "mix.$1.norm."),
    (r"mix\.(\d+)\.mix\.1\.", "mix.$1.inner."),
    (r"mix\.(\d+)\.mix\.3\.", "mix.$1.outer."),
];

/// Weights with official keys, under the names of the fields of [`MixVpr`].
///
/// # Errors
///
/// [`vpr_core::Error::Format`] if two keys become one.
pub fn from_official(weights: Weights) -> Result<Weights> {
    weights.renamed(&RENAMES)
}

/// Configuration of [`MixVpr`].
#[derive(Config, Debug, PartialEq)]
pub struct MixVprConfig {
    /// Channels of the map.
    pub channels: usize,
    /// Positions of the map: rows · columns.
    pub positions: usize,
    /// Channels of the descriptor.
    pub out_channels: usize,
    /// Rows of the descriptor.
    #[config(default = 4)]
    pub out_rows: usize,
    /// Number of mixers.
    #[config(default = 4)]
    pub depth: usize,
    /// Width of a mixer's inner layer; `positions` if absent.
    #[config(default = "None")]
    pub inner: Option<usize>,
}

impl MixVprConfig {
    /// The sizes of a checkpoint, after [`from_official`]; `prefix` is what its keys begin with.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Weights`] or [`vpr_core::Error::Format`] if a key is missing or misshaped.
    pub fn from_weights(weights: &Weights, prefix: &str) -> Result<Self> {
        let shapes = Shapes::new(weights, prefix);
        Ok(Self {
            channels: shapes.axis("channel_proj.weight", 1)?,
            positions: shapes.axis("row_proj.weight", 1)?,
            out_channels: shapes.axis("channel_proj.weight", 0)?,
            out_rows: shapes.axis("row_proj.weight", 0)?,
            depth: shapes.count(|index| format!("mix.{index}.norm.weight")),
            inner: Some(shapes.axis("mix.0.inner.weight", 0)?),
        })
    }

    /// A head with random weights.
    #[must_use]
    pub fn init(&self, device: &Device) -> MixVpr {
        let positions = self.positions;
        let inner = self.inner.unwrap_or(positions);
        let mixer = |_| Mixer {
            norm: LayerNormConfig::new(positions).init(device),
            inner: LinearConfig::new(positions, inner).init(device),
            outer: LinearConfig::new(inner, positions).init(device),
        };
        MixVpr {
            mix: (0..self.depth).map(mixer).collect(),
            channel_proj: LinearConfig::new(self.channels, self.out_channels).init(device),
            row_proj: LinearConfig::new(positions, self.out_rows).init(device),
        }
    }
}

impl MixVpr {
    /// `batch × channels × rows × columns` to unit descriptors, `batch × out_channels · out_rows`.
    #[must_use]
    pub fn forward(&self, map: Tensor<4>) -> Tensor<2> {
        let x = self.mix.iter().fold(map.flatten(2, 3), |x, mixer| mixer.forward(x));
        let x = self.channel_proj.forward(x.swap_dims(1, 2));
        let x = self.row_proj.forward(x.swap_dims(1, 2));
        l2_normalize(x.flatten(1, 2), 1)
    }
}

impl MixVpr {
    /// Positions of the map that the weights are for.
    #[must_use]
    pub fn positions(&self) -> usize {
        self.row_proj.weight.dims()[0]
    }
}

/// One residual perceptron over positions.
#[derive(Module, Debug)]
struct Mixer {
    norm: LayerNorm,
    inner: Linear,
    outer: Linear,
}

impl Mixer {
    fn forward(&self, x: Tensor<3>) -> Tensor<3> {
        let inner = relu(self.inner.forward(self.norm.forward(x.clone())));
        x + self.outer.forward(inner)
    }
}
