//! DINOv2 vision transformers, with and without registers.
//!
//! Oquab et al., *DINOv2: Learning Robust Visual Features without Supervision* (2023); Darcet et
//! al., *Vision Transformers Need Registers* (2023). Parameters carry the keys of
//! `facebookresearch/dinov2` (`dinov2_vits14_pretrain.pth`, …).

mod block;
mod position;

use burn::config::Config;
use burn::module::{Initializer, Module, Param};
use burn::nn::{LayerNorm, LayerNormConfig};
use burn::tensor::module::linear;
use burn::tensor::{Device, Tensor};

pub use self::block::Block;
pub use self::position::Interpolation;
use crate::Result;
use crate::layer::{Conv2d, Conv2dConfig};
use crate::weights::Shapes;
use crate::weights::Weights;

const NORM_EPSILON: f32 = 1e-6;

/// Channels of an attention head in every published network.
const HEAD: usize = 64;

/// Side of a patch in pixels.
pub const PATCH: usize = 14;

/// Sizes and variant of a [`DinoV2`].
#[derive(Config, Debug, PartialEq)]
pub struct DinoV2Config {
    /// Length of a token: 384, 768 or 1024.
    pub dim: usize,
    /// Number of blocks: 12, 12 or 24.
    pub depth: usize,
    /// Attention heads; every published model has 64 channels a head.
    pub heads: usize,
    /// Width of the feed-forward blocks: 4 `dim`.
    pub hidden: usize,
    /// Register tokens: 0 or 4.
    #[config(default = 0)]
    pub registers: usize,
    /// Side of the grid that position embeddings were trained on: 37 (518 pixels).
    #[config(default = 37)]
    pub grid: usize,
    /// Side of a patch in pixels.
    #[config(default = "PATCH")]
    pub patch: usize,
    /// Whether there are weights of the final norm; checkpoints that do not use it may lack them.
    #[config(default = true)]
    pub final_norm: bool,
}

impl DinoV2Config {
    /// The sizes of a checkpoint; `prefix` is what its keys begin with.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Weights`] or [`vpr_core::Error::Format`] if a key is missing or misshaped.
    ///
    /// The number of heads is not in the weights: one per 64 channels, as in every published network.
    pub fn from_weights(weights: &Weights, prefix: &str) -> Result<Self> {
        let shapes = Shapes::new(weights, prefix);
        let dim = shapes.axis("cls_token", 2)?;
        let registers = shapes.has("register_tokens");
        let positions = shapes.axis("pos_embed", 1)?.saturating_sub(1);
        Ok(Self {
            dim,
            depth: shapes.count(|index| format!("blocks.{index}.norm1.weight")),
            heads: (dim / HEAD).max(1),
            hidden: shapes.axis("blocks.0.mlp.fc1.weight", 0)?,
            registers: if registers { shapes.axis("register_tokens", 1)? } else { 0 },
            grid: shapes.side("pos_embed", positions)?,
            patch: shapes.axis("patch_embed.proj.weight", 2)?,
            final_norm: shapes.has("norm.weight"),
        })
    }

    /// ViT-S/14: 384 channels, 12 blocks.
    #[must_use]
    pub fn small() -> Self {
        Self::new(384, 12, 6, 4 * 384)
    }

    /// ViT-B/14: 768 channels, 12 blocks.
    #[must_use]
    pub fn base() -> Self {
        Self::new(768, 12, 12, 4 * 768)
    }

    /// ViT-L/14: 1024 channels, 24 blocks.
    #[must_use]
    pub fn large() -> Self {
        Self::new(1024, 24, 16, 4 * 1024)
    }

    /// How position embeddings are resampled: the official models with registers differ from those without.
    #[must_use]
    pub fn interpolation(&self) -> Interpolation {
        if self.registers == 0 { Interpolation::PLAIN } else { Interpolation::REGISTERS }
    }

