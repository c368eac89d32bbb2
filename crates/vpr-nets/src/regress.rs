//! CoPR's descriptor regressor: the descriptor at a relative pose from an anchor.

use burn::config::Config;
use burn::module::Module;
use burn::nn::{Linear, LinearConfig};
use burn::tensor::{Device, Tensor};

use crate::Result;
use crate::layer::{dense, dense_gelu};
use crate::weights::Shapes;
use crate::weights::Weights;

/// Values of a relative pose: tx, ty, tz, qw, qx, qy, qz.
pub const RELATIVE_POSE: usize = 7;

/// The multi-layer perceptron H of Zaffar et al., *CoPR: Toward Accurate Visual Localization With
/// Continuous Place-Descriptor Regression* (2023); `MubarizZaffar/CoPR_TRO2023`, keys `net_regdesc.*`.
#[derive(Module, Debug)]
pub struct DescriptorRegressor {
    net_regdesc: Vec<Linear>,
}

/// Weights with official keys, under the names of the fields of [`DescriptorRegressor`].
#[must_use]
pub fn from_official(weights: Weights) -> Weights {
    // The official `Sequential` counts activations too: 0, 2, 4, … are the linear layers.
    let layer = |part: &str| match part.parse::<usize>() {
        Ok(index) if index % 2 == 0 => (index / 2).to_string(),
        _ => part.to_owned(),
    };
    let renamed = |key: String, tensor| {
        let parts: Vec<_> = key.split('.').map(layer).collect();
        Some((parts.join("."), tensor))
    };
    weights.mapped(renamed)
}

/// Configuration of [`DescriptorRegressor`].
#[derive(Config, Debug, PartialEq)]
pub struct DescriptorRegressorConfig {
    /// Length of a descriptor: 512 in the thesis.
    pub dimension: usize,
    /// Hidden layers, each of `dimension` + 7 values.
    #[config(default = 7)]
    pub hidden_layers: usize,
}

impl DescriptorRegressorConfig {
    /// The sizes of a checkpoint, after [`from_official`]; `prefix` is what its keys begin with.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Weights`] or [`vpr_core::Error::Format`] if a key is missing or misshaped.
    pub fn from_weights(weights: &Weights, prefix: &str) -> Result<Self> {
        let shapes = Shapes::new(weights, prefix);
        let layers = shapes.count(|layer| format!("net_regdesc.{layer}.weight"));
        let last = format!("net_regdesc.{}.weight", layers.saturating_sub(1));
        Ok(Self { dimension: shapes.axis(&last, 0)?, hidden_layers: layers - 1 })
    }

    /// A network with random weights.
    #[must_use]
    pub fn init(&self, device: &Device) -> DescriptorRegressor {
        let width = self.dimension + RELATIVE_POSE;
        let hidden = LinearConfig::new(width, width);
        let output = LinearConfig::new(width, self.dimension);
        let mut net_regdesc: Vec<_> =
            (0..self.hidden_layers).map(|_| hidden.init(device)).collect();
        net_regdesc.push(output.init(device));
        DescriptorRegressor { net_regdesc }
    }
}

impl DescriptorRegressor {
    /// Regresses descriptors (`batch × dimension`) from those of anchors (same shape) and the pose
    /// relative to each anchor (`batch × 7`). The result is not normalised, as released (C-1).
    ///
    /// # Panics
    ///
    /// If the shapes do not fit.
    #[must_use]
    pub fn forward(&self, anchor: Tensor<2>, relative_pose: Tensor<2>) -> Tensor<2> {
        let x = Tensor::cat(vec![anchor, relative_pose], 1);
        let (output, hidden) = self.net_regdesc.split_last().expect("an output layer");
        let x = hidden.iter().fold(x, |x, layer| dense_gelu(layer, x));
        dense(output, x)
    }
}
