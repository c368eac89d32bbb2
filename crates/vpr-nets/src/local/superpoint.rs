//! SuperPoint: self-supervised interest points and descriptors.
//!
//! `DeTone` et al., *SuperPoint: Self-Supervised Interest Point Detection and Description*, CVPR Workshops 2018. The
//! network and the keys are those of <https://github.com/rpautrat/SuperPoint>.

use std::path::Path;

use burn::{
    module::Module,
    nn::{BatchNorm, BatchNormConfig, PaddingConfig2d},
    tensor::{Device, Tensor, activation::relu, module::max_pool2d, ops::MaxPoolOptions},
};
use serde::{Deserialize, Serialize};
use vpr_vision::{
    features::{Extractor, LocalFeatures},
    image::RgbImage,
};

use super::{
    Detector, check_size, extract,
    map::{FeatureMap, Plane, Sampling},
    peaks::{Peak, by_score, described, repeated_maxima},
    xfeat::{pixels, unit},
};
use crate::{
    Result,
    layer::{Conv2d, Conv2dConfig},
    weights,
};

/// Which keypoints are kept.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SuperPointParams {
    /// At most this many, the strongest; `None` keeps all.
    pub features: Option<usize>,
    /// Probability of a keypoint above which a pixel can be one.
    pub detection_threshold: f32,
    /// Of two keypoints nearer than this along both axes, in pixels, the stronger stays.
    pub nms_radius: usize,
    /// Keypoints nearer than this to the border are dropped.
    pub border: usize,
}

impl Default for SuperPointParams {
    /// As released.
    fn default() -> Self {
        Self { features: None, detection_threshold: 0.005, nms_radius: 4, border: 4 }
    }
}

/// Convolution, `ReLU` unless it is the last, batch normalisation.
#[derive(Module, Debug)]
struct VggBlock {
    conv: Conv2d,
    bn: BatchNorm,
}

impl VggBlock {
    fn new(from: usize, to: usize, kernel: usize, device: &Device) -> Self {
        let pad = kernel / 2;
        let conv = Conv2dConfig::new([from, to], [kernel, kernel])
            .with_padding(PaddingConfig2d::Explicit(pad, pad, pad, pad))
            .init(device);
        Self { conv, bn: BatchNormConfig::new(to).with_epsilon(1e-3).init(device) }
    }

    fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        self.bn.forward(relu(self.conv.forward(x)))
    }

    fn forward_linear(&self, x: Tensor<4>) -> Tensor<4> {
        self.bn.forward(self.conv.forward(x))
    }
}

/// The network of SuperPoint.
#[derive(Module, Debug)]
pub struct SuperPointNet {
    backbone: Vec<Vec<VggBlock>>,
    detector: Vec<VggBlock>,
    descriptor: Vec<VggBlock>,
}

/// Dense outputs, at an eighth of the image's size.
#[derive(Clone, Debug)]
pub struct SuperPointMaps {
    /// `n × 256 × h/8 × w/8` descriptors of unit length.
    pub descriptors: Tensor<4>,
    /// `n × 65 × h/8 × w/8` logits of the 64 pixels of a cell and of "no keypoint".
    pub keypoint_logits: Tensor<4>,
}

impl SuperPointNet {
    /// The network with random weights.
    #[must_use]
    pub fn new(device: &Device) -> Self {
        let pair =
            |from, to| vec![VggBlock::new(from, to, 3, device), VggBlock::new(to, to, 3, device)];
        let head = |to| vec![VggBlock::new(128, 256, 3, device), VggBlock::new(256, to, 1, device)];
        Self {
            backbone: vec![pair(1, 64), pair(64, 64), pair(64, 128), pair(128, 128)],
            detector: head(65),
            descriptor: head(256),
        }
    }

    /// The network with published weights.
    ///
    /// # Errors
    ///
    /// Those of [`weights::load`].
    pub fn load(path: &Path, device: &Device) -> Result<Self> {
        let mut network = Self::new(device);
        weights::load(&mut network, path, &[])?;
        Ok(network)
    }

