//! MobileNetV2 as Keras builds it, as far as the shipped NetVLAD uses it.

use burn::{
    config::Config,
    module::Module,
    nn::{BatchNorm, BatchNormConfig, PaddingConfig2d},
    tensor::{Device, Tensor},
};

use super::efficientnet_lite::relu6;
use crate::{
    Result,
    layer::{Conv2d, Conv2dConfig},
    weights::{Tensor as Weight, Weights},
};

/// Sandler et al., *MobileNetV2* (2018), as `keras.applications` builds it.
///
/// The defaults are the trunk of `NetVLAD` on MobileNetV2 of the package `netvlad-mobilenetv2`
/// (layer graph beside its weights): width 1, ten blocks, 64 channels at a sixteenth of the size.
#[derive(Config, Debug)]
pub struct MobileNetV2Config {
    /// Channels of the input: 3, or 1 for gray images.
    #[config(default = 3)]
    pub channels: usize,
    /// How many of the seventeen blocks are built.
    #[config(default = 10)]
    pub blocks: usize,
}

/// A MobileNetV2; see [`MobileNetV2Config`].
#[derive(Module, Debug)]
pub struct MobileNetV2 {
    conv: Conv2d,
    norm: BatchNorm,
    blocks: Vec<InvertedResidual>,
}

/// Expand, filter each channel, project.
#[derive(Module, Debug)]
pub struct InvertedResidual {
    expand: Option<Conv2d>,
    expand_norm: Option<BatchNorm>,
    depthwise: Conv2d,
    depthwise_norm: BatchNorm,
    project: Conv2d,
    project_norm: BatchNorm,
    has_shortcut: bool,
}

/// Repeats, stride, expansion, channels.
const STAGES: [(usize, usize, usize, usize); 7] = [
    (1, 1, 1, 16),
    (2, 2, 6, 24),
    (3, 2, 6, 32),
    (4, 2, 6, 64),
    (3, 1, 6, 96),
    (3, 2, 6, 160),
    (1, 1, 6, 320),
];
const STEM: usize = 32;

impl MobileNetV2Config {
    /// Channels of the feature map.
    #[must_use]
    pub fn out_channels(&self) -> usize {
        self.plan().last().map_or(STEM, |&(_, [_, to], _)| to)
    }

    /// Expansion, channels before and after, stride of every block.
    fn plan(&self) -> Vec<(usize, [usize; 2], usize)> {
        let mut channels = STEM;
        let all = STAGES.iter().flat_map(|&(repeats, stride, expansion, width)| {
            (0..repeats).map(move |repeat| (expansion, width, if repeat == 0 { stride } else { 1 }))
        });
        all.take(self.blocks)
            .map(|(expansion, width, stride)| {
                let from = std::mem::replace(&mut channels, width);
                (expansion, [from, width], stride)
            })
            .collect()
    }

    /// A network with random weights.
    #[must_use]
    pub fn init(&self, device: &Device) -> MobileNetV2 {
        let blocks = self
            .plan()
            .into_iter()
            .map(|(expansion, channels, stride)| block(channels, stride, expansion, device));
        MobileNetV2 {
            conv: convolution([self.channels, STEM], 3, 2, 1, device),
            norm: norm(STEM, device),
            blocks: blocks.collect(),
        }
    }
}

impl MobileNetV2 {
    /// The feature map, `n × 64 × height/16 × width/16` after ten blocks, of images,
    /// `n × channels × height × width` with even sides.
    #[must_use]
    pub fn forward(&self, images: Tensor<4>) -> Tensor<4> {
        let stem = relu6(self.norm.forward(self.conv.forward(images)));
        self.blocks.iter().fold(stem, |features, block| block.forward(features))
    }
}

