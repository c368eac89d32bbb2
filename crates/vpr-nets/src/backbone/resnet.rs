//! ResNet as in torchvision.

use burn::{
    config::Config,
    module::Module,
    nn::{
        BatchNorm, BatchNormConfig, Linear, LinearConfig, PaddingConfig2d,
        pool::{MaxPool2d, MaxPool2dConfig},
    },
    tensor::{Device, Tensor, module::adaptive_avg_pool2d},
};
use serde::{Deserialize, Serialize};

use crate::layer::{Activation, Conv2d, Conv2dConfig, conv_norm};

/// Which residual block a network is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Block {
    /// Two 3×3 convolutions (ResNet-18, 34).
    Basic,
    /// 1×1, 3×3, 1×1, with four times as many channels at the end (ResNet-50, 101).
    Bottleneck,
}

/// He et al., *Deep Residual Learning for Image Recognition* (2016), as torchvision builds it
/// (`torchvision/models/resnet.py`): keys `conv1`, `bn1`, `layer1.0.conv1`, …, `fc`.
#[derive(Config, Debug)]
pub struct ResNetConfig {
    /// The kind of block.
    pub block: Block,
    /// Blocks of each of the four stages; a network that is cropped has zeros at the end.
    pub layers: [usize; 4],
    /// Number of classes of the classifier; a trunk has none.
    pub classes: Option<usize>,
}

/// A ResNet; see [`ResNetConfig`].
#[derive(Module, Debug)]
pub struct ResNet {
    conv1: Conv2d,
    bn1: BatchNorm,
    maxpool: MaxPool2d,
    layer1: Vec<Residual>,
    layer2: Vec<Residual>,
    layer3: Vec<Residual>,
    layer4: Vec<Residual>,
    fc: Option<Linear>,
}

/// One residual block.
#[derive(Module, Debug)]
pub struct Residual {
    conv1: Conv2d,
    bn1: BatchNorm,
    conv2: Conv2d,
    bn2: BatchNorm,
    conv3: Option<Conv2d>,
    bn3: Option<BatchNorm>,
    downsample: Option<(Conv2d, BatchNorm)>,
}

impl ResNetConfig {
    /// ResNet-18 without classifier.
    #[must_use]
    pub fn resnet18() -> Self {
        Self::new(Block::Basic, [2, 2, 2, 2])
    }

    /// ResNet-34 without classifier.
    #[must_use]
    pub fn resnet34() -> Self {
        Self::new(Block::Basic, [3, 4, 6, 3])
    }

    /// ResNet-50 without classifier.
    #[must_use]
    pub fn resnet50() -> Self {
        Self::new(Block::Bottleneck, [3, 4, 6, 3])
    }

    /// ResNet-101 without classifier.
    #[must_use]
    pub fn resnet101() -> Self {
        Self::new(Block::Bottleneck, [3, 4, 23, 3])
    }

    /// The same network without its last stage.
    #[must_use]
    pub fn cropped_after_layer3(mut self) -> Self {
        self.layers[3] = 0;
        self
    }

    /// Channels of the feature map.
    #[must_use]
    pub fn channels(&self) -> usize {
        let stage = self.layers.iter().rposition(|&blocks| blocks > 0);
        stage.map_or(STEM, |stage| (STEM << stage) * self.expansion())
    }

    fn expansion(&self) -> usize {
        match self.block {
            Block::Basic => 1,
            Block::Bottleneck => 4,
        }
    }

    /// A network with random weights.
    #[must_use]
    pub fn init(&self, device: &Device) -> ResNet {
        let mut channels = STEM;
        let mut stage = |index: usize| -> Vec<Residual> {
            let width = STEM << index;
            (0..self.layers[index])
                .map(|block| {
                    let stride = if index > 0 && block == 0 { 2 } else { 1 };
                    let residual = self.residual(channels, width, stride, device);
                    channels = width * self.expansion();
                    residual
                })
                .collect()
        };
        let (layer1, layer2, layer3, layer4) = (stage(0), stage(1), stage(2), stage(3));
        let pool = MaxPool2dConfig::new([3, 3]).with_strides([2, 2]);
        ResNet {
            conv1: convolution([3, STEM], 7, 2, device),
            bn1: BatchNormConfig::new(STEM).init(device),
            maxpool: pool.with_padding(padding(1)).init(),
            layer1,
            layer2,
            layer3,
            layer4,
            fc: self.classes.map(|n| LinearConfig::new(channels, n).init(device)),
        }
    }

    fn residual(&self, from: usize, width: usize, stride: usize, device: &Device) -> Residual {
        let norm = |channels| BatchNormConfig::new(channels).init(device);
        let to = width * self.expansion();
        let downsample = (stride != 1 || from != to)
            .then(|| (convolution([from, to], 1, stride, device), norm(to)));
        match self.block {
            Block::Basic => Residual {
                conv1: convolution([from, width], 3, stride, device),
                bn1: norm(width),
                conv2: convolution([width, width], 3, 1, device),
                bn2: norm(width),
                conv3: None,
                bn3: None,
                downsample,
            },
            Block::Bottleneck => Residual {
                conv1: convolution([from, width], 1, 1, device),
                bn1: norm(width),
                conv2: convolution([width, width], 3, stride, device),
                bn2: norm(width),
                conv3: Some(convolution([width, to], 1, 1, device)),
                bn3: Some(norm(to)),
                downsample,
            },
        }
    }
}

/// Channels after the first convolution.
const STEM: usize = 64;

impl ResNet {
    /// The feature map, `n × channels × height/32 × width/32` (`/16` after `layer3`), of images,
    /// `n × 3 × height × width`.
    #[must_use]
    pub fn forward(&self, images: Tensor<4>) -> Tensor<4> {
        let stem = conv_norm(&self.conv1, &self.bn1, images, None, Activation::Relu);
        let stem = self.maxpool.forward(stem);
        [&self.layer1, &self.layer2, &self.layer3, &self.layer4]
            .into_iter()
            .flatten()
            .fold(stem, |features, block| block.forward(features))
    }

    /// Scores of the classes, `n × classes`; `None` without classifier.
    #[must_use]
    pub fn classify(&self, images: Tensor<4>) -> Option<Tensor<2>> {
        let classifier = self.fc.as_ref()?;
        let pooled = adaptive_avg_pool2d(self.forward(images), [1, 1]);
        Some(classifier.forward(pooled.flatten(1, 3)))
    }
}

impl Residual {
    fn forward(&self, input: Tensor<4>) -> Tensor<4> {
        let shortcut = match &self.downsample {
            Some((conv, norm)) => conv_norm(conv, norm, input.clone(), None, Activation::None),
            None => input.clone(),
        };
        let features = conv_norm(&self.conv1, &self.bn1, input, None, Activation::Relu);
        let Some((conv3, bn3)) = self.conv3.as_ref().zip(self.bn3.as_ref()) else {
            return conv_norm(&self.conv2, &self.bn2, features, Some(shortcut), Activation::Relu);
        };
        let features = conv_norm(&self.conv2, &self.bn2, features, None, Activation::Relu);
        conv_norm(conv3, bn3, features, Some(shortcut), Activation::Relu)
    }
}

/// A convolution without bias that keeps the size but for its stride.
fn convolution(channels: [usize; 2], kernel: usize, stride: usize, device: &Device) -> Conv2d {
    Conv2dConfig::new(channels, [kernel, kernel])
        .with_stride([stride, stride])
        .with_padding(padding(kernel / 2))
        .with_bias(false)
        .init(device)
}

fn padding(n: usize) -> PaddingConfig2d {
    PaddingConfig2d::Explicit(n, n, n, n)
}
