//! ConvAP: a 1×1 convolution and average pooling over a coarse grid.

use burn::config::Config;
use burn::module::Module;
use burn::tensor::module::adaptive_avg_pool2d;
use burn::tensor::{Device, Tensor};

use crate::Result;
use crate::layer::l2_normalize;
use crate::layer::{Conv2d, Conv2dConfig};
use crate::weights::Shapes;
use crate::weights::Weights;

/// Ali-bey et al., *GSV-Cities: Toward Appropriate Supervised Visual Place Recognition* (2022);
/// keys of `amaralibey/gsv-cities`.
#[derive(Module, Debug)]
pub struct ConvAp {
    channel_pool: Conv2d,
    cells: [usize; 2],
}

/// Configuration of [`ConvAp`].
#[derive(Config, Debug, PartialEq)]
pub struct ConvApConfig {
    /// Channels of the map.
    pub channels: usize,
    /// Channels after the convolution.
    #[config(default = 512)]
    pub reduced: usize,
    /// Rows and columns of the grid that is averaged over.
    #[config(default = "[2, 2]")]
    pub cells: [usize; 2],
}

impl ConvApConfig {
    /// The sizes of a checkpoint (its grid is not in the weights; every published one has 2×2 cells); `prefix` is what its keys begin with.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Weights`] or [`vpr_core::Error::Format`] if a key is missing or misshaped.
    pub fn from_weights(weights: &Weights, prefix: &str) -> Result<Self> {
        let shapes = Shapes::new(weights, prefix);
        let reduced = shapes.axis("channel_pool.weight", 0)?;
        Ok(Self::new(shapes.axis("channel_pool.weight", 1)?).with_reduced(reduced))
    }

    /// A head with random weights.
    #[must_use]
    pub fn init(&self, device: &Device) -> ConvAp {
        ConvAp {
            channel_pool: Conv2dConfig::new([self.channels, self.reduced], [1, 1]).init(device),
            cells: self.cells,
        }
    }
}

impl ConvAp {
    /// `batch × channels × rows × columns` to unit descriptors, `batch × reduced · cells`.
    #[must_use]
    pub fn forward(&self, map: Tensor<4>) -> Tensor<2> {
        let pooled = adaptive_avg_pool2d(self.channel_pool.forward(map), self.cells);
        l2_normalize(pooled.flatten(1, 3), 1)
    }
}