impl InvertedResidual {
    fn forward(&self, input: Tensor<4>) -> Tensor<4> {
        let mut features = input.clone();
        if let (Some(expand), Some(norm)) = (&self.expand, &self.expand_norm) {
            features = relu6(norm.forward(expand.forward(features)));
        }
        features = relu6(self.depthwise_norm.forward(self.depthwise.forward(features)));
        features = self.project_norm.forward(self.project.forward(features));
        if self.has_shortcut { features + input } else { features }
    }
}

fn block(
    [from, to]: [usize; 2],
    stride: usize,
    expansion: usize,
    device: &Device,
) -> InvertedResidual {
    let width = from * expansion;
    let expands = expansion != 1;
    InvertedResidual {
        expand: expands.then(|| convolution([from, width], 1, 1, 1, device)),
        expand_norm: expands.then(|| norm(width, device)),
        depthwise: convolution([width, width], 3, stride, width, device),
        depthwise_norm: norm(width, device),
        project: convolution([width, to], 1, 1, 1, device),
        project_norm: norm(to, device),
        has_shortcut: stride == 1 && from == to,
    }
}

/// Keras pads below and to the right only where it halves.
fn convolution(
    channels: [usize; 2],
    kernel: usize,
    stride: usize,
    groups: usize,
    device: &Device,
) -> Conv2d {
    let (end, start) = (kernel / 2, kernel / 2 - usize::from(stride == 2));
    Conv2dConfig::new(channels, [kernel, kernel])
        .with_stride([stride, stride])
        .with_padding(PaddingConfig2d::Explicit(start, start, end, end))
        .with_groups(groups)
        .with_bias(false)
        .init(device)
}

fn norm(channels: usize, device: &Device) -> BatchNorm {
    BatchNormConfig::new(channels).with_epsilon(1e-3).init(device)
}

/// Weights as Keras stores them, under our keys and in PyTorch's layout.
///
/// Layers are renamed (`block_3_expand_BN.gamma` becomes `blocks.3.expand_norm.weight`); kernels,
/// `height × width × in × out`, become `out × in × height × width`, and those that filter each
/// channel, `height × width × channels × 1`, become `channels × 1 × height × width`.
///
/// # Errors
///
/// [`vpr_core::Error::Format`] if two keys become one.
pub fn from_keras(weights: Weights) -> Result<Weights> {
    let turned = weights.mapped(|key, weight| {
        let order = match key.rsplit('.').next() {
            Some("kernel") if weight.shape.len() == 4 => [3, 2, 0, 1],
            Some("depthwise_kernel") if weight.shape.len() == 4 => [2, 3, 0, 1],
            _ => return Some((key, weight)),
        };
        Some((key, permuted(&weight, order)))
    });
    turned.renamed(&[
        ("^Conv1\\.", "conv."),
        ("^bn_Conv1\\.", "norm."),
        ("^expanded_conv_", "block_0_"),
        ("^block_(\\d+)_([a-z]+)_BN\\.", "blocks.$1.${2}_norm."),
        ("^block_(\\d+)_([a-z]+)\\.", "blocks.$1.$2."),
        ("\\.(depthwise_)?kernel$", ".weight"),
        ("\\.gamma$", ".weight"),
        ("\\.beta$", ".bias"),
        ("\\.moving_mean$", ".running_mean"),
        ("\\.moving_variance$", ".running_var"),
    ])
}

/// The same values with axis `i` of the result being axis `order[i]` of `weight`.
fn permuted(weight: &Weight, order: [usize; 4]) -> Weight {
    let shape: Vec<usize> = order.iter().map(|&axis| weight.shape[axis]).collect();
    let stride = |axis: usize| weight.shape[axis + 1..].iter().product::<usize>();
    let strides = order.map(stride);
    let mut data = Vec::with_capacity(weight.data.len());
    for a in 0..shape[0] {
        for b in 0..shape[1] {
            for c in 0..shape[2] {
                for d in 0..shape[3] {
                    let at = a * strides[0] + b * strides[1] + c * strides[2] + d * strides[3];
                    data.push(weight.data[at]);
                }
            }
        }
    }
    Weight { shape, data }
}
