//! The default network: a small residual trunk with a `GeM` head, trained on generated streets.
//!
//! Our own design, 0.45 M parameters. No layer looks across the batch, so a descriptor depends on
//! its image alone.

use std::path::Path;

use burn::{
    config::Config,
    module::{Module, Param},
    nn::{GroupNorm, GroupNormConfig, Linear, LinearConfig, PaddingConfig2d},
    store::{BurnToPyTorchAdapter, ModuleSnapshot, PyTorchToBurnAdapter, SafetensorsStore},
    tensor::{Device, Tensor, TensorData, activation::relu},
};
use ndarray::Array2;
use vpr_core::{Descriptors, Error, Result};

use crate::{
    layer::{Conv2d, Conv2dConfig},
    loss::MultiSimilarity,
    train::Trainable,
};

/// Width and height of the images it was trained on, pixels.
pub const INPUT: (usize, usize) = (128, 96);
/// Regions that every map is pooled over: the whole, its left, its middle and its right.
const REGIONS: usize = 4;
/// Keeps the logarithm of a generalised mean finite.
const GEM_EPSILON: f64 = 1e-6;

/// Sizes of the default network.
#[derive(Config, Debug)]
pub struct DefaultEncoderConfig {
    /// Channels after the first convolution and after each of the three stages.
    #[config(default = "[16, 32, 64, 128]")]
    pub widths: [usize; 4],
    /// Residual blocks of each stage.
    #[config(default = "[1, 1, 1]")]
    pub depths: [usize; 3],
    /// Length of a descriptor.
    #[config(default = 256)]
    pub dimension: usize,
}

/// From images to unit descriptors.
#[derive(Module, Debug)]
pub struct DefaultEncoder {
    trunk: Trunk,
    head: Linear,
}

/// Its convolutions and its pooling, without the projection: what other heads sit on.
#[derive(Module, Debug)]
pub struct Trunk {
    stem: Unit,
    stages: Vec<Stage>,
}

/// Halves the map, then residual blocks.
#[derive(Module, Debug)]
struct Stage {
    down: Unit,
    blocks: Vec<Block>,
}

#[derive(Module, Debug)]
struct Block {
    first: Unit,
    second: Unit,
}

/// A 3 × 3 convolution and its group normalisation.
#[derive(Module, Debug)]
struct Unit {
    conv: Conv2d,
    norm: GroupNorm,
}

impl DefaultEncoderConfig {
    /// A network with random weights.
    ///
    /// # Panics
    ///
    /// If a width is not a multiple of 8.
    #[must_use]
    pub fn init(&self, device: &Device) -> DefaultEncoder {
        let trunk = self.trunk(device);
        let head = LinearConfig::new(self.pooled(), self.dimension).init(device);
        DefaultEncoder { trunk, head }
    }

    /// Its trunk alone, with random weights.
    ///
    /// # Panics
    ///
    /// If a width is not a multiple of 8.
    #[must_use]
    pub fn trunk(&self, device: &Device) -> Trunk {
        let stages = self.widths.windows(2).zip(self.depths).map(|(widths, depth)| Stage {
            down: Unit::new(widths[0], widths[1], 2, device),
            blocks: (0..depth).map(|_| Block::new(widths[1], device)).collect(),
        });
        Trunk { stem: Unit::new(3, self.widths[0], 2, device), stages: stages.collect() }
    }

    /// Length of what the trunk's pooling gives: two maps, four regions each.
    #[must_use]
    pub fn pooled(&self) -> usize {
        REGIONS * (self.widths[2] + self.widths[3])
    }
}

impl DefaultEncoder {
    /// Describes images: `batch × 3 × height × width`, red, green, blue in 0 to 1, to
    /// `batch × dimension`, rows of length one. Trained at [`INPUT`]; any size of at least 16 runs.
    #[must_use]
    pub fn forward(&self, images: Tensor<4>) -> Tensor<2> {
        self.project(self.trunk.forward(images))
    }

    /// The projection of pooled features to unit descriptors.
    #[must_use]
    pub fn project(&self, pooled: Tensor<2>) -> Tensor<2> {
        unit_rows(self.head.forward(pooled))
    }

    /// Sets the projection so that these images' pooled features enter it with mean 0 and variance 1,
    /// feature by feature. Pooled features of random weights are nearly the same for all images;
    /// training would spend its first thousand steps on what they share.
    #[must_use]
    pub fn centred(mut self, images: Tensor<4>) -> Self {
        let pooled = self.trunk.forward(images).detach();
        let mean = pooled.clone().mean_dim(0);
        let deviation = (pooled - mean.clone()).square().mean_dim(0).sqrt() + 1e-3;
        let weight = self.head.weight.val().detach() / deviation.transpose();
        let bias = mean.matmul(weight.clone()).neg().flatten(0, 1);
        self.head.weight = Param::from_tensor(weight.detach());
        self.head.bias = Some(Param::from_tensor(bias.detach()));
        self
    }

