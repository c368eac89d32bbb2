//! Attention and the encoder layer, with the parameters and the arithmetic of `torch.nn`.

use burn::config::Config;
use burn::module::{Initializer, Module, Param};
use burn::nn::{Dropout, DropoutConfig, LayerNorm, LayerNormConfig, Linear, LinearConfig};
use burn::tensor::activation::{gelu, relu, softmax};
use burn::tensor::module::{attention, linear};
use burn::tensor::ops::AttentionModuleOptions;
use burn::tensor::{Device, Tensor};
use serde::{Deserialize, Serialize};

/// Multi-head attention with the parameters of `torch.nn.MultiheadAttention` (`batch_first`).
#[derive(Module, Debug)]
pub struct MultiheadAttention {
    /// Query, key and value projections above each other, `3 dim × dim`.
    in_proj_weight: Param<Tensor<2>>,
    /// Their biases, `3 dim`.
    in_proj_bias: Param<Tensor<1>>,
    /// Projection of the joined heads.
    out_proj: Linear,
    heads: usize,
}

/// Configuration of [`MultiheadAttention`].
#[derive(Config, Debug)]
pub struct MultiheadAttentionConfig {
    /// Length of every token.
    pub dim: usize,
    /// Number of heads; divides `dim`.
    pub heads: usize,
}

impl MultiheadAttentionConfig {
    /// A module with random weights (Xavier uniform, biases zero, as torch).
    #[must_use]
    pub fn init(&self, device: &Device) -> MultiheadAttention {
        let (dim, xavier) = (self.dim, Initializer::XavierUniform { gain: 1.0 });
        MultiheadAttention {
            in_proj_weight: xavier.init_with([3 * dim, dim], Some(dim), Some(3 * dim), device),
            in_proj_bias: Initializer::Zeros.init([3 * dim], device),
            out_proj: LinearConfig::new(dim, dim).init(device),
            heads: self.heads,
        }
    }
}

impl MultiheadAttention {
    /// Attends from `query` to `memory`, which serves as key and value.
    ///
    /// Shapes: query `batch × m × dim`, memory `batch × n × dim`; result as the query.
    #[must_use]
    pub fn forward(&self, query: Tensor<3>, memory: Tensor<3>) -> Tensor<3> {
        let (query, key, value) = self.projected(query, memory);
        let heads = attention(query, key, value, None, None, AttentionModuleOptions::default());
        self.joined(heads)
    }

    /// As [`forward`](Self::forward), with the attention weights averaged over the heads, `batch × m × n`.
    #[must_use]
    pub fn forward_with_weights(
        &self,
        query: Tensor<3>,
        memory: Tensor<3>,
    ) -> (Tensor<3>, Tensor<3>) {
        let (query, key, value) = self.projected(query, memory);
        let scale = 1.0 / (query.dims()[3] as f64).sqrt();
        let weights = softmax(query.mul_scalar(scale).matmul(key.swap_dims(2, 3)), 3);
        let mean = weights.clone().mean_dim(1).squeeze_dim(1);
        (self.joined(weights.matmul(value)), mean)
    }

    /// Query, key and value, each `batch × heads × tokens × dim / heads`.
    fn projected(&self, query: Tensor<3>, memory: Tensor<3>) -> (Tensor<4>, Tensor<4>, Tensor<4>) {
        let dim = self.in_proj_weight.dims()[1];
        let (weight, bias) = (self.in_proj_weight.val(), self.in_proj_bias.val());
        let part = |x: Tensor<3>, first: usize, count: usize| {
            let weight = weight.clone().narrow(0, first * dim, count * dim).transpose();
            linear(x, weight, Some(bias.clone().narrow(0, first * dim, count * dim)))
        };
        let query = self.split(part(query, 0, 1));
        let both = part(memory, 1, 2);
        let key = self.split(both.clone().narrow(2, 0, dim));
        let value = self.split(both.narrow(2, dim, dim));
        (query, key, value)
    }

    fn split(&self, x: Tensor<3>) -> Tensor<4> {
        let [batch, tokens, dim] = x.dims();
        x.reshape([batch, tokens, self.heads, dim / self.heads]).swap_dims(1, 2)
    }

    fn joined(&self, heads: Tensor<4>) -> Tensor<3> {
        let [batch, count, tokens, size] = heads.dims();
        self.out_proj.forward(heads.swap_dims(1, 2).reshape([batch, tokens, count * size]))
    }
}

/// The activation between the two layers of a feed-forward block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Activation {
    /// max(x, 0).
    Relu,
    /// x Φ(x), by the error function.
    Gelu,
}

/// One encoder layer, normalised after each residual, as `torch.nn.TransformerEncoderLayer`.
#[derive(Module, Debug)]
pub struct EncoderLayer {
    self_attn: MultiheadAttention,
    linear1: Linear,
    linear2: Linear,
    norm1: LayerNorm,
    norm2: LayerNorm,
    dropout: Dropout,
    #[module(skip)]
    activation: Activation,
}

/// Configuration of [`EncoderLayer`].
#[derive(Config, Debug)]
pub struct EncoderLayerConfig {
    /// Length of every token.
    pub dim: usize,
    /// Number of attention heads.
    pub heads: usize,
    /// Width of the feed-forward block.
    pub feed_forward: usize,
    /// Its activation.
    #[config(default = "Activation::Relu")]
    pub activation: Activation,
    /// Dropout while training, after attention and in the feed-forward block.
    #[config(default = 0.0)]
    pub dropout: f64,
}

impl EncoderLayerConfig {
    /// A layer with random weights.
    #[must_use]
    pub fn init(&self, device: &Device) -> EncoderLayer {
        EncoderLayer {
            self_attn: MultiheadAttentionConfig::new(self.dim, self.heads).init(device),
            linear1: LinearConfig::new(self.dim, self.feed_forward).init(device),
            linear2: LinearConfig::new(self.feed_forward, self.dim).init(device),
            norm1: LayerNormConfig::new(self.dim).init(device),
            norm2: LayerNormConfig::new(self.dim).init(device),
            dropout: DropoutConfig::new(self.dropout).init(),
            activation: self.activation,
        }
    }
}

impl EncoderLayer {
    /// Encodes `batch × tokens × dim`; the shape stays.
    #[must_use]
    pub fn forward(&self, x: Tensor<3>) -> Tensor<3> {
        let attended = self.self_attn.forward(x.clone(), x.clone());
        let x = self.norm1.forward(x + self.dropout.forward(attended));
        let inner = self.linear1.forward(x.clone());
        let inner = match self.activation {
            Activation::Relu => relu(inner),
            Activation::Gelu => gelu(inner),
        };
        let inner = self.linear2.forward(self.dropout.forward(inner));
        self.norm2.forward(x + self.dropout.forward(inner))
    }
}
