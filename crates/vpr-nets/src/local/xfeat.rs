//! XFeat: accelerated features.
//!
//! Potje et al., *XFeat: Accelerated Features for Lightweight Image Matching*, CVPR 2024;
//! <https://github.com/verlab/accelerated_features>. Keys are those of its `xfeat.pt`.

use std::path::Path;

use burn::{
    module::Module,
    nn::{Linear, LinearConfig, PaddingConfig2d},
    tensor::{
        Device, Tensor,
        activation::{relu, sigmoid, softmax},
        module::{avg_pool2d, interpolate},
        ops::{AvgPoolOptions, InterpolateMode, InterpolateOptions},
    },
};
use serde::{Deserialize, Serialize};
use vpr_vision::{
    features::{Extractor, LocalFeatures},
    image::RgbImage,
};

use super::{
    Detector, check_size, extract,
    map::{FeatureMap, Plane, Sampling},
    norm::{Standardize, instance_norm},
    peaks::{Peak, by_score, described, maxima},
};
use crate::{
    Result,
    layer::{Conv2d, Conv2dConfig},
    weights,
};

/// Which keypoints are kept.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct XFeatParams {
    /// At most this many, the strongest.
    pub features: usize,
    /// Probability of a keypoint above which a pixel can be one.
    pub detection_threshold: f32,
}

impl Default for XFeatParams {
    /// As released.
    fn default() -> Self {
        Self { features: 4096, detection_threshold: 0.05 }
    }
}

/// Convolution, standardisation, `ReLU`.
#[derive(Module, Debug)]
struct BasicLayer {
    conv: Conv2d,
    norm: Standardize,
}

impl BasicLayer {
    fn new([from, to]: [usize; 2], kernel: usize, stride: usize, device: &Device) -> Self {
        let pad = kernel / 2;
        let conv = Conv2dConfig::new([from, to], [kernel, kernel])
            .with_stride([stride, stride])
            .with_padding(PaddingConfig2d::Explicit(pad, pad, pad, pad))
            .with_bias(false)
            .init(device);
        Self { conv, norm: Standardize::new(to, device) }
    }

    fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        relu(self.norm.forward(self.conv.forward(x)))
    }
}

fn chain(layers: &[BasicLayer], x: Tensor<4>) -> Tensor<4> {
    layers.iter().fold(x, |x, layer| layer.forward(x))
}

/// A linear layer of the fine matcher and the standardisation behind all but the last.
#[derive(Module, Debug)]
struct FineLayer {
    linear: Linear,
    norm: Option<Standardize>,
}

/// The network of XFeat.
#[derive(Module, Debug)]
pub struct XFeatNet {
    skip1: Conv2d,
    block1: Vec<BasicLayer>,
    block2: Vec<BasicLayer>,
    block3: Vec<BasicLayer>,
    block4: Vec<BasicLayer>,
    block5: Vec<BasicLayer>,
    block_fusion: Vec<BasicLayer>,
    fusion_out: Conv2d,
    heatmap_head: Vec<BasicLayer>,
    heatmap_out: Conv2d,
    keypoint_head: Vec<BasicLayer>,
    keypoint_out: Conv2d,
    fine_matcher: Vec<FineLayer>,
}

/// Dense outputs, at an eighth of the image's size.
#[derive(Clone, Debug)]
pub struct XFeatMaps {
    /// `n × 64 × h/8 × w/8` descriptors, not normalised.
    pub features: Tensor<4>,
    /// `n × 65 × h/8 × w/8` logits of the 64 pixels of a cell and of "no keypoint".
    pub keypoint_logits: Tensor<4>,
    /// `n × 1 × h/8 × w/8` probabilities that a match will be right.
    pub reliability: Tensor<4>,
}

/// From the keys of `xfeat.pt` to those of [`XFeatNet`].
const RENAMES: &[(&str, &str)] = &[
    (r"^skip1\.1\.", "skip1."),
    (r"^block_fusion\.2\.", "fusion_out."),
    (r"^heatmap_head\.2\.", "heatmap_out."),
    (r"^keypoint_head\.3\.", "keypoint_out."),
    (r"\.layer\.0\.", ".conv."),
    (r"\.layer\.1\.", ".norm."),
    (r"^fine_matcher\.0\.", "fine_matcher.a.linear."),
    (r"^fine_matcher\.1\.", "fine_matcher.a.norm."),
    (r"^fine_matcher\.3\.", "fine_matcher.b.linear."),
    (r"^fine_matcher\.4\.", "fine_matcher.b.norm."),
    (r"^fine_matcher\.6\.", "fine_matcher.c.linear."),
    (r"^fine_matcher\.7\.", "fine_matcher.c.norm."),
    (r"^fine_matcher\.9\.", "fine_matcher.d.linear."),
    (r"^fine_matcher\.10\.", "fine_matcher.d.norm."),
    (r"^fine_matcher\.12\.", "fine_matcher.e.linear."),
    (r"^fine_matcher\.a\.", "fine_matcher.0."),
    (r"^fine_matcher\.b\.", "fine_matcher.1."),
    (r"^fine_matcher\.c\.", "fine_matcher.2."),
    (r"^fine_matcher\.d\.", "fine_matcher.3."),
    (r"^fine_matcher\.e\.", "fine_matcher.4."),
];

