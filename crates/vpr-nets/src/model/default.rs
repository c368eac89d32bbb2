//! The default network: a small residual trunk whose last map is pooled on a coarse grid, trained
//! on generated streets.
//!
//! Our own design, 0.65 M parameters. No layer looks across the batch, so a descriptor depends on
//! its image alone. The grid keeps where in the image a thing is; a mean over the whole map does
//! not, and finds fewer places.

use std::path::Path;

use burn::{
    config::Config,
    module::{Module, Param},
    nn::{GroupNorm, GroupNormConfig, Linear, LinearConfig, PaddingConfig2d},
    store::{ModuleSnapshot, PyTorchToBurnAdapter, SafetensorsStore},
    tensor::{Device, Tensor, TensorData, activation::relu, module::adaptive_avg_pool2d},
};
use ndarray::Array2;
use vpr_core::{Descriptors, Error, Result};

use super::Describe;
use crate::{
    layer::{Conv2d, Conv2dConfig, group_norm, l2_normalize_rows, linear, standardize},
    loss::SupervisedContrastive,
    train::{Affine, Trainable},
    weights::{self, Precision},
};

/// Width and height of the images it was trained on, pixels.
pub const INPUT: (usize, usize) = (128, 96);
/// Rows and columns of the grid that the last map is pooled to.
const GRID: [usize; 2] = [3, 4];

/// Sizes of the default network.
#[derive(Config, Debug)]
pub struct DefaultEncoderConfig {
    /// Channels after the first convolution and after each of the three stages.
    #[config(default = "[32, 32, 64, 128]")]
    pub widths: [usize; 4],
    /// Residual blocks of each stage.
    #[config(default = "[1, 1, 1]")]
    pub depths: [usize; 3],
    /// Channels of the grid.
    #[config(default = 48)]
    pub reduced: usize,
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
    reduce: Conv2d,
}

/// Changes the width, halves the map except in the first stage, then residual blocks.
#[derive(Module, Debug)]
struct Stage {
    enter: Unit,
    blocks: Vec<Block>,
}

#[derive(Module, Debug)]
struct Block {
    first: Unit,
    second: Unit,
}

