//! DELF-style attentive features: dense features of a ResNet, weighted by a learned attention.
//!
//! Noh et al., *Large-Scale Image Retrieval with Attentive Deep Local Features*, ICCV 2017: the map of a ResNet-50
//! after its third stage, at several scales, and for each position a score by two convolutions of 1 × 1. The released
//! weights are TensorFlow's; the keys here are torchvision's, and `attention.conv1`, `attention.conv2`.

use std::path::Path;

use burn::{
    module::Module,
    tensor::{
        Device, Tensor,
        activation::{relu, softplus},
        module::interpolate,
        ops::{InterpolateMode, InterpolateOptions},
    },
};
use ndarray::Array2;
use serde::{Deserialize, Serialize};
use vpr_core::{Descriptors, Error};
use vpr_vision::{
    features::{Extractor, LocalDescriptors, LocalFeatures},
    image::RgbImage,
};

use super::{
    Detector, check_size, extract,
    map::{FeatureMap, Plane},
};
use crate::{
    Result,
    backbone::{ResNet, ResNetConfig},
    layer::{Conv2d, Conv2dConfig},
    weights,
};

/// Which positions are kept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DelfParams {
    /// At most this many over all scales, the strongest.
    pub features: usize,
    /// Attention above which a position can be a keypoint.
    pub score_threshold: f32,
    /// Sizes at which the image is seen.
    pub scales: Vec<f32>,
}

impl Default for DelfParams {
    /// 1 000 features on seven scales a factor of √2 apart, as released; the released threshold of 100 belongs to the
    /// released attention, so there is none here.
    fn default() -> Self {
        let root = std::f32::consts::SQRT_2;
        let scales = vec![0.25, 0.25 * root, 0.5, 0.5 * root, 1.0, root, 2.0];
        Self { features: 1000, score_threshold: 0.0, scales }
    }
}

/// Scores of positions: 1 × 1 convolutions to 512 channels and to one, `ReLU` between them, softplus at the end.
#[derive(Module, Debug)]
struct Attention {
    conv1: Conv2d,
    conv2: Conv2d,
}

/// A ResNet-50 up to its third stage and its attention.
#[derive(Module, Debug)]
pub struct DelfNet {
    trunk: ResNet,
    attention: Attention,
}

/// The attention stays, the rest belongs to the trunk, whose last stage and classifier are not needed.
const RENAMES: &[(&str, &str)] = &[
    (r"^layer4\..*", ""),
    (r"^fc\..*", ""),
    (r"^(conv1|bn1|layer1|layer2|layer3)\.", "trunk.${1}."),
];

impl DelfNet {
    /// The network with random weights.
    #[must_use]
    pub fn new(device: &Device) -> Self {
        let trunk = ResNetConfig::resnet50().cropped_after_layer3();
        let conv = |from, to| Conv2dConfig::new([from, to], [1, 1]).init(device);
        let attention = Attention { conv1: conv(trunk.channels(), 512), conv2: conv(512, 1) };
        Self { trunk: trunk.init(device), attention }
    }

    /// The network with the weights of a file.
    ///
    /// # Errors
    ///
    /// Those of [`weights::load`].
    pub fn load(path: &Path, device: &Device) -> Result<Self> {
        let mut network = Self::new(device);
        weights::load(&mut network, path, RENAMES)?;
        Ok(network)
    }

    /// Descriptors, `n × 1024 × h/16 × w/16`, and scores, `n × 1 × h/16 × w/16`, of RGB images, `n × 3 × h × w`,
    /// normalised as `ImageNet`'s.
    #[must_use]
    pub fn forward(&self, images: Tensor<4>) -> (Tensor<4>, Tensor<4>) {
        let map = self.trunk.forward(images);
        let hidden = relu(self.attention.conv1.forward(map.clone()));
        (map, softplus(self.attention.conv2.forward(hidden), 1.0))
    }
}

/// DELF-style features with their rule for keypoints.
#[derive(Debug)]
pub struct Delf {
    network: DelfNet,
    params: DelfParams,
    device: Device,
}

/// Pixels of the image per pixel of the map.
const STRIDE: f32 = 16.0;

/// No scaled side is shorter: the deepest map would have no pixel.
const LEAST_SIDE: usize = 16;

impl Delf {
    /// Finds keypoints by a network.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if a scale is not from 1/16 to 4.
    pub fn new(network: DelfNet, params: DelfParams, device: Device) -> Result<Self> {
        match params.scales.iter().find(|scale| !(0.0625..=4.0).contains(*scale)) {
            None => Ok(Self { network, params, device }),
            Some(scale) => {
                let value = scale.to_string();
                Err(Error::Parameter { name: "scales", value, reason: "from 1/16 to 4" }.into())
            }
        }
    }
}

