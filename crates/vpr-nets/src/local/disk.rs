//! DISK: local features learned by policy gradient.
//!
//! Tyszkiewicz et al., *DISK: Learning local features with policy gradient*, `NeurIPS` 2020;
//! <https://github.com/cvlab-epfl/disk>. Keys are those of its `depth-save.pth`; keypoints are chosen as kornia 0.9
//! does.

use std::path::Path;

use burn::{
    module::{Module, Param},
    nn::PaddingConfig2d,
    tensor::{
        Device, Tensor,
        activation::prelu,
        module::{avg_pool2d, interpolate},
        ops::{AvgPoolOptions, InterpolateMode, InterpolateOptions, PadMode},
    },
};
use serde::{Deserialize, Serialize};
use vpr_vision::{
    features::{Extractor, LocalFeatures},
    image::RgbImage,
};

use super::{
    Detector, check_size, extract,
    map::{FeatureMap, Plane},
    norm::instance_norm,
    peaks::{described, maxima, strict_maxima, strongest},
};
use crate::{
    Result,
    layer::{Conv2d, Conv2dConfig},
    weights,
};

/// Which keypoints are kept.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DiskParams {
    /// At most this many, the strongest; `None` keeps all.
    pub features: Option<usize>,
    /// Side of the window of which a keypoint is the maximum; odd.
    pub window: usize,
    /// Scores above this can be keypoints.
    pub score_threshold: f32,
    /// What counts as a maximum.
    pub suppression: Suppression,
}

/// What counts as a maximum of the heat map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Suppression {
    /// Greater than all of its window, which lies inside of the image (kornia).
    Strict,
    /// The maximum of the part of its window that lies inside of the image (released code; of equal maxima it keeps
    /// one, here all are kept).
    Clipped,
}

impl Default for DiskParams {
    /// kornia's, with the 2 048 features of the paper.
    fn default() -> Self {
        let (features, window, score_threshold) = (Some(2048), 5, 0.0);
        Self { features, window, score_threshold, suppression: Suppression::Strict }
    }
}

/// Instance normalisation, parametric `ReLU` and a convolution of 5 × 5; the first block of the network has only the
/// convolution.
#[derive(Module, Debug)]
struct Block {
    gate: Option<Gate>,
    conv: Conv2d,
}

/// Slopes of a parametric `ReLU`, one per channel.
#[derive(Module, Debug)]
struct Gate {
    weight: Param<Tensor<1>>,
}

impl Block {
    fn new(from: usize, to: usize, gated: bool, device: &Device) -> Self {
        let slopes = || Param::from_tensor(Tensor::full([from], 0.25, device));
        let conv = Conv2dConfig::new([from, to], [5, 5])
            .with_padding(PaddingConfig2d::Explicit(2, 2, 2, 2))
            .init(device);
        Self { gate: gated.then(|| Gate { weight: slopes() }), conv }
    }

    fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let gated = self.gate.iter().fold(x, |x, gate| prelu(instance_norm(x), gate.weight.val()));
        self.conv.forward(gated)
    }
}

/// The U-Net of DISK: four halvings, four doublings with skip connections.
#[derive(Module, Debug)]
pub struct DiskNet {
    path_down: Vec<Block>,
    path_up: Vec<Block>,
}

/// Length of a descriptor.
const DIM: usize = 128;

/// From the keys of `depth-save.pth` to those of [`DiskNet`].
const RENAMES: &[(&str, &str)] = &[
    (r"^extractor\.", ""),
    (r"^unet\.", ""),
    (r"^(path_down\.\d+)\.1\.1\.", "${1}.gate."),
    (r"^(path_down\.\d+)\.1\.3\.", "${1}.conv."),
    (r"^(path_up\.\d+)\.conv\.1\.", "${1}.gate."),
    (r"^(path_up\.\d+)\.conv\.3\.", "${1}.conv."),
];

impl DiskNet {
    /// The network with random weights.
    #[must_use]
    pub fn new(device: &Device) -> Self {
        let down = [[3, 16], [16, 32], [32, 64], [64, 64], [64, 64]];
        let up = [[64 + 64, 64], [64 + 64, 64], [64 + 32, 64], [64 + 16, DIM + 1]];
        let block = |(index, [from, to]): (usize, [usize; 2]), first: bool| {
            Block::new(from, to, !(first && index == 0), device)
        };
        Self {
            path_down: down.into_iter().enumerate().map(|it| block(it, true)).collect(),
            path_up: up.into_iter().enumerate().map(|it| block(it, false)).collect(),
        }
    }

