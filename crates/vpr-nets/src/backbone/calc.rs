//! The encoder of CALC.

use burn::{
    module::Module,
    nn::{
        PaddingConfig2d,
        pool::{MaxPool2d, MaxPool2dConfig},
    },
    tensor::{Device, Tensor, activation::relu},
};

use super::alexnet::normalize_responses;
use crate::layer::{Conv2d, Conv2dConfig};

/// Merrill and Huang, *Lightweight Unsupervised Deep Loop Closure* (2018), as its `deploy.prototxt`
/// defines it: keys `conv1` to `conv3`.
///
/// Input is 120×160 gray, values of 0 to 1. The decoder, which gave HOG in training, is not built.
#[derive(Module, Debug)]
pub struct Calc {
    conv1: Conv2d,
    conv2: Conv2d,
    conv3: Conv2d,
    pool: MaxPool2d,
}

impl Calc {
    /// Length of the descriptor of a 120×160 image: 4 × 14 × 19.
    pub const DIMENSION: usize = 1064;

    /// A network with random weights.
    #[must_use]
    pub fn new(device: &Device) -> Self {
        let convolution = |channels, side: usize, stride: usize, padding| {
            Conv2dConfig::new(channels, [side, side])
                .with_stride([stride, stride])
                .with_padding(PaddingConfig2d::Explicit(padding, padding, padding, padding))
                .init(device)
        };
        Self {
            conv1: convolution([1, 64], 5, 2, 4),
            conv2: convolution([64, 128], 4, 1, 2),
            conv3: convolution([128, 4], 3, 1, 0),
            pool: MaxPool2dConfig::new([3, 3]).with_strides([2, 2]).with_ceil_mode(true).init(),
        }
    }

    /// Descriptors, `n × 1064`, of images, `n × 1 × 120 × 160`; not normalised.
    #[must_use]
    pub fn forward(&self, images: Tensor<4>) -> Tensor<2> {
        let features = self.pool.forward(relu(self.conv1.forward(images)));
        let features = normalize_responses(features);
        let features = self.pool.forward(relu(self.conv2.forward(features)));
        relu(self.conv3.forward(normalize_responses(features))).flatten(1, 3)
    }
}