    /// Reads weights as [`Self::save`] writes them.
    ///
    /// # Errors
    ///
    /// [`Error::Format`] with the file and the keys that are missing or mis-shaped.
    pub fn load(mut self, path: &Path) -> Result<Self> {
        let mut store = SafetensorsStore::from_file(path).with_from_adapter(PyTorchToBurnAdapter);
        let outcome = self.load_from(&mut store);
        outcome.map_err(|cause| Error::format(path, "weights", cause.to_string()))?;
        Ok(self)
    }

    /// Writes weights under `PyTorch`'s names and axes, with `metadata` beside them.
    ///
    /// # Errors
    ///
    /// [`Error::Format`] with the file.
    pub fn save(&self, path: &Path, metadata: &[(&str, &str)]) -> Result<()> {
        let store =
            SafetensorsStore::from_file(path).with_to_adapter(BurnToPyTorchAdapter).overwrite(true);
        let mut store =
            metadata.iter().fold(store, |store, (key, value)| store.metadata(*key, *value));
        self.save_into(&mut store)
            .map_err(|cause| Error::format(path, "weights", cause.to_string()))
    }

    /// Describes images without tensors: `images` holds `n × 3 × height × width` values in 0 to
    /// 1, `size` is width and height. `batch` images go through the network at a time.
    ///
    /// # Errors
    ///
    /// [`Error::Format`] if a descriptor is not finite.
    pub fn describe(
        &self,
        images: &[f32],
        size: (usize, usize),
        batch: usize,
    ) -> Result<Descriptors> {
        let each = 3 * size.0 * size.1;
        let network = self.clone().valid();
        let mut values = Vec::new();
        for part in images.chunks(each * batch) {
            let shape = [part.len() / each, 3, size.1, size.0];
            let images = Tensor::from_data(TensorData::new(part.to_vec(), shape), &Device::flex());
            let rows = network.forward(images).into_data();
            values.extend(rows.iter::<f32>());
        }
        let shape = (images.len() / each, self.dimension());
        let rows = Array2::from_shape_vec(shape, values)
            .map_err(|cause| Error::format("images", "shape", cause.to_string()))?;
        Descriptors::new(rows)
    }

    /// The convolutions and the pooling.
    #[must_use]
    pub fn trunk(&self) -> &Trunk {
        &self.trunk
    }

    /// Length of a descriptor.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.head.weight.dims()[1]
    }
}

impl Trainable for DefaultEncoder {
    fn loss(&self, images: Tensor<4>, places: &[usize]) -> Tensor<1> {
        MultiSimilarity::default().forward(self.forward(images), places)
    }
}

impl Trunk {
    /// Pools images as [`DefaultEncoder::forward`] takes them to `batch × pooled` features.
    #[must_use]
    pub fn forward(&self, images: Tensor<4>) -> Tensor<2> {
        let mut map = relu(self.stem.forward(standardized(images)));
        let mut pooled = Vec::new();
        for (number, stage) in self.stages.iter().enumerate() {
            map = stage.forward(map);
            if number + 2 >= self.stages.len() {
                pooled.push(gem(map.clone()));
            }
        }
        Tensor::cat(pooled, 1)
    }
}

impl Stage {
    fn forward(&self, map: Tensor<4>) -> Tensor<4> {
        let map = relu(self.down.forward(map));
        self.blocks.iter().fold(map, |map, block| block.forward(map))
    }
}

impl Block {
    fn new(width: usize, device: &Device) -> Self {
        Self {
            first: Unit::new(width, width, 1, device),
            second: Unit::new(width, width, 1, device),
        }
    }

    fn forward(&self, map: Tensor<4>) -> Tensor<4> {
        let inner = relu(self.first.forward(map.clone()));
        relu(map + self.second.forward(inner))
    }
}

impl Unit {
    fn new(from: usize, to: usize, stride: usize, device: &Device) -> Self {
        let conv = Conv2dConfig::new([from, to], [3, 3])
            .with_stride([stride, stride])
            .with_padding(PaddingConfig2d::Explicit(1, 1, 1, 1))
            .with_bias(false);
        Self { conv: conv.init(device), norm: GroupNormConfig::new(to / 8, to).init(device) }
    }

    fn forward(&self, map: Tensor<4>) -> Tensor<4> {
        self.norm.forward(self.conv.forward(map))
    }
}

