//! AlexNet in Caffe's layout: two groups, local response normalisation.

use burn::{
    config::Config,
    module::Module,
    nn::{
        PaddingConfig2d,
        pool::{MaxPool2d, MaxPool2dConfig},
    },
    tensor::{Device, Tensor, activation::relu, s},
};
use serde::{Deserialize, Serialize};

use crate::layer::{Conv2d, Conv2dConfig};

/// Whether responses are normalised before or after they are pooled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum NormOrder {
    /// `bvlc_alexnet`.
    BeforePooling,
    /// `bvlc_reference_caffenet`, from which `AMOSNet` and `HybridNet` were trained.
    AfterPooling,
}

/// The layer whose output is the feature map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Layer {
    /// After the third convolution and its rectifier: the place descriptor of VPR-Bench's AlexNet.
    Conv3,
    /// After the fourth.
    Conv4,
    /// After the fifth, 13 × 13 × 256 at 227 × 227: what the pyramids of AMOSNet pool.
    Conv5,
    /// After the last pooling.
    Pool5,
}

/// Krizhevsky et al., *`ImageNet` Classification with Deep Convolutional Neural Networks* (2012), as
/// Caffe's `bvlc_alexnet` and `bvlc_reference_caffenet` define it: keys `conv1` to `conv5`.
///
/// Input is 227×227 BGR, values of 0 to 255 less the mean. Max pooling rounds sizes up.
#[derive(Config, Debug)]
pub struct AlexNetConfig {
    /// Order of normalisation and pooling.
    #[config(default = "NormOrder::BeforePooling")]
    pub order: NormOrder,
    /// Where the network ends.
    #[config(default = "Layer::Conv5")]
    pub end: Layer,
}

/// The convolutions of AlexNet; see [`AlexNetConfig`].
#[derive(Module, Debug)]
pub struct AlexNet {
    conv1: Conv2d,
    conv2: Conv2d,
    conv3: Conv2d,
    conv4: Option<Conv2d>,
    conv5: Option<Conv2d>,
    pool: MaxPool2d,
    #[module(skip)]
    order: NormOrder,
    #[module(skip)]
    end: Layer,
}

impl AlexNetConfig {
    /// A network with random weights.
    #[must_use]
    pub fn init(&self, device: &Device) -> AlexNet {
        let convolution = |channels, kernel: usize, stride, padding, groups| {
            Conv2dConfig::new(channels, [kernel, kernel])
                .with_stride([stride, stride])
                .with_padding(PaddingConfig2d::Explicit(padding, padding, padding, padding))
                .with_groups(groups)
                .init(device)
        };
        let pool = MaxPool2dConfig::new([3, 3]).with_strides([2, 2]).with_ceil_mode(true);
        AlexNet {
            conv1: convolution([3, 96], 11, 4, 0, 1),
            conv2: convolution([96, 256], 5, 1, 2, 2),
            conv3: convolution([256, 384], 3, 1, 1, 1),
            conv4: (self.end >= Layer::Conv4).then(|| convolution([384, 384], 3, 1, 1, 2)),
            conv5: (self.end >= Layer::Conv5).then(|| convolution([384, 256], 3, 1, 1, 2)),
            pool: pool.init(),
            order: self.order,
            end: self.end,
        }
    }
}

impl AlexNet {
    /// The feature map of images, `n × 3 × height × width`.
    #[must_use]
    pub fn forward(&self, images: Tensor<4>) -> Tensor<4> {
        let features = self.reduced(relu(self.conv1.forward(images)));
        let features = self.reduced(relu(self.conv2.forward(features)));
        let mut features = relu(self.conv3.forward(features));
        for convolution in [&self.conv4, &self.conv5].into_iter().flatten() {
            features = relu(convolution.forward(features));
        }
        if self.end == Layer::Pool5 { self.pool.forward(features) } else { features }
    }

    fn reduced(&self, features: Tensor<4>) -> Tensor<4> {
        match self.order {
            NormOrder::BeforePooling => self.pool.forward(normalize_responses(features)),
            NormOrder::AfterPooling => normalize_responses(self.pool.forward(features)),
        }
    }
}

/// Caffe's `LRN` across channels with `local_size` 5, `alpha` 10⁻⁴, `beta` 0.75, `k` 1:
/// `x / (1 + alpha/5 · Σ x²)^0.75`, the sum over the channel, two before and two after.
#[must_use]
pub fn normalize_responses(features: Tensor<4>) -> Tensor<4> {
    const REACH: usize = 2;
    let [n, channels, height, width] = features.dims();
    let border = Tensor::zeros([n, REACH, height, width], &features.device());
    let squares = features.clone() * features.clone();
    let padded = Tensor::cat(vec![border.clone(), squares, border], 1);
    let channel = |at| padded.clone().slice(s![.., at..at + channels, .., ..]);
    let sums = (1..=2 * REACH).fold(channel(0), |sum, at| sum + channel(at));
    features / (sums * (1e-4 / 5.0) + 1.0).powf_scalar(0.75)
}