impl XFeatNet {
    /// The network with random weights.
    #[must_use]
    pub fn new(device: &Device) -> Self {
        let layer = |channels, kernel, stride| BasicLayer::new(channels, kernel, stride, device);
        let point = |from, to| Conv2dConfig::new([from, to], [1, 1]).init(device);
        let same = |n: usize, kernel: usize| (0..n).map(|_| layer([64, 64], kernel, 1)).collect();
        let fine = |[from, to]: [usize; 2], last: bool| FineLayer {
            linear: LinearConfig::new(from, to).init(device),
            norm: (!last).then(|| Standardize::new(to, device)),
        };
        Self {
            skip1: point(1, 24),
            block1: vec![
                layer([1, 4], 3, 1),
                layer([4, 8], 3, 2),
                layer([8, 8], 3, 1),
                layer([8, 24], 3, 2),
            ],
            block2: vec![layer([24, 24], 3, 1), layer([24, 24], 3, 1)],
            block3: vec![layer([24, 64], 3, 2), layer([64, 64], 3, 1), layer([64, 64], 1, 1)],
            block4: vec![layer([64, 64], 3, 2), layer([64, 64], 3, 1), layer([64, 64], 3, 1)],
            block5: vec![
                layer([64, 128], 3, 2),
                layer([128, 128], 3, 1),
                layer([128, 128], 3, 1),
                layer([128, 64], 1, 1),
            ],
            block_fusion: same(2, 3),
            fusion_out: point(64, 64),
            heatmap_head: same(2, 1),
            heatmap_out: point(64, 1),
            keypoint_head: same(3, 1),
            keypoint_out: point(64, 65),
            fine_matcher: vec![
                fine([128, 512], false),
                fine([512, 512], false),
                fine([512, 512], false),
                fine([512, 512], false),
                fine([512, 64], true),
            ],
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

    /// Images, `n × channels × h × w` with h and w multiples of 32; channels are averaged.
    #[must_use]
    pub fn forward(&self, images: Tensor<4>) -> XFeatMaps {
        let x = instance_norm(images.mean_dim(1));
        let quarter = avg_pool2d(x.clone(), AvgPoolOptions::new([4, 4]).with_stride([4, 4]));
        let skip = self.skip1.forward(quarter);
        let x1 = chain(&self.block1, x.clone());
        let x2 = chain(&self.block2, x1 + skip);
        let x3 = chain(&self.block3, x2);
        let x4 = chain(&self.block4, x3.clone());
        let x5 = chain(&self.block5, x4.clone());
        let [_, _, height, width] = x3.dims();
        let x4 = resize(x4, [height, width]);
        let x5 = resize(x5, [height, width]);
        let features = self.fusion_out.forward(chain(&self.block_fusion, x3 + x4 + x5));
        let reliability = self.heatmap_out.forward(chain(&self.heatmap_head, features.clone()));
        let cells = chain(&self.keypoint_head, cells(x));
        let keypoint_logits = self.keypoint_out.forward(cells);
        XFeatMaps { features, keypoint_logits, reliability: sigmoid(reliability) }
    }

    /// Where in an 8 × 8 window a coarse match ends, for `XFeat*`: logits, `n × 64`, of pairs of descriptors,
    /// `n × 128`.
    #[must_use]
    pub fn fine_offsets(&self, pairs: Tensor<2>) -> Tensor<2> {
        self.fine_matcher.iter().fold(pairs, |x, layer| {
            let x = layer.linear.forward(x);
            layer.norm.iter().fold(x, |x, norm| relu(norm.forward(x)))
        })
    }
}

/// Bilinear, without antialiasing, pixels aligned by their areas.
fn resize(x: Tensor<4>, size: [usize; 2]) -> Tensor<4> {
    let options = InterpolateOptions::new(InterpolateMode::Bilinear)
        .with_align_corners(false)
        .with_output_size(size);
    interpolate(x, options)
}

/// The 64 pixels of a cell of 8 × 8 become channels: `n × 1 × h × w` to `n × 64 × h/8 × w/8`.
fn cells(x: Tensor<4>) -> Tensor<4> {
    let [n, _, height, width] = x.dims();
    let (rows, columns) = (height / 8, width / 8);
    let x: Tensor<5> = x.reshape([n, rows, 8, columns, 8]);
    x.permute([0, 2, 4, 1, 3]).reshape([n, 64, rows, columns])
}

/// The inverse of [`cells`] for the first 64 channels of probabilities.
pub(super) fn pixels(logits: Tensor<4>) -> Tensor<4> {
    let [n, _, rows, columns] = logits.dims();
    let x = softmax(logits, 1).narrow(1, 0, 64);
    let x: Tensor<5> = x.reshape([n, 8, 8, rows, columns]);
    x.permute([0, 3, 1, 4, 2]).reshape([n, 1, 8 * rows, 8 * columns])
}

/// XFeat with its rule for keypoints.
#[derive(Debug)]
pub struct XFeat {
    network: XFeatNet,
    params: XFeatParams,
    device: Device,
}

impl XFeat {
    /// Finds keypoints by a network.
    #[must_use]
    pub fn new(network: XFeatNet, params: XFeatParams, device: Device) -> Self {
        Self { network, params, device }
    }

    /// The network.
    #[must_use]
    pub fn network(&self) -> &XFeatNet {
        &self.network
    }
}

impl Extractor for XFeat {
    fn name(&self) -> &'static str {
        "xfeat"
    }

    fn extract(&self, image: &RgbImage) -> vpr_core::Result<LocalFeatures> {
        extract(self, image)
    }
}

impl Detector for XFeat {
    fn device(&self) -> &Device {
        &self.device
    }