/// Every channel of every image with mean 0 and variance 1: exposure and colour of the light are
/// gone before the first layer.
fn standardized(images: Tensor<4>) -> Tensor<4> {
    let [batch, channels, height, width] = images.dims();
    let flat = images.reshape([batch, channels, height * width]);
    let centred = flat.clone() - flat.mean_dim(2);
    let variance = centred.clone().square().mean_dim(2);
    (centred / (variance + 1e-4).sqrt()).reshape([batch, channels, height, width])
}

/// Generalised mean with exponent 3 (Radenović, Tolias and Chum 2019) over four regions of a
/// non-negative map: `batch × channels × height × width` to `batch × 4 channels`.
fn gem(map: Tensor<4>) -> Tensor<2> {
    let [batch, channels, height, width] = map.dims();
    let regions = regions(height, width, &map.device());
    let flat = map.reshape([batch, channels, height * width]);
    let cubes = flat.clone() * flat.clone() * flat;
    let means = cubes.matmul(regions.unsqueeze());
    ((means + GEM_EPSILON).log() / 3.0).exp().reshape([batch, channels * REGIONS])
}

/// Weights of the pixels in each region, `pixels × regions`, columns of sum one: all alike, and
/// triangles over the width around the left edge, the middle and the right edge.
fn regions(height: usize, width: usize, device: &Device) -> Tensor<2> {
    let weight = |column: usize, region: usize| {
        let across = (column as f32 + 0.5) / width as f32;
        if region == 0 {
            1.0
        } else {
            (1.0 - (2.0 * across - (region as f32 - 1.0)).abs()).max(0.0)
        }
    };
    let totals: Vec<f32> = (0..REGIONS)
        .map(|region| height as f32 * (0..width).map(|column| weight(column, region)).sum::<f32>())
        .collect();
    let weights: Vec<f32> = (0..height * width)
        .flat_map(|pixel| (0..REGIONS).map(move |region| (pixel % width, region)))
        .map(|(column, region)| weight(column, region) / totals[region])
        .collect();
    Tensor::from_data(TensorData::new(weights, [height * width, REGIONS]), device)
}

fn unit_rows(rows: Tensor<2>) -> Tensor<2> {
    let length = (rows.clone().square().sum_dim(1) + 1e-12).sqrt();
    rows / length
}

#[cfg(test)]
mod tests {
    use burn::tensor::Distribution;

    use super::*;

    fn images(n: usize) -> Tensor<4> {
        let device = Device::flex();
        device.seed(3);
        Tensor::random([n, 3, INPUT.1, INPUT.0], Distribution::Default, &device)
    }

    #[test]
    fn descriptors_have_length_one_and_ignore_the_rest_of_the_batch() {
        let network = DefaultEncoderConfig::new().init(&Device::flex());
        let images = images(3);
        let together = network.forward(images.clone());
        assert_eq!(together.dims(), [3, network.dimension()]);
        let lengths: Vec<f32> =
            together.clone().square().sum_dim(1).into_data().try_to_vec().unwrap();
        assert!(lengths.iter().all(|length| (length - 1.0).abs() < 1e-4), "{lengths:?}");
        let alone = network.forward(images.slice(1..2));
        let gap: f32 = (together.slice(1..2) - alone).abs().max().into_scalar();
        assert!(gap < 1e-5, "{gap}");
    }

    #[test]
    fn brighter_images_under_coloured_light_keep_their_descriptors() {
        let network = DefaultEncoderConfig::new().init(&Device::flex());
        let images = images(1);
        let gains = Tensor::<1>::from_floats([0.9, 0.6, 0.4], &Device::flex());
        let coloured = images.clone() * gains.reshape([1, 3, 1, 1]) + 0.05;
        let gap: f32 =
            (network.forward(images) - network.forward(coloured)).abs().max().into_scalar();
        assert!(gap < 1e-2, "{gap}");
    }

    #[test]
    fn centring_takes_away_what_all_images_share() {
        let network = DefaultEncoderConfig::new().init(&Device::flex());
        let images = images(8);
        let mean_similarity = |network: &DefaultEncoder| -> f32 {
            network.forward(images.clone()).mean_dim(0).square().sum().into_scalar()
        };
        assert!(mean_similarity(&network) > 0.5);
        let centred = network.clone().centred(images.clone());
        assert!(mean_similarity(&centred) < 0.2);
    }

    #[test]
    fn regions_weigh_every_pixel_and_sum_to_one() {
        let weights: Vec<f32> = regions(2, 4, &Device::flex()).into_data().try_to_vec().unwrap();
        for region in 0..REGIONS {
            let sum: f32 = weights.iter().skip(region).step_by(REGIONS).sum();
            assert!((sum - 1.0).abs() < 1e-6);
        }
        // First pixel: an eighth of the whole, most of the left, nothing of the right.
        assert!((weights[0] - 0.125).abs() < 1e-6 && weights[1] > 0.3 && weights[3] == 0.0);
    }
}
