//! BoQ: learned queries that attend to the features of an image.

use burn::config::Config;
use burn::module::{Initializer, Module, Param};
use burn::nn::{LayerNorm, LayerNormConfig, Linear, LinearConfig};
use burn::tensor::{Device, Tensor};

use crate::Result;
use crate::layer::l2_normalize;
use crate::layer::{Conv2d, Conv2dConfig};
use crate::transformer::{
    EncoderLayer, EncoderLayerConfig, MultiheadAttention, MultiheadAttentionConfig,
};
use crate::weights::Shapes;
use crate::weights::Weights;

/// Channels of an attention head in every published network.
const HEAD: usize = 64;

/// Ali-bey et al., *BoQ: A Place is Worth a Bag of Learnable Queries* (2024);
/// `amaralibey/Bag-of-Queries`.
#[derive(Module, Debug)]
pub struct Boq {
    proj_c: Conv2d,
    norm_input: LayerNorm,
    boqs: Vec<BoqBlock>,
    fc: Linear,
}

/// Configuration of [`Boq`].
#[derive(Config, Debug, PartialEq)]
pub struct BoqConfig {
    /// Channels of the map: 1024 (ResNet-50 to layer3) or 768 (ViT-B/14).
    pub channels: usize,
    /// Channels of queries and features: 512 or 384.
    #[config(default = 512)]
    pub projected: usize,
    /// Queries per block.
    #[config(default = 64)]
    pub queries: usize,
    /// Number of blocks.
    #[config(default = 2)]
    pub layers: usize,
    /// Rows of the descriptor.
    #[config(default = 32)]
    pub rows: usize,
}

impl BoqConfig {
    /// The sizes of a checkpoint; `prefix` is what its keys begin with.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Weights`] or [`vpr_core::Error::Format`] if a key is missing or misshaped.
    pub fn from_weights(weights: &Weights, prefix: &str) -> Result<Self> {
        let shapes = Shapes::new(weights, prefix);
        let queries = |index| format!("boqs.{index}.queries");
        Ok(Self {
            channels: shapes.axis("proj_c.weight", 1)?,
            projected: shapes.axis("proj_c.weight", 0)?,
            queries: shapes.axis(&queries(0), 1)?,
            layers: shapes.count(queries),
            rows: shapes.axis("fc.weight", 0)?,
        })
    }

    /// A head with random weights.
    #[must_use]
    pub fn init(&self, device: &Device) -> Boq {
        let dim = self.projected;
        let heads = (dim / HEAD).max(1);
        let attention = MultiheadAttentionConfig::new(dim, heads);
        let block = |_| BoqBlock {
            encoder: EncoderLayerConfig::new(dim, heads, 4 * dim).init(device),
            queries: Initializer::Normal { mean: 0.0, std: 1.0 }
                .init([1, self.queries, dim], device),
            self_attn: attention.init(device),
            norm_q: LayerNormConfig::new(dim).init(device),
            cross_attn: attention.init(device),
            norm_out: LayerNormConfig::new(dim).init(device),
        };
        Boq {
            proj_c: Conv2dConfig::new([self.channels, dim], [3, 3])
                .with_padding(burn::nn::PaddingConfig2d::Explicit(1, 1, 1, 1))
                .init(device),
            norm_input: LayerNormConfig::new(dim).init(device),
            boqs: (0..self.layers).map(block).collect(),
            fc: LinearConfig::new(self.layers * self.queries, self.rows).init(device),
        }
    }

    /// Length of the descriptor.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.projected * self.rows
    }
}

impl Boq {
    /// `batch × channels × rows × columns` to unit descriptors, `batch × projected · rows`.
    #[must_use]
    pub fn forward(&self, map: Tensor<4>) -> Tensor<2> {
        let mut x = self.embedded(map);
        let mut outputs = Vec::with_capacity(self.boqs.len());
        for block in &self.boqs {
            x = block.encoder.forward(x);
            let output = block.cross_attn.forward(block.queries(x.dims()[0]), x.clone());
            outputs.push(block.norm_out.forward(output));
        }
        self.descriptor(outputs)
    }

    /// As [`forward`](Self::forward), with one attention map per block, `batch × queries × positions`:
    /// where each query looks, averaged over the heads.
    #[must_use]
    pub fn forward_with_attention(&self, map: Tensor<4>) -> (Tensor<2>, Vec<Tensor<3>>) {
        let mut x = self.embedded(map);
        let (mut outputs, mut attentions) = (Vec::new(), Vec::new());
        for block in &self.boqs {
            x = block.encoder.forward(x);
            let queries = block.queries(x.dims()[0]);
            let (output, weights) = block.cross_attn.forward_with_weights(queries, x.clone());
            outputs.push(block.norm_out.forward(output));
            attentions.push(weights);
        }
        (self.descriptor(outputs), attentions)
    }

    fn embedded(&self, map: Tensor<4>) -> Tensor<3> {
        let x = self.proj_c.forward(map).flatten(2, 3);
        self.norm_input.forward(x.swap_dims(1, 2))
    }

    fn descriptor(&self, outputs: Vec<Tensor<3>>) -> Tensor<2> {
        let x = Tensor::cat(outputs, 1).swap_dims(1, 2);
        l2_normalize(self.fc.forward(x).flatten(1, 2), 1)
    }
}

/// One bag of queries behind an encoder layer.
#[derive(Module, Debug)]
struct BoqBlock {
    encoder: EncoderLayer,
    queries: Param<Tensor<3>>,
    self_attn: MultiheadAttention,
    norm_q: LayerNorm,
    cross_attn: MultiheadAttention,
    norm_out: LayerNorm,
}

impl BoqBlock {
    /// The queries after attending to each other; the same for every image, so computed once.
    fn queries(&self, batch: usize) -> Tensor<3> {
        let queries = self.queries.val();
        let [_, count, dim] = queries.dims();
        let attended = self.self_attn.forward(queries.clone(), queries.clone());
        self.norm_q.forward(queries + attended).expand([batch, count, dim])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loss::check::{head_gradient, unit_rows};

    #[test]
    fn its_gradient_is_that_of_finite_differences() {
        let config = BoqConfig::new(5).with_projected(16).with_queries(4).with_rows(3);
        let head = config.init(&Device::flex().autodiff());
        head_gradient(head, unit_rows(12, 5, 1), |head, rows| {
            head.forward(rows.transpose().reshape([1, 5, 3, 4]))
        });
    }
}