/// A convolution and its group normalisation.
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
        let stages = self.widths.windows(2).zip(self.depths).enumerate();
        let stages = stages.map(|(number, (widths, depth))| Stage {
            enter: Unit::new([widths[0], widths[1]], 3, if number == 0 { 1 } else { 2 }, device),
            blocks: (0..depth).map(|_| Block::new(widths[1], device)).collect(),
        });
        let reduce = Conv2dConfig::new([self.widths[3], self.reduced], [1, 1]).with_bias(false);
        Trunk {
            stem: Unit::new([3, self.widths[0]], 7, 4, device),
            stages: stages.collect(),
            reduce: reduce.init(device),
        }
    }

    /// Length of what the trunk's pooling gives.
    #[must_use]
    pub fn pooled(&self) -> usize {
        self.reduced * GRID[0] * GRID[1]
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
        l2_normalize_rows(linear(&self.head, pooled))
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

    /// Writes weights under `PyTorch`'s names and axes, with `facts` beside them, as
    /// [`weights::save`].
    ///
    /// # Errors
    ///
    /// [`Error::Format`] and [`Error::Io`] with the file.
    pub fn save(&self, path: &Path, facts: &[(&str, String)]) -> Result<()> {
        Ok(weights::save(self, path, facts, Precision::Single)?)
    }

    /// Describes images without tensors: `images` holds `n × 3 × height × width` values in 0 to
    /// 1, `size` is width and height. `batch` images go through the network at a time.
    ///
    /// # Errors
    ///
    /// [`Error::Format`] if the images are not of that size; [`Error::NotFinite`].
    pub fn describe(
        &self,
        images: &[f32],
        size: (usize, usize),
        batch: usize,
    ) -> Result<Descriptors> {
        let network = self.clone().valid();
        Descriptors::new(rows(images, size, batch, |images| network.forward(images))?)
    }

    /// The trunk's features of images given as to [`Self::describe`], `n × pooled`.
    ///
    /// # Errors
    ///
    /// [`Error::Format`] if the images are not of that size.
    pub fn pooled(
        &self,
        images: &[f32],
        size: (usize, usize),
        batch: usize,
    ) -> Result<Array2<f32>> {
        let trunk = self.trunk.clone().valid();
        rows(images, size, batch, |images| trunk.forward(images))
    }

    /// The same trunk under another projection, such as [`crate::train::learned_whitening`] gives.
    ///
    /// # Errors
    ///
    /// [`Error::Mismatch`] if it does not take what the trunk gives.
    pub fn with_projection(mut self, projection: &Affine) -> Result<Self> {
        let [expected, _] = self.head.weight.dims();
        let (actual, to) = projection.weight.dim();
        if actual != expected {
            return Err(Error::Mismatch { what: "features of a projection", expected, actual });
        }
        let device = self.head.weight.device();
        let weight = projection.weight.iter().copied().collect::<Vec<f32>>();
        let weight = TensorData::new(weight, [actual, to]);
        self.head.weight = Param::from_tensor(Tensor::from_data(weight, &device));
        let bias = TensorData::new(projection.bias.to_vec(), [to]);
        self.head.bias = Some(Param::from_tensor(Tensor::from_data(bias, &device)));
        Ok(self)
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

impl Describe for DefaultEncoder {
    fn describe(&self, images: Tensor<4>) -> Tensor<2> {
        self.forward(images)
    }
}

impl Trainable for DefaultEncoder {
    fn loss(&self, images: Tensor<4>, places: &[usize]) -> Tensor<1> {
        SupervisedContrastive::default().forward(self.forward(images), places)
    }
}

impl Trunk {
    /// Images as [`DefaultEncoder::forward`] takes them to `batch × pooled` features: every channel
    /// of the grid, row by row.
    ///
    /// Exposure and colour of the light are gone before the first layer: every channel enters with
    /// mean 0 and variance 1.
    #[must_use]
    pub fn forward(&self, images: Tensor<4>) -> Tensor<2> {
        adaptive_avg_pool2d(self.reduce.forward(self.last_map(images)), GRID).flatten(1, 3)
    }

    /// Its last map, which [`Self::forward`] reduces and pools: `batch × channels × height / 16 ×
    /// width / 16`, none below zero.
    #[must_use]
    pub fn last_map(&self, images: Tensor<4>) -> Tensor<4> {
        let map = relu(self.stem.forward(standardize(images, 1e-4)));
        self.stages.iter().fold(map, |map, stage| stage.forward(map))
    }

    /// Channels of [`Self::last_map`].
    #[must_use]
    pub fn channels(&self) -> usize {
        self.reduce.weight.dims()[1]
    }
}

impl Stage {
    fn forward(&self, map: Tensor<4>) -> Tensor<4> {
        let map = relu(self.enter.forward(map));
        self.blocks.iter().fold(map, |map, block| block.forward(map))
    }
}

impl Block {
    fn new(width: usize, device: &Device) -> Self {
        Self {
            first: Unit::new([width, width], 3, 1, device),
            second: Unit::new([width, width], 3, 1, device),
        }
    }

    fn forward(&self, map: Tensor<4>) -> Tensor<4> {
        let inner = relu(self.first.forward(map.clone()));
        relu(map + self.second.forward(inner))
    }
}

impl Unit {
    fn new(channels: [usize; 2], kernel: usize, stride: usize, device: &Device) -> Self {
        let (side, width) = (kernel / 2, channels[1]);
        let conv = Conv2dConfig::new(channels, [kernel, kernel])
            .with_stride([stride, stride])
            .with_padding(PaddingConfig2d::Explicit(side, side, side, side))
            .with_bias(false);
        Self { conv: conv.init(device), norm: GroupNormConfig::new(width / 8, width).init(device) }
    }

    fn forward(&self, map: Tensor<4>) -> Tensor<4> {
        group_norm(&self.norm, self.conv.forward(map))
    }
}

/// What `forward` makes of images, a batch at a time.
pub(super) fn rows(
    images: &[f32],
    size: (usize, usize),
    batch: usize,
    forward: impl Fn(Tensor<4>) -> Tensor<2>,
) -> Result<Array2<f32>> {
    let each = 3 * size.0 * size.1;
    let mut values = Vec::new();
    for part in images.chunks(each * batch.max(1)) {
        let shape = [part.len() / each, 3, size.1, size.0];
        let images = Tensor::from_data(TensorData::new(part.to_vec(), shape), &Device::flex());
        values.extend(forward(images).into_data().iter::<f32>());
    }
    let n = images.len() / each;
    Array2::from_shape_vec((n, values.len() / n.max(1)), values)
        .map_err(|cause| Error::format("images", "shape", cause.to_string()))
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
}
