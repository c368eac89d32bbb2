//! CricaVPR: regions of an image that attend to the same regions of the other images in the batch.

use burn::config::Config;
use burn::module::Module;
use burn::tensor::{Device, Tensor};

use super::gem::{Gem, GemConfig};
use crate::Result;
use crate::layer::l2_normalize;
use crate::transformer::{Activation, EncoderLayer, EncoderLayerConfig};
use crate::weights::Shapes;
use crate::weights::Weights;

/// Where the official code cuts a 16×16 grid into halves, and into thirds.
const CUTS: [&[usize]; 2] = [&[0, 8], &[0, 5, 11]];

/// Fewest rows and columns of a map.
pub const SMALLEST_SIDE: usize = 12;

/// The class token and the regions: 1 + 4 + 9.
const TOKENS: usize = 14;

/// Lu et al., *CricaVPR: Cross-image Correlation-aware Representation Learning* (2024);
/// `Lu-Feng/CricaVPR`.
///
/// Attention runs over the batch, so a descriptor depends on which images it was computed with.
/// The result is therefore [`BatchDependent`], and with a batch of one it depends on nothing else.
#[derive(Module, Debug)]
pub struct CricaVpr {
    gem: Gem,
    encoder: Vec<EncoderLayer>,
}

/// Official keys to the fields of [`CricaVpr`].
const RENAMES: [(&str, &str); 2] =
    [(r"aggregation\.1\.p$", "gem.p"), (r"encoder\.layers\.", "encoder.")];

/// Descriptors that change with the other images of their batch.
#[derive(Clone, Debug)]
pub struct BatchDependent(Tensor<2>);

impl BatchDependent {
    /// The descriptors, knowing that they hold for this batch only.
    #[must_use]
    pub fn for_this_batch(self) -> Tensor<2> {
        self.0
    }
}

/// Weights with official keys, under the names of the fields of [`CricaVpr`].
///
/// # Errors
///
/// [`vpr_core::Error::Format`] if two keys become one.
pub fn from_official(weights: Weights) -> Result<Weights> {
    weights.renamed(&RENAMES)
}

/// Configuration of [`CricaVpr`].
#[derive(Config, Debug, PartialEq)]
pub struct CricaVprConfig {
    /// Length of a token.
    #[config(default = 768)]
    pub dim: usize,
    /// Attention heads.
    #[config(default = 16)]
    pub heads: usize,
    /// Width of the feed-forward blocks.
    #[config(default = 2048)]
    pub feed_forward: usize,
    /// Number of encoder layers.
    #[config(default = 2)]
    pub layers: usize,
    /// Dropout while training.
    #[config(default = 0.1)]
    pub dropout: f64,
}

impl CricaVprConfig {
    /// The sizes of a checkpoint, after [`from_official`] (the 16 heads are not in the weights); `prefix` is what its keys begin with.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Weights`] or [`vpr_core::Error::Format`] if a key is missing or misshaped.
    pub fn from_weights(weights: &Weights, prefix: &str) -> Result<Self> {
        let shapes = Shapes::new(weights, prefix);
        let linear1 = "encoder.0.linear1.weight";
        Ok(Self::new()
            .with_dim(shapes.axis(linear1, 1)?)
            .with_feed_forward(shapes.axis(linear1, 0)?)
            .with_layers(shapes.count(|index| format!("encoder.{index}.linear1.weight"))))
    }

    /// A head with random weights.
    #[must_use]
    pub fn init(&self, device: &Device) -> CricaVpr {
        let layer = EncoderLayerConfig::new(self.dim, self.heads, self.feed_forward)
            .with_activation(Activation::Gelu)
            .with_dropout(self.dropout);
        CricaVpr {
            gem: GemConfig::new().init(device),
            encoder: (0..self.layers).map(|_| layer.init(device)).collect(),
        }
    }

    /// Length of the descriptor.
    #[must_use]
    pub fn dimension(&self) -> usize {
        TOKENS * self.dim
    }
}

impl CricaVpr {
    /// Class tokens (`batch × dim`) and a square map (`batch × dim × side × side`, side 16 for
    /// 224 pixels, at least 12) to unit descriptors, `batch × 14 dim`.
    ///
    /// # Panics
    ///
    /// If the map has fewer than 12 rows or columns.
    #[must_use]
    pub fn forward(&self, class: Tensor<2>, map: Tensor<4>) -> BatchDependent {
        let [batch, dim] = class.dims();
        let mut tokens = vec![class];
        for cuts in CUTS {
            tokens.extend(self.regions(&map, cuts));
        }
        let x = Tensor::stack::<3>(tokens, 1);
        // The official encoder reads its second axis as the batch: each of the 14 tokens attends
        // to the same token of the other images.
        let x = self.encoder.iter().fold(x.swap_dims(0, 1), |x, layer| layer.forward(x));
        let descriptors = x.swap_dims(0, 1).reshape([batch, TOKENS * dim]);
        BatchDependent(l2_normalize(descriptors, 1))
    }

    /// The pooled regions between `cuts`, row by row.
    fn regions(&self, map: &Tensor<4>, cuts: &[usize]) -> Vec<Tensor<2>> {
        let [_, _, rows, columns] = map.dims();
        let last = cuts[cuts.len() - 1];
        assert!(
            rows > last && columns > last,
            "a map of {rows}×{columns} is too small for {cuts:?}"
        );
        let span = |index: usize, side: usize| {
            let end = cuts.get(index + 1).copied().unwrap_or(side);
            (cuts[index], end - cuts[index])
        };
        let mut pooled = Vec::with_capacity(cuts.len() * cuts.len());
        for row in 0..cuts.len() {
            let (top, height) = span(row, rows);
            for column in 0..cuts.len() {
                let (left, width) = span(column, columns);
                let region = map.clone().narrow(2, top, height).narrow(3, left, width);
                pooled.push(self.gem.forward(l2_normalize(region, 1)));
            }
        }
        pooled
    }
}
