//! Backbones give what the official code gives, from its own keys.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a test may")]

mod golden;

use std::path::Path;

use burn::tensor::{Device, Tensor};
use vpr_nets::{
    backbone::{
        AlexNetConfig, EfficientNetLite0Config, MobileNetV2Config, ResNetConfig, Vgg16Config,
        alexnet, efficientnet_lite, mobilenet_v2, resnet::Block, vgg,
    },
    weights::{self, Weights},
};

fn resnet(name: &str, block: Block) {
    let Some(folder) = golden::folder(name) else { return };
    for weights in golden::weights(&folder) {
        let mut network = ResNetConfig::new(block, [1, 1, 1, 0]).init(&Device::flex());
        weights.renamed(&[(r"^model\.", "")]).unwrap().apply(&mut network).unwrap();
        let output = network.forward(golden::tensor(&folder, "input.image"));
        golden::assert_close(output, &folder, "output.layer3");
    }
}

#[test]
fn resnet_of_basic_blocks_is_that_of_torchvision() {
    resnet("resnet_basic", Block::Basic);
}

#[test]
fn resnet_of_bottlenecks_is_that_of_torchvision() {
    resnet("resnet_bottleneck", Block::Bottleneck);
}

#[test]
fn efficientnet_lite0_is_the_official_one_with_its_weights() {
    let Some(folder) = golden::folder("efficientnet_lite0") else { return };
    let Some(data) = std::env::var_os("VPR_DATA") else {
        println!("skipped: VPR_DATA is not set, weights/ is in it");
        return;
    };
    let path = Path::new(&data).join("weights/efficientnet_lite0.pth");
    let mut network = EfficientNetLite0Config::new().with_classes(Some(1000)).init(&Device::flex());
    weights::load(&mut network, &path, &efficientnet_lite::RENAMES).unwrap();
    for image in ["20", "500"] {
        let features = network.forward(golden::tensor(&folder, &format!("input.{image}")));
        golden::assert_close(features.clone(), &folder, &format!("features.{image}"));
        let logits = network.classify(features).unwrap();
        golden::assert_close(logits, &folder, &format!("logits.{image}"));
    }
}

#[test]
fn mobilenet_v2_takes_every_key_of_the_shipped_netvlad() {
    let Some(data) = std::env::var_os("VPR_DATA") else {
        println!("skipped: VPR_DATA is not set, weights/ is in it");
        return;
    };
    for (name, channels) in [("rgb", 3), ("gray", 1)] {
        let file = format!("weights/netvlad_mobilenetv2_{name}.safetensors");
        let weights = Weights::open(&Path::new(&data).join(file)).unwrap();
        let mut trunk = MobileNetV2Config::new().with_channels(channels).init(&Device::flex());
        let trunk_keys = mobilenet_v2::from_keras(weights).unwrap();
        let renames = [(r"^net_vlad_layer_1\..*", "")];
        trunk_keys.renamed(&renames).unwrap().apply(&mut trunk).unwrap();
        let image = Tensor::zeros([1, channels, 240, 320], &Device::flex());
        assert_eq!(trunk.forward(image).dims(), [1, 64, 15, 20]);
    }
}

#[test]
fn sizes_are_those_of_the_papers() {
    let device = Device::flex();
    let image = |side| Tensor::ones([1, 3, side, side], &device);
    let vgg = |crop| Vgg16Config::new().with_crop(crop).init(&device).forward(image(32)).dims();
    assert_eq!(vgg(vgg::Crop::Conv5), [1, 512, 2, 2]);
    assert_eq!(vgg(vgg::Crop::Pool5), [1, 512, 1, 1]);
    let alexnet = |end| AlexNetConfig::new().with_end(end).init(&device).forward(image(227)).dims();
    assert_eq!(alexnet(alexnet::Layer::Conv3), [1, 384, 13, 13]);
    assert_eq!(alexnet(alexnet::Layer::Conv5), [1, 256, 13, 13]);
    assert_eq!(alexnet(alexnet::Layer::Pool5), [1, 256, 6, 6]);
    let resnet = |config: ResNetConfig| {
        let dims = config.init(&device).forward(image(64)).dims();
        assert_eq!(dims[1], config.channels());
        dims
    };
    assert_eq!(resnet(ResNetConfig::resnet18()), [1, 512, 2, 2]);
    assert_eq!(resnet(ResNetConfig::resnet50().cropped_after_layer3()), [1, 1024, 4, 4]);
}

/// `x / (1 + alpha/n · Σ x²)^beta` by hand, in f64.
#[test]
fn responses_are_normalised_as_caffe_does() {
    let values: Vec<f32> = (0_u16..7).map(|channel| 40.0 * f32::from(channel) - 100.0).collect();
    let device = Device::flex();
    let input = Tensor::<1>::from_floats(values.as_slice(), &device).reshape([1, 7, 1, 1]);
    let output = alexnet::normalize_responses(input).into_data().try_into_vec::<f32>().unwrap();
    for (channel, &actual) in output.iter().enumerate() {
        let window = channel.saturating_sub(2)..(channel + 3).min(7);
        let sum: f64 = values[window].iter().map(|&x| f64::from(x) * f64::from(x)).sum();
        let expected = f64::from(values[channel]) / (1.0 + 1e-4 / 5.0 * sum).powf(0.75);
        assert!((f64::from(actual) - expected).abs() < 1e-4 * expected.abs().max(1.0));
    }
}

/// The two VGG crops differ only by the rectifier.
#[test]
fn vgg_before_and_after_the_last_rectifier() {
    let device = Device::flex();
    device.seed(3);
    let before = Vgg16Config::new().with_crop(vgg::Crop::Conv5).init(&device);
    let image = Tensor::random([1, 3, 32, 32], burn::tensor::Distribution::Default, &device);
    let features = before.forward(image);
    assert!(features.min().into_scalar::<f32>() < 0.0);
}
