//! The head of CosPlace and EigenPlaces: GeM and a linear layer between two normalisations.

use burn::config::Config;
use burn::module::Module;
use burn::nn::{Linear, LinearConfig};
use burn::tensor::{Device, Tensor};

use super::gem::{Gem, GemConfig};
use crate::Result;
use crate::layer::l2_normalize;
use crate::weights::Shapes;
use crate::weights::Weights;

/// Head of Berton et al., *Rethinking Visual Geo-localization for Large-Scale Applications* (2022)
/// and *EigenPlaces* (2023).
#[derive(Module, Debug)]
pub struct CosPlace {
    gem: Gem,
    fc: Linear,
}

/// Official keys (the head is a `Sequential`) to the fields of [`CosPlace`].
const RENAMES: [(&str, &str); 2] =
    [(r"^(.*\.)?1\.p$", "${1}gem.p"), (r"^(.*\.)?3\.(weight|bias)$", "${1}fc.$2")];

/// Weights with official keys, under the names of the fields of [`CosPlace`].
///
/// # Errors
///
/// [`vpr_core::Error::Format`] if two keys become one.
pub fn from_official(weights: Weights) -> Result<Weights> {
    weights.renamed(&RENAMES)
}

/// Configuration of [`CosPlace`].
#[derive(Config, Debug, PartialEq)]
pub struct CosPlaceConfig {
    /// Channels of the map.
    pub channels: usize,
    /// Length of the descriptor.
    pub dimension: usize,
}

impl CosPlaceConfig {
    /// The sizes of a checkpoint, after [`from_official`]; `prefix` is what its keys begin with.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Weights`] or [`vpr_core::Error::Format`] if a key is missing or misshaped.
    pub fn from_weights(weights: &Weights, prefix: &str) -> Result<Self> {
        let shapes = Shapes::new(weights, prefix);
        Ok(Self::new(shapes.axis("fc.weight", 1)?, shapes.axis("fc.weight", 0)?))
    }

    /// A head with random weights and p = 3.
    #[must_use]
    pub fn init(&self, device: &Device) -> CosPlace {
        CosPlace {
            gem: GemConfig::new().init(device),
            fc: LinearConfig::new(self.channels, self.dimension).init(device),
        }
    }
}

impl CosPlace {
    /// `batch × channels × rows × columns` to unit descriptors, `batch × dimension`.
    #[must_use]
    pub fn forward(&self, map: Tensor<4>) -> Tensor<2> {
        let pooled = self.gem.forward(l2_normalize(map, 1));
        l2_normalize(self.fc.forward(pooled), 1)
    }
}
