//! Backbones: from an image to a feature map or tokens.

pub mod alexnet;
pub mod calc;
pub mod dinov2;
pub mod efficientnet_lite;
pub mod mobilenet_v2;
pub mod resnet;
pub mod vgg;

pub use alexnet::{AlexNet, AlexNetConfig};
pub use calc::Calc;
pub use dinov2::{DinoV2, DinoV2Config};
pub use efficientnet_lite::{EfficientNetLite0, EfficientNetLite0Config};
pub use mobilenet_v2::{MobileNetV2, MobileNetV2Config};
pub use resnet::{ResNet, ResNetConfig};
pub use vgg::{Vgg16, Vgg16Config};