    /// The network with published weights.
    ///
    /// # Errors
    ///
    /// Those of [`weights::load`].
    pub fn load(path: &Path, device: &Device) -> Result<Self> {
        let mut network = Self::new(device);
        weights::load(&mut network, path, RENAMES)?;
        Ok(network)
    }

    /// Descriptors, `n × 128 × h × w` and not normalised, and the heat map, `n × 1 × h × w`, of RGB images,
    /// `n × 3 × h × w` from 0 to 1, h and w multiples of 16.
    #[must_use]
    pub fn forward(&self, images: Tensor<4>) -> (Tensor<4>, Tensor<4>) {
        let mut skips = Vec::new();
        let mut x = images;
        for (level, block) in self.path_down.iter().enumerate() {
            if level > 0 {
                skips.push(x.clone());
                x = avg_pool2d(x, AvgPoolOptions::new([2, 2]).with_stride([2, 2]));
            }
            x = block.forward(x);
        }
        for (block, skip) in self.path_up.iter().zip(skips.into_iter().rev()) {
            x = block.forward(Tensor::cat(vec![doubled(x), skip], 1));
        }
        (x.clone().narrow(1, 0, DIM), x.narrow(1, DIM, 1))
    }
}

/// Twice the size, bilinear, pixels aligned by their areas.
fn doubled(x: Tensor<4>) -> Tensor<4> {
    let [_, _, height, width] = x.dims();
    let options = InterpolateOptions::new(InterpolateMode::Bilinear)
        .with_align_corners(false)
        .with_output_size([2 * height, 2 * width]);
    interpolate(x, options)
}

/// DISK with its rule for keypoints.
#[derive(Debug)]
pub struct Disk {
    network: DiskNet,
    params: DiskParams,
    device: Device,
}

impl Disk {
    /// Finds keypoints by a network.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::Parameter`] if the window is even.
    pub fn new(network: DiskNet, params: DiskParams, device: Device) -> Result<Self> {
        if params.window % 2 == 1 {
            return Ok(Self { network, params, device });
        }
        let value = params.window.to_string();
        Err(vpr_core::Error::Parameter { name: "window", value, reason: "must be odd" }.into())
    }

    /// The network.
    #[must_use]
    pub fn network(&self) -> &DiskNet {
        &self.network
    }
}

impl Extractor for Disk {
    fn name(&self) -> &'static str {
        "disk"
    }

    fn extract(&self, image: &RgbImage) -> vpr_core::Result<LocalFeatures> {
        extract(self, image)
    }
}

impl Detector for Disk {
    fn device(&self) -> &Device {
        &self.device
    }

    /// Images are padded with zeros, below and to the right, to multiples of 16. Raster order. Gray images count as
    /// colour images of equal channels.
    fn detect(&self, images: Tensor<4>) -> vpr_core::Result<Vec<LocalFeatures>> {
        let [n, channels, height, width] = images.dims();
        check_size("DISK needs at least one pixel", [height, width], 1)?;
        let images = if channels == 1 { images.expand([n, 3, height, width]) } else { images };
        let pad = |side: usize| side.next_multiple_of(16) - side;
        let padded = if pad(height) + pad(width) == 0 {
            images
        } else {
            images.pad((0, pad(width), 0, pad(height)), PadMode::Constant(0.0))
        };
        let (descriptors, heat) = self.network.forward(padded);
        let crop = |x: Tensor<4>| x.narrow(2, 0, height).narrow(3, 0, width);
        let maps = FeatureMap::from_tensor(crop(descriptors));
        let planes = Plane::from_tensor(crop(heat));
        planes.iter().zip(&maps).map(|(plane, map)| self.features(plane, map)).collect()
    }
}

impl Disk {
    fn features(&self, plane: &Plane, map: &FeatureMap) -> vpr_core::Result<LocalFeatures> {
        let DiskParams { features, window, score_threshold, suppression } = self.params;
        let find = match suppression {
            Suppression::Strict => strict_maxima,
            Suppression::Clipped => maxima,
        };
        let peaks = find(plane, window / 2, score_threshold);
        let peaks = strongest(&peaks, features.unwrap_or(peaks.len()));
        let rows = peaks.iter().flat_map(|it| map.at(it.x, it.y).iter().copied()).collect();
        described(&peaks, rows, map.channels(), [1.0; 2])
    }
}