    /// Images are resized to multiples of 32 as the released code does, and keypoints are scaled back. Strongest
    /// first.
    fn detect(&self, images: Tensor<4>) -> vpr_core::Result<Vec<LocalFeatures>> {
        let [_, _, height, width] = images.dims();
        check_size("XFeat needs at least 32 pixels on a side", [height, width], 32)?;
        let inner = [height / 32 * 32, width / 32 * 32];
        let images = if inner == [height, width] { images } else { resize(images, inner) };
        let maps = self.network.forward(images);
        let scale = [width as f32 / inner[1] as f32, height as f32 / inner[0] as f32];
        let probabilities = Plane::from_tensor(pixels(maps.keypoint_logits));
        let reliabilities = Plane::from_tensor(maps.reliability);
        let descriptors = FeatureMap::from_tensor(unit(maps.features));
        probabilities
            .iter()
            .zip(&reliabilities)
            .zip(&descriptors)
            .map(|((probability, reliability), map)| {
                let peaks = self.peaks(probability, reliability);
                features(&peaks, probability, map, scale)
            })
            .collect()
    }
}

impl XFeat {
    /// The strongest maxima with their score, probability times reliability.
    fn peaks(&self, probability: &Plane, reliability: &Plane) -> Vec<Peak> {
        let mut peaks = maxima(probability, 2, self.params.detection_threshold);
        // The released code pads its lists with (0, 0) and so never keeps that pixel.
        peaks.retain(|it| (it.x, it.y) != (0, 0));
        for peak in &mut peaks {
            let on = |plane: &Plane| position(peak, probability, [plane.width, plane.height]);
            peak.score =
                probability.nearest(on(probability)) * reliability.bilinear(on(reliability));
        }
        let mut order = by_score(&peaks);
        order.truncate(self.params.features);
        order.into_iter().map(|index| peaks[index]).filter(|it| it.score > 0.0).collect()
    }
}

/// Where a pixel of the image lies on a map of `size`: PyTorch's `grid_sample` of coordinates that the released code
/// divides by (w − 1, h − 1), in the same order of operations.
fn position(peak: &Peak, image: &Plane, size: [usize; 2]) -> [f32; 2] {
    let at = |value: usize, image: usize, map: usize| {
        let grid = 2.0 * (value as f32 / (image - 1) as f32) - 1.0;
        ((grid + 1.0) * map as f32 - 1.0) / 2.0
    };
    [at(peak.x, image.width, size[0]), at(peak.y, image.height, size[1])]
}

/// Unit length over channels.
pub(super) fn unit(x: Tensor<4>) -> Tensor<4> {
    let length = x.clone().square().sum_dim(1).sqrt().clamp_min(1e-12);
    x / length
}

fn features(
    peaks: &[Peak],
    image: &Plane,
    map: &FeatureMap,
    scale: [f32; 2],
) -> vpr_core::Result<LocalFeatures> {
    let size = map.size();
    let rows =
        peaks.iter().flat_map(|peak| map.sample(position(peak, image, size), Sampling::Bicubic));
    described(peaks, rows.collect(), map.channels(), scale)
}
