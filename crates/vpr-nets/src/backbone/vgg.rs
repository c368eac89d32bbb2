//! VGG16 as in torchvision.

use burn::{
    config::Config,
    module::Module,
    nn::{
        PaddingConfig2d,
        pool::{MaxPool2d, MaxPool2dConfig},
    },
    tensor::{Device, Tensor, activation::relu},
};
use serde::{Deserialize, Serialize};

use crate::layer::{Conv2d, Conv2dConfig};

/// Where the network ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Crop {
    /// After the last convolution, before its rectifier, as NetVLAD is trained.
    Conv5,
    /// After the last rectifier.
    Relu5,
    /// After the last pooling.
    Pool5,
}

/// Simonyan and Zisserman, *Very Deep Convolutional Networks* (2015), configuration D, as
/// torchvision builds it (`torchvision/models/vgg.py`): keys `features.0` to `features.28`.
///
/// The classifier is not built; leave its keys out with the rename `(r"^classifier\..*", "")`.
#[derive(Config, Debug)]
pub struct Vgg16Config {
    /// Where the network ends.
    #[config(default = "Crop::Pool5")]
    pub crop: Crop,
}

/// The convolutions of VGG16; see [`Vgg16Config`].
#[derive(Module, Debug)]
pub struct Vgg16 {
    /// As torchvision numbers them: `None` where it has a rectifier or a pooling.
    features: Vec<Option<Conv2d>>,
    pool: MaxPool2d,
    #[module(skip)]
    crop: Crop,
}

/// Channels of the convolutions; zero is a pooling.
const LAYERS: [usize; 18] =
    [64, 64, 0, 128, 128, 0, 256, 256, 256, 0, 512, 512, 512, 0, 512, 512, 512, 0];

impl Vgg16Config {
    /// Channels of the feature map.
    pub const CHANNELS: usize = 512;

    /// A network with random weights.
    #[must_use]
    pub fn init(&self, device: &Device) -> Vgg16 {
        let (mut features, mut channels) = (Vec::new(), 3);
        for &width in &LAYERS {
            if width == 0 {
                features.push(None);
                continue;
            }
            let convolution = Conv2dConfig::new([channels, width], [3, 3])
                .with_padding(PaddingConfig2d::Explicit(1, 1, 1, 1));
            features.extend([Some(convolution.init(device)), None]);
            channels = width;
        }
        let pool = MaxPool2dConfig::new([2, 2]).with_strides([2, 2]).init();
        Vgg16 { features, pool, crop: self.crop }
    }
}

impl Vgg16 {
    /// The feature map, `n × 512 × height/16 × width/16` (`/32` after the last pooling), of images,
    /// `n × 3 × height × width`.
    #[must_use]
    pub fn forward(&self, images: Tensor<4>) -> Tensor<4> {
        let mut convolutions = self.features.iter().flatten().peekable();
        let mut features = images;
        for &width in &LAYERS {
            if width == 0 {
                if convolutions.peek().is_some() || self.crop == Crop::Pool5 {
                    features = self.pool.forward(features);
                }
            } else if let Some(convolution) = convolutions.next() {
                features = convolution.forward(features);
                if convolutions.peek().is_some() || self.crop != Crop::Conv5 {
                    features = relu(features);
                }
            }
        }
        features
    }
}
