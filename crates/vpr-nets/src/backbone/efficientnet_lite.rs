//! EfficientNet-Lite0 as in the package `efficientnet-lite-pytorch`.

use burn::{
    config::Config,
    module::Module,
    nn::{BatchNorm, BatchNormConfig, Linear, LinearConfig, PaddingConfig2d},
    tensor::{Device, Tensor, module::adaptive_avg_pool2d},
};

use crate::layer::{Conv2d, Conv2dConfig};

/// Tan and Le, *EfficientNet* (2019), in the Lite form of its repository: no squeeze-and-excitation,
/// `ReLU6`, stem and head not scaled. Renames from the official keys: [`RENAMES`].
///
/// Padding is that of a 224×224 input, whatever the input is, as in the package.
#[derive(Config, Debug)]
pub struct EfficientNetLite0Config {
    /// Number of classes of the classifier; a trunk has none.
    pub classes: Option<usize>,
}

/// From the package's keys to ours: Rust has no leading underscores.
pub const RENAMES: [(&str, &str); 2] = [("^_", ""), (r"\._", ".")];

/// An EfficientNet-Lite0; see [`EfficientNetLite0Config`].
#[derive(Module, Debug)]
pub struct EfficientNetLite0 {
    conv_stem: Conv2d,
    bn0: BatchNorm,
    blocks: Vec<MobileBlock>,
    conv_head: Conv2d,
    bn1: BatchNorm,
    fc: Option<Linear>,
}

/// An inverted residual: expand, filter each channel, project.
#[derive(Module, Debug)]
pub struct MobileBlock {
    expand_conv: Option<Conv2d>,
    bn0: Option<BatchNorm>,
    depthwise_conv: Conv2d,
    bn1: BatchNorm,
    project_conv: Conv2d,
    bn2: BatchNorm,
    has_shortcut: bool,
}

/// Repeats, kernel, stride, expansion, channels.
const STAGES: [(usize, usize, usize, usize, usize); 7] = [
    (1, 3, 1, 1, 16),
    (2, 3, 2, 6, 24),
    (2, 5, 2, 6, 40),
    (3, 3, 2, 6, 80),
    (3, 5, 1, 6, 112),
    (4, 5, 2, 6, 192),
    (1, 3, 1, 6, 320),
];
const STEM: usize = 32;

impl EfficientNetLite0Config {
    /// Channels of the feature map.
    pub const CHANNELS: usize = 1280;

    /// A network with random weights.
    #[must_use]
    pub fn init(&self, device: &Device) -> EfficientNetLite0 {
        let (mut channels, mut blocks) = (STEM, Vec::new());
        for &(repeats, kernel, stride, expansion, width) in &STAGES {
            for repeat in 0..repeats {
                let stride = if repeat == 0 { stride } else { 1 };
                blocks.push(block([channels, width], kernel, stride, expansion, device));
                channels = width;
            }
        }
        EfficientNetLite0 {
            conv_stem: convolution([3, STEM], 3, 2, 1, device),
            bn0: norm(STEM, device),
            blocks,
            conv_head: convolution([channels, Self::CHANNELS], 1, 1, 1, device),
            bn1: norm(Self::CHANNELS, device),
            fc: self.classes.map(|n| LinearConfig::new(Self::CHANNELS, n).init(device)),
        }
    }
}

impl EfficientNetLite0 {
    /// The feature map, `n × 1280 × height/32 × width/32`, of images, `n × 3 × height × width`.
    #[must_use]
    pub fn forward(&self, images: Tensor<4>) -> Tensor<4> {
        let stem = relu6(self.bn0.forward(self.conv_stem.forward(images)));
        let features = self.blocks.iter().fold(stem, |features, block| block.forward(features));
        relu6(self.bn1.forward(self.conv_head.forward(features)))
    }

    /// Scores of the classes, `n × classes`, of a feature map; `None` without classifier.
    #[must_use]
    pub fn classify(&self, features: Tensor<4>) -> Option<Tensor<2>> {
        let pooled = adaptive_avg_pool2d(features, [1, 1]).flatten(1, 3);
        Some(self.fc.as_ref()?.forward(pooled))
    }
}

impl MobileBlock {
    fn forward(&self, input: Tensor<4>) -> Tensor<4> {
        let mut features = input.clone();
        if let (Some(expand), Some(norm)) = (&self.expand_conv, &self.bn0) {
            features = relu6(norm.forward(expand.forward(features)));
        }
        features = relu6(self.bn1.forward(self.depthwise_conv.forward(features)));
        features = self.bn2.forward(self.project_conv.forward(features));
        if self.has_shortcut { features + input } else { features }
    }
}

fn block(
    [from, to]: [usize; 2],
    kernel: usize,
    stride: usize,
    expansion: usize,
    device: &Device,
) -> MobileBlock {
    let width = from * expansion;
    let expands = expansion != 1;
    MobileBlock {
        expand_conv: expands.then(|| convolution([from, width], 1, 1, 1, device)),
        bn0: expands.then(|| norm(width, device)),
        depthwise_conv: convolution([width, width], kernel, stride, width, device),
        bn1: norm(width, device),
        project_conv: convolution([width, to], 1, 1, 1, device),
        bn2: norm(to, device),
        has_shortcut: stride == 1 && from == to,
    }
}

fn convolution(
    channels: [usize; 2],
    kernel: usize,
    stride: usize,
    groups: usize,
    device: &Device,
) -> Conv2d {
    // Where an even input is halved, one pixel less is needed at the top and the left.
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

/// `min(max(x, 0), 6)`.
pub(super) fn relu6(features: Tensor<4>) -> Tensor<4> {
    features.clamp(0.0, 6.0)
}
