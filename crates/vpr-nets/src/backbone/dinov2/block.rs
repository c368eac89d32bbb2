//! The transformer block of DINOv2: attention and feed-forward, each scaled and added.

use burn::module::{Initializer, Module, Param};
use burn::nn::{LayerNorm, LayerNormConfig, Linear, LinearConfig};
use burn::tensor::activation::gelu;
use burn::tensor::module::attention;
use burn::tensor::ops::AttentionModuleOptions;
use burn::tensor::{Device, Tensor};

use super::{DinoV2Config, NORM_EPSILON};
use crate::layer::memory::{InMemory, tensor};
use crate::layer::one_pass::{self, Affine};
use crate::layer::{self, Heads};

/// One block; tokens `batch × n × dim` keep their shape.
#[derive(Module, Debug)]
pub struct Block {
    norm1: LayerNorm,
    attn: Attention,
    ls1: LayerScale,
    norm2: LayerNorm,
    mlp: Mlp,
    ls2: LayerScale,
}

impl Block {
    pub(super) fn new(config: &DinoV2Config, device: &Device) -> Self {
        let dim = config.dim;
        let norm = LayerNormConfig::new(dim).with_epsilon(NORM_EPSILON.into());
        Self {
            norm1: norm.init(device),
            attn: Attention {
                qkv: LinearConfig::new(dim, 3 * dim).init(device),
                proj: LinearConfig::new(dim, dim).init(device),
                heads: config.heads,
            },
            ls1: LayerScale::new(dim, device),
            norm2: norm.init(device),
            mlp: Mlp {
                fc1: LinearConfig::new(dim, config.hidden).init(device),
                fc2: LinearConfig::new(config.hidden, dim).init(device),
            },
            ls2: LayerScale::new(dim, device),
        }
    }

    pub(super) fn forward(&self, x: Tensor<3>) -> Tensor<3> {
        let attended = self.attn.forward(self.norm1.forward(x.clone()));
        let x = x + self.ls1.forward(attended);
        let fed = self.mlp.forward(self.norm2.forward(x.clone()));
        x + self.ls2.forward(fed)
    }
}

/// Runs all blocks where nothing records gradients and tensors lie in memory; `None` elsewhere.
///
/// The same arithmetic as [`Block::forward`] with fewer passes: biases, scales and residuals are
/// taken along where values are read anyway.
pub(super) fn run_in_memory(blocks: &[Block], x: &Tensor<3>) -> Option<Tensor<3>> {
    let shape = x.dims();
    let mut x = InMemory::new(x)?.values().to_vec();
    let parameters: Vec<_> = blocks.iter().map(Block::in_memory).collect::<Option<_>>()?;
    for (block, parameters) in blocks.iter().zip(&parameters) {
        block.step(parameters, &mut x, shape)?;
    }
    Some(tensor(x, shape, &blocks.first()?.attn.qkv.weight.val().device()))
}

/// The parameters of a block that are no matrices.
struct Vectors {
    norm1: [InMemory; 2],
    qkv_bias: InMemory,
    proj_bias: InMemory,
    ls1: InMemory,
    norm2: [InMemory; 2],
    fc1_bias: InMemory,
    fc2_bias: InMemory,
    ls2: InMemory,
}

impl Block {
    fn in_memory(&self) -> Option<Vectors> {
        let vector = |param: &Param<Tensor<1>>| InMemory::new(&param.val());
        let norm = |norm: &LayerNorm| Some([vector(&norm.gamma)?, vector(norm.beta.as_ref()?)?]);
        let bias = |layer: &Linear| vector(layer.bias.as_ref()?);
        Some(Vectors {
            norm1: norm(&self.norm1)?,
            qkv_bias: bias(&self.attn.qkv)?,
            proj_bias: bias(&self.attn.proj)?,
            ls1: vector(&self.ls1.gamma)?,
            norm2: norm(&self.norm2)?,
            fc1_bias: bias(&self.mlp.fc1)?,
            fc2_bias: bias(&self.mlp.fc2)?,
            ls2: vector(&self.ls2.gamma)?,
        })
    }

    /// One block on the tokens `x`, a row of `dim` values each.
    fn step(&self, own: &Vectors, x: &mut [f32], [batch, tokens, dim]: [usize; 3]) -> Option<()> {
        let normed = one_pass::layer_norm(x, affine(&own.norm1));
        let qkv = product(&normed, &self.attn.qkv)?;
        let count = self.attn.heads;
        let heads = Heads { batch, tokens, count, size: dim / count };
        let attended = layer::attend(&qkv, own.qkv_bias.values(), heads);
        let attended = product(&attended, &self.attn.proj)?;
        one_pass::add_scaled_in_place(x, &attended, own.proj_bias.values(), own.ls1.values());

        let normed = one_pass::layer_norm(x, affine(&own.norm2));
        let inner = product(&normed, &self.mlp.fc1)?;
        let inner = one_pass::gelu(&inner, own.fc1_bias.values());
        let outer = product(&inner, &self.mlp.fc2)?;
        one_pass::add_scaled_in_place(x, &outer, own.fc2_bias.values(), own.ls2.values());
        Some(())
    }
}

fn affine(norm: &[InMemory; 2]) -> Affine<'_> {
    let [gamma, beta] = norm;
    Affine { gamma: gamma.values(), beta: beta.values(), epsilon: NORM_EPSILON }
}

/// Rows times the weights of a linear layer, without its bias.
fn product(rows: &[f32], linear: &Linear) -> Option<Vec<f32>> {
    let weight = linear.weight.val();
    let [depth, _] = weight.dims();
    Some(layer::product(rows, InMemory::new(&weight)?.values(), depth))
}

/// Self-attention with one projection for queries, keys and values.
#[derive(Module, Debug)]
struct Attention {
    qkv: Linear,
    proj: Linear,
    heads: usize,
}

impl Attention {
    fn forward(&self, x: Tensor<3>) -> Tensor<3> {
        let [batch, tokens, dim] = x.dims();
        let qkv = self.qkv.forward(x).reshape([batch, tokens, 3 * self.heads, dim / self.heads]);
        let part =
            |index: usize| qkv.clone().narrow(2, index * self.heads, self.heads).swap_dims(1, 2);
        let heads =
            attention(part(0), part(1), part(2), None, None, AttentionModuleOptions::default());
        self.proj.forward(heads.swap_dims(1, 2).reshape([batch, tokens, dim]))
    }
}

/// Two linear layers with GELU between.
#[derive(Module, Debug)]
struct Mlp {
    fc1: Linear,
    fc2: Linear,
}

impl Mlp {
    fn forward(&self, x: Tensor<3>) -> Tensor<3> {
        self.fc2.forward(gelu(self.fc1.forward(x)))
    }
}

/// A learned factor per channel.
#[derive(Module, Debug)]
struct LayerScale {
    gamma: Param<Tensor<1>>,
}

impl LayerScale {
    fn new(dim: usize, device: &Device) -> Self {
        Self { gamma: Initializer::Ones.init([dim], device) }
    }

    fn forward(&self, x: Tensor<3>) -> Tensor<3> {
        x * self.gamma.val().unsqueeze()
    }
}