    /// A network with random weights.
    #[must_use]
    pub fn init(&self, device: &Device) -> DinoV2 {
        let (dim, patch) = (self.dim, self.patch);
        let normal = |std| Initializer::Normal { mean: 0.0, std };
        let registers =
            (self.registers > 0).then(|| normal(1e-6).init([1, self.registers, dim], device));
        let norm = LayerNormConfig::new(dim).with_epsilon(NORM_EPSILON.into());
        DinoV2 {
            cls_token: normal(1e-6).init([1, 1, dim], device),
            pos_embed: normal(0.02).init([1, 1 + self.grid * self.grid, dim], device),
            register_tokens: registers,
            mask_token: Initializer::Zeros.init([1, dim], device),
            patch_embed: PatchEmbedding {
                proj: Conv2dConfig::new([3, dim], [patch, patch])
                    .with_stride([patch, patch])
                    .init(device),
            },
            blocks: (0..self.depth).map(|_| Block::new(self, device)).collect(),
            norm: self.final_norm.then(|| norm.init(device)),
            interpolation: self.interpolation(),
        }
    }
}

/// A DINOv2 vision transformer.
#[derive(Module, Debug)]
pub struct DinoV2 {
    cls_token: Param<Tensor<3>>,
    pos_embed: Param<Tensor<3>>,
    register_tokens: Option<Param<Tensor<3>>>,
    /// Stands for hidden patches in pre-training; kept so that checkpoints load whole.
    mask_token: Param<Tensor<2>>,
    patch_embed: PatchEmbedding,
    blocks: Vec<Block>,
    norm: Option<LayerNorm>,
    #[module(skip)]
    interpolation: Interpolation,
}

/// The tokens of the last block.
#[derive(Clone, Debug)]
pub struct Tokens {
    /// The class token, `batch × dim`.
    pub class: Tensor<2>,
    /// The register tokens, `batch × registers × dim` (`registers` may be 0).
    pub registers: Option<Tensor<3>>,
    /// One token per patch, row by row, `batch × rows·columns × dim`.
    pub patches: Tensor<3>,
    /// Rows and columns of patches.
    pub grid: [usize; 2],
}

impl Tokens {
    /// The patches as a map, `batch × dim × rows × columns`.
    #[must_use]
    pub fn map(self) -> Tensor<4> {
        let [batch, _, dim] = self.patches.dims();
        let [rows, columns] = self.grid;
        self.patches.swap_dims(1, 2).reshape([batch, dim, rows, columns])
    }
}

impl DinoV2 {
    /// Replaces the way position embeddings are resampled.
    #[must_use]
    pub fn with_interpolation(mut self, how: Interpolation) -> Self {
        self.interpolation = how;
        self
    }

    /// Freezes everything but the last `trainable` blocks, as BoQ (2) and SALAD (4) train;
    /// the final norm stays trainable.
    #[must_use]
    pub fn freeze_but_last(mut self, trainable: usize) -> Self {
        let frozen = self.blocks.len().saturating_sub(trainable);
        self.blocks = (self.blocks.into_iter().enumerate())
            .map(|(index, block)| if index < frozen { block.no_grad() } else { block })
            .collect();
        self.cls_token = self.cls_token.no_grad();
        self.pos_embed = self.pos_embed.no_grad();
        self.register_tokens = self.register_tokens.no_grad();
        self.mask_token = self.mask_token.no_grad();
        self.patch_embed = self.patch_embed.no_grad();
        self
    }

    /// Tokens after the last block, through the final norm: `x_norm_clstoken`, `x_norm_patchtokens`.
    ///
    /// `image` is `batch × 3 × height × width`.
    ///
    /// # Panics
    ///
    /// If height or width is no multiple of the patch side, or the network has no final norm.
    #[must_use]
    pub fn forward(&self, image: Tensor<4>) -> Tokens {
        let grid = self.grid(&image);
        let norm = self.norm.as_ref().expect("a network with its final norm");
        self.parted(norm.forward(self.prenorm(image)), grid)
    }

    /// As [`forward`](Self::forward), without the final norm (BoQ's crop point).
    ///
    /// # Panics
    ///
    /// If height or width is no multiple of the patch side.
    #[must_use]
    pub fn forward_unnormalised(&self, image: Tensor<4>) -> Tokens {
        let grid = self.grid(&image);
        self.parted(self.prenorm(image), grid)
    }