/// A position on one scale.
struct Place {
    point: [f32; 2],
    score: f32,
    row: Vec<f32>,
}

impl Extractor for Delf {
    fn name(&self) -> &'static str {
        "delf"
    }

    fn extract(&self, image: &RgbImage) -> vpr_core::Result<LocalFeatures> {
        extract(self, image)
    }
}

impl Detector for Delf {
    fn device(&self) -> &Device {
        &self.device
    }

    /// Strongest first. Scales at which a side has less than 16 pixels are left out. A keypoint is the centre of what
    /// a position of the map sees.
    fn detect(&self, images: Tensor<4>) -> vpr_core::Result<Vec<LocalFeatures>> {
        let [n, channels, height, width] = images.dims();
        check_size("DELF needs at least 16 pixels on a side", [height, width], LEAST_SIDE)?;
        let images = if channels == 1 { images.expand([n, 3, height, width]) } else { images };
        let images = normalize(images);
        let mut places: Vec<Vec<Place>> = (0..n).map(|_| Vec::new()).collect();
        for &scale in &self.params.scales {
            let size = [height, width].map(|side| scaled(side, scale));
            if size.iter().any(|&side| side < LEAST_SIDE) {
                continue;
            }
            let factor = [width as f32 / size[1] as f32, height as f32 / size[0] as f32];
            let (maps, scores) = self.network.forward(resize(images.clone(), size));
            let maps = FeatureMap::from_tensor(maps);
            for ((places, map), plane) in
                places.iter_mut().zip(&maps).zip(Plane::from_tensor(scores))
            {
                self.collect(places, map, &plane, factor);
            }
        }
        places.into_iter().map(|places| self.strongest(places)).collect()
    }
}

impl Delf {
    fn collect(&self, places: &mut Vec<Place>, map: &FeatureMap, scores: &Plane, factor: [f32; 2]) {
        for y in 0..scores.height {
            for x in 0..scores.width {
                let score = scores.at(x, y);
                if score > self.params.score_threshold {
                    let point = [x as f32 * STRIDE * factor[0], y as f32 * STRIDE * factor[1]];
                    places.push(Place { point, score, row: map.at(x, y).to_vec() });
                }
            }
        }
    }

    fn strongest(&self, mut places: Vec<Place>) -> vpr_core::Result<LocalFeatures> {
        places.sort_by(|a, b| b.score.total_cmp(&a.score));
        places.truncate(self.params.features);
        let dim = ResNetConfig::resnet50().cropped_after_layer3().channels();
        let shape = (places.len(), dim);
        let rows = Array2::from_shape_fn(shape, |(place, column)| places[place].row[column]);
        LocalFeatures::new(
            places.iter().map(|it| it.point).collect(),
            places.iter().map(|it| it.score).collect(),
            LocalDescriptors::Float(Descriptors::new(rows)?.normalized()),
        )
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a length in pixels")]
fn scaled(side: usize, scale: f32) -> usize {
    (side as f32 * scale).round() as usize
}

fn resize(images: Tensor<4>, size: [usize; 2]) -> Tensor<4> {
    let options = InterpolateOptions::new(InterpolateMode::Bilinear)
        .with_align_corners(false)
        .with_output_size(size);
    interpolate(images, options)
}

/// By the mean and the standard deviation of `ImageNet`'s channels.
fn normalize(images: Tensor<4>) -> Tensor<4> {
    let device = images.device();
    let row = |values: [f32; 3]| Tensor::<1>::from_data(values, &device).reshape([1, 3, 1, 1]);
    (images - row([0.485, 0.456, 0.406])) / row([0.229, 0.224, 0.225])
}

#[cfg(test)]
mod tests {
    use burn::tensor::Distribution;

    use super::*;

    #[test]
    fn the_strongest_positions_of_all_scales_are_kept() {
        let device = Device::flex();
        device.seed(3);
        let params = DelfParams { features: 20, scales: vec![0.5, 1.0], ..DelfParams::default() };
        let delf = Delf::new(DelfNet::new(&device), params, device.clone()).unwrap();
        let image = Tensor::random([1, 3, 64, 96], Distribution::Uniform(0.0, 1.0), &device);
        let features = delf.detect(image).unwrap().pop().unwrap();
        assert_eq!(features.len(), 20); // of 2 × 3 and 4 × 6
        assert!(features.scores().is_sorted_by(|a, b| a >= b));
        assert!(features.keypoints().iter().all(|[x, y]| *x < 96.0 && *y < 64.0));
        assert_eq!(features.descriptors().as_float().unwrap().dim(), 1024);
    }

    #[test]
    fn nonsense_is_refused() {
        let device = Device::flex();
        let params = DelfParams { scales: vec![0.0], ..DelfParams::default() };
        assert!(Delf::new(DelfNet::new(&device), params, device).is_err());
    }
}