    /// Gray or RGB images, `n × 1 × h × w` or `n × 3 × h × w` from 0 to 1.
    #[must_use]
    pub fn forward(&self, images: Tensor<4>) -> SuperPointMaps {
        let mut x = luma(images);
        for (level, blocks) in self.backbone.iter().enumerate() {
            if level > 0 {
                x = max_pool2d(x, MaxPoolOptions::new([2, 2]).with_stride([2, 2]));
            }
            x = blocks.iter().fold(x, |x, block| block.forward(x));
        }
        let head = |blocks: &[VggBlock], x| blocks[1].forward_linear(blocks[0].forward(x));
        SuperPointMaps {
            keypoint_logits: head(&self.detector, x.clone()),
            descriptors: unit(head(&self.descriptor, x)),
        }
    }
}

/// Gray by ITU-R BT.601.
fn luma(images: Tensor<4>) -> Tensor<4> {
    if images.dims()[1] == 1 {
        return images;
    }
    let weights: Tensor<4> =
        Tensor::<1>::from_data([0.299_f32, 0.587, 0.114], &images.device()).reshape([1, 3, 1, 1]);
    (images * weights).sum_dim(1)
}

/// SuperPoint with its rule for keypoints.
#[derive(Debug)]
pub struct SuperPoint {
    network: SuperPointNet,
    params: SuperPointParams,
    device: Device,
}

impl SuperPoint {
    /// Finds keypoints by a network.
    #[must_use]
    pub fn new(network: SuperPointNet, params: SuperPointParams, device: Device) -> Self {
        Self { network, params, device }
    }

    /// The network.
    #[must_use]
    pub fn network(&self) -> &SuperPointNet {
        &self.network
    }
}

/// Pixels of the image per pixel of the maps.
const STRIDE: usize = 8;

impl Extractor for SuperPoint {
    fn name(&self) -> &'static str {
        "superpoint"
    }

    fn extract(&self, image: &RgbImage) -> vpr_core::Result<LocalFeatures> {
        extract(self, image)
    }
}

impl Detector for SuperPoint {
    fn device(&self) -> &Device {
        &self.device
    }

    /// Strongest first if there are more than `features`, otherwise in raster order, as released. Up to 7 rows and
    /// columns, below and to the right, are not seen.
    fn detect(&self, images: Tensor<4>) -> vpr_core::Result<Vec<LocalFeatures>> {
        let [_, _, height, width] = images.dims();
        check_size("SuperPoint needs at least 8 pixels on a side", [height, width], STRIDE)?;
        let maps = self.network.forward(images);
        let planes = Plane::from_tensor(pixels(maps.keypoint_logits));
        let maps = FeatureMap::from_tensor(maps.descriptors);
        planes.iter().zip(&maps).map(|(plane, map)| features(&self.peaks(plane), map)).collect()
    }
}

impl SuperPoint {
    fn peaks(&self, plane: &Plane) -> Vec<Peak> {
        let SuperPointParams { features, detection_threshold, nms_radius, border } = self.params;
        let mut peaks = repeated_maxima(plane, nms_radius, detection_threshold);
        let inside = |at: usize, len: usize| at >= border && at + border < len;
        peaks.retain(|it| inside(it.x, plane.width) && inside(it.y, plane.height));
        match features {
            Some(n) if n < peaks.len() => {
                by_score(&peaks).into_iter().take(n).map(|index| peaks[index]).collect()
            }
            _ => peaks,
        }
    }
}

fn features(peaks: &[Peak], map: &FeatureMap) -> vpr_core::Result<LocalFeatures> {
    let on_map = |at: usize| (at as f32 + 0.5) / STRIDE as f32 - 0.5;
    let rows = peaks
        .iter()
        .flat_map(|peak| map.sample([on_map(peak.x), on_map(peak.y)], Sampling::Bilinear))
        .collect();
    described(peaks, rows, map.channels(), [1.0; 2])
}