    /// All tokens after the last block, before the norm: `x_prenorm`, `batch × 1 + registers + patches × dim`.
    ///
    /// # Panics
    ///
    /// If height or width is no multiple of the patch side.
    #[must_use]
    pub fn prenorm(&self, image: Tensor<4>) -> Tensor<3> {
        let x = self.embedded(image);
        block::run_in_memory(&self.blocks, &x)
            .unwrap_or_else(|| self.blocks.iter().fold(x, |x, block| block.forward(x)))
    }

    /// Tokens after each of `blocks` (counted from 0), in rising order, as `get_intermediate_layers`.
    ///
    /// # Panics
    ///
    /// As [`forward`](Self::forward) if `normalised`.
    #[must_use]
    pub fn intermediate(
        &self,
        image: Tensor<4>,
        blocks: &[usize],
        normalised: bool,
    ) -> Vec<Tokens> {
        let grid = self.grid(&image);
        let mut x = self.embedded(image);
        let mut taken = Vec::with_capacity(blocks.len());
        for (index, block) in self.blocks.iter().enumerate() {
            x = block.forward(x);
            if blocks.contains(&index) {
                let x = match (normalised, &self.norm) {
                    (false, _) => x.clone(),
                    (true, norm) => {
                        norm.as_ref().expect("a network with its final norm").forward(x.clone())
                    }
                };
                taken.push(self.parted(x, grid));
            }
        }
        taken
    }

    /// Side of a patch in pixels.
    #[must_use]
    pub fn patch(&self) -> usize {
        self.patch_embed.proj.weight.dims()[2]
    }

    fn grid(&self, image: &Tensor<4>) -> [usize; 2] {
        let [_, _, height, width] = image.dims();
        let patch = self.patch();
        assert!(
            height.is_multiple_of(patch) && width.is_multiple_of(patch),
            "an image of {height}×{width} pixels is not made of patches of {patch}×{patch}"
        );
        [height / patch, width / patch]
    }

    /// Patches with positions, behind class token and registers.
    fn embedded(&self, image: Tensor<4>) -> Tensor<3> {
        let grid = self.grid(&image);
        let patches = self.patch_embed.forward(image);
        let [batch, count, dim] = patches.dims();
        let positions = self.pos_embed.val();
        let trained = positions.dims()[1] - 1;
        let class = self.cls_token.val() + positions.clone().narrow(1, 0, 1);
        let positions = positions.narrow(1, 1, trained);
        let positions = if count == trained && grid[0] == grid[1] {
            positions
        } else {
            position::resample(positions, grid, self.interpolation)
        };
        let mut tokens = vec![class.expand([batch, 1, dim])];
        if let Some(registers) = &self.register_tokens {
            let registers = registers.val();
            let count = registers.dims()[1];
            tokens.push(registers.expand([batch, count, dim]));
        }
        tokens.push(patches + positions);
        Tensor::cat(tokens, 1)
    }

    fn parted(&self, x: Tensor<3>, grid: [usize; 2]) -> Tokens {
        let [batch, count, dim] = x.dims();
        let registers = self.register_tokens.as_ref().map_or(0, |tokens| tokens.dims()[1]);
        Tokens {
            class: x.clone().narrow(1, 0, 1).reshape([batch, dim]),
            registers: (registers > 0).then(|| x.clone().narrow(1, 1, registers)),
            patches: x.narrow(1, 1 + registers, count - 1 - registers),
            grid,
        }
    }
}

/// A linear map of every patch. The convolution has stride and kernel equal, so it is one matrix product.
#[derive(Module, Debug)]
struct PatchEmbedding {
    proj: Conv2d,
}

impl PatchEmbedding {
    /// `batch × 3 × height × width` to `batch × patches × dim`.
    fn forward(&self, image: Tensor<4>) -> Tensor<3> {
        let [batch, channels, height, width] = image.dims();
        let weight = self.proj.weight.val();
        let [dim, _, patch, _] = weight.dims();
        let (rows, columns) = (height / patch, width / patch);
        let length = channels * patch * patch;
        let patches = image
            .reshape([batch, channels, rows, patch, columns, patch])
            .permute([0, 2, 4, 1, 3, 5])
            .reshape([batch, rows * columns, length]);
        let bias = self.proj.bias.as_ref().map(Param::val);
        linear(patches, weight.reshape([dim, length]).transpose(), bias)
    }
}
