//! Two-dimensional convolution.

use std::sync::{Arc, Mutex, PoisonError};

use burn::{
    backend::{Dispatch, DispatchTensorKind},
    config::Config,
    module::{Initializer, Module, Param},
    nn::{self, PaddingConfig2d},
    tensor::{Device, Tensor},
};
use rayon::prelude::*;

use super::{
    gradient::{Convolve, Sizes},
    kernel::{Activation, Finish, Geometry, Weights},
};
use crate::layer::memory::{InMemory, tensor};

/// Configuration of [`Conv2d`]; the defaults are those of `torch.nn.Conv2d`.
#[derive(Config, Debug)]
pub struct Conv2dConfig {
    /// Channels in and out.
    pub channels: [usize; 2],
    /// Height and width of the kernel.
    pub kernel_size: [usize; 2],
    /// Rows and columns from one output to the next.
    #[config(default = "[1, 1]")]
    pub stride: [usize; 2],
    /// Rows and columns between kernel elements.
    #[config(default = "[1, 1]")]
    pub dilation: [usize; 2],
    /// Blocks of channels that do not see each other.
    #[config(default = "1")]
    pub groups: usize,
    /// Zeros around the input.
    #[config(default = "PaddingConfig2d::Valid")]
    pub padding: PaddingConfig2d,
    /// Whether a bias is added.
    #[config(default = true)]
    pub bias: bool,
    /// First weights.
    #[config(
        default = "Initializer::KaimingUniform{gain: 0.577_350_269_189_625_8, fan_out_only: false}"
    )]
    pub initializer: Initializer,
}

/// A convolution over images, as `torch.nn.Conv2d` has it.
///
/// Where nothing records gradients and the tensors lie in memory it runs on kernels of our own,
/// otherwise on burn's; both give the same numbers up to rounding.
#[derive(Module, Debug)]
pub struct Conv2d {
    /// `[channels_out, channels_in / groups, height, width]`.
    pub weight: Param<Tensor<4>>,
    /// `[channels_out]`.
    pub bias: Option<Param<Tensor<1>>>,
    /// Rows and columns from one output to the next.
    pub stride: [usize; 2],
    /// Height and width of the kernel.
    pub kernel_size: [usize; 2],
    /// Rows and columns between kernel elements.
    pub dilation: [usize; 2],
    /// Blocks of channels that do not see each other.
    pub groups: usize,
    /// Zeros around the input.
    #[module(skip)]
    pub padding: PaddingConfig2d,
    #[module(skip)]
    packed: Cache,
}

impl Conv2dConfig {
    /// A convolution with the initializer's weights.
    ///
    /// # Panics
    ///
    /// If `groups` does not divide both numbers of channels.
    #[must_use]
    pub fn init(&self, device: &Device) -> Conv2d {
        let layer = nn::conv::Conv2dConfig::new(self.channels, self.kernel_size)
            .with_stride(self.stride)
            .with_dilation(self.dilation)
            .with_groups(self.groups)
            .with_padding(self.padding.clone())
            .with_bias(self.bias)
            .with_initializer(self.initializer.clone())
            .init(device);
        Conv2d {
            weight: layer.weight,
            bias: layer.bias,
            stride: layer.stride,
            kernel_size: layer.kernel_size,
            dilation: layer.dilation,
            groups: layer.groups,
            padding: layer.padding,
            packed: Cache::default(),
        }
    }
}

/// Weights packed for the kernels, and which weights they were.
#[derive(Debug, Default)]
struct Cache(Mutex<Option<Arc<PackedWeights>>>);

/// A copied module packs anew: its weights may change.
impl Clone for Cache {
    fn clone(&self) -> Self {
        Self::default()
    }
}

/// Holds on to the weights it was made from, so that their memory is not reused for others.
#[derive(Debug)]
struct PackedWeights {
    source: InMemory,
    groups: Vec<Weights>,
}

impl Cache {
    fn get(&self, source: InMemory, n_groups: usize) -> Arc<PackedWeights> {
        let mut packed = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(packed) = packed.as_ref().filter(|it| it.source.is_same(&source)) {
            return Arc::clone(packed);
        }
        let groups = (0..n_groups).map(|_| Weights::default()).collect();
        Arc::clone(packed.insert(Arc::new(PackedWeights { source, groups })))
    }
}

/// Scale and shift per output channel, residual, activation.
#[derive(Clone, Debug, Default)]
pub(super) struct Last {
    pub(super) scale: Option<Vec<f32>>,
    pub(super) shift: Option<Vec<f32>>,
    pub(super) residual: Option<InMemory>,
    pub(super) activation: Activation,
}

impl Conv2d {
    /// Convolves a batch.
    ///
    /// # Shapes
    ///
    /// - input: `[images, channels_in, height, width]`
    /// - output: `[images, channels_out, height_out, width_out]`
    ///
    /// # Panics
    ///
    /// If the number of channels is wrong or the kernel does not fit into the padded input.
    #[must_use]
    pub fn forward(&self, input: Tensor<4>) -> Tensor<4> {
        if let Some(shift) = self.bias_values()
            && let Some(output) = self.fast(&input, &Last { shift: Some(shift), ..Last::default() })
        {
            return output;
        }
        if let Some(output) = self.recorded(&input) {
            return match &self.bias {
                Some(bias) => output + bias.val().reshape([1, -1, 1, 1]),
                None => output,
            };
        }
        self.as_burn().forward(input)
    }

    /// The kernels' way where gradients are recorded, without the bias, if it can be gone.
    fn recorded(&self, input: &Tensor<4>) -> Option<Tensor<4>> {
        let forward = self.geometry(input.dims()).filter(|_| self.groups == 1)?;
        let sizes = Sizes { forward, output: forward.output()? };
        let (input, weights) = (input.clone().into_dispatch(), self.weight.val().into_dispatch());
        let is_ours = is_recorded_here(&input.kind) && is_recorded_here(&weights.kind);
        is_ours.then(|| Tensor::from_dispatch(Dispatch::convolve(input, weights, sizes)))
    }

    /// The bias as numbers, zeros if there is none; `None` if it cannot be read here.
    pub(super) fn bias_values(&self) -> Option<Vec<f32>> {
        match &self.bias {
            Some(bias) => Some(InMemory::new(&bias.val())?.values().to_vec()),
            None => Some(vec![0.0; self.weight.dims()[0]]),
        }
    }

    /// The kernels' way, if it can be gone.
    pub(super) fn fast(&self, input: &Tensor<4>, last: &Last) -> Option<Tensor<4>> {
        let geometry = self.geometry(input.dims())?;
        let output = geometry.output()?;
        let read = InMemory::new(input)?;
        let packed = self.packed.get(InMemory::new(&self.weight.val())?, self.groups);
        let [n_images, ..] = geometry.input;
        let n_pixels = output[0] * output[1];
        let residual = last.residual.as_ref().map(InMemory::values);
        let part = |of: &Option<Vec<f32>>, group: usize| {
            of.as_ref().map(|it| it[group * geometry.n_out..][..geometry.n_out].to_vec())
        };
        let values = if self.groups == 1 {
            let finish = Finish {
                scale: last.scale.as_deref(),
                shift: last.shift.as_deref(),
                residual,
                activation: last.activation,
            };
            let weights = packed.source.values();
            packed.groups[0].convolve(read.values(), weights, &geometry, output, finish)
        } else {
            let per_weight = geometry.n_out * geometry.depth();
            let per_group = geometry.input[1] * geometry.input[2] * geometry.input[3];
            let convolve = |(group, weights): (usize, &Weights)| {
                let input = channels_of(read.values(), group, self.groups, per_group);
                let residual = residual
                    .map(|it| channels_of(it, group, self.groups, geometry.n_out * n_pixels));
                let (scale, shift) = (part(&last.scale, group), part(&last.shift, group));
                let finish = Finish {
                    scale: scale.as_deref(),
                    shift: shift.as_deref(),
                    residual: residual.as_deref(),
                    activation: last.activation,
                };
                let kernel = &packed.source.values()[group * per_weight..][..per_weight];
                weights.convolve(&input, kernel, &geometry, output, finish)
            };
            let groups: Vec<Vec<f32>> =
                packed.groups.par_iter().enumerate().map(convolve).collect();
            let per_image = geometry.n_out * n_pixels;
            let images = (0..n_images).flat_map(|image| {
                groups.iter().flat_map(move |it| &it[image * per_image..][..per_image])
            });
            images.copied().collect()
        };
        let shape = [n_images, geometry.n_out * self.groups, output[0], output[1]];
        Some(tensor(values, shape, &input.device()))
    }

    /// Sizes for the kernels; `None` where burn's convolution is as good (one channel per group)
    /// or must say what is wrong.
    fn geometry(&self, [n_images, n_channels, height, width]: [usize; 4]) -> Option<Geometry> {
        let [n_out, per_group, ..] = self.weight.dims();
        let is_depthwise = self.groups > 1 && per_group == 1;
        let fits = n_channels == per_group * self.groups && n_images * height * width > 0;
        if is_depthwise || !fits {
            return None;
        }
        let (before, after) = match &self.padding {
            PaddingConfig2d::Valid => ([0, 0], [0, 0]),
            PaddingConfig2d::Explicit(top, left, bottom, right) => {
                ([*top, *left], [*bottom, *right])
            }
            PaddingConfig2d::Same => return None,
        };
        Some(Geometry {
            input: [n_images, per_group, height, width],
            n_out: n_out / self.groups,
            kernel: self.kernel_size,
            stride: self.stride,
            before,
            after,
            dilation: self.dilation,
        })
    }

    /// burn's own layer with the same weights.
    fn as_burn(&self) -> nn::conv::Conv2d {
        nn::conv::Conv2d {
            weight: self.weight.clone(),
            bias: self.bias.clone(),
            stride: self.stride,
            kernel_size: self.kernel_size,
            dilation: self.dilation,
            groups: self.groups,
            padding: self.padding.clone(),
        }
    }
}

/// Whether a tensor lies in memory, recorded for gradients or not.
pub(super) fn is_recorded_here(kind: &DispatchTensorKind) -> bool {
    let inner: &DispatchTensorKind =
        if let DispatchTensorKind::Autodiff(inner) = kind { inner } else { kind };
    matches!(inner, DispatchTensorKind::Flex(_))
}

/// The channels of one group, of all images.
fn channels_of(values: &[f32], group: usize, n_groups: usize, per_group: usize) -> Vec<f32> {
    values.chunks_exact(per_group).skip(group).step_by(n_groups).flatten().copied().collect()
}

#[cfg(test)]
mod tests {
    use burn::tensor::Distribution;

    use super::*;

    #[test]
    fn our_kernels_equal_burns() {
        let device = Device::flex();
        let padding = PaddingConfig2d::Explicit(1, 2, 0, 1);
        for (channels, kernel, stride, groups) in [
            ([3, 8], [7, 7], [2, 2], 1),
            ([32, 40], [3, 3], [1, 1], 1),
            ([32, 48], [1, 1], [2, 1], 1),
            ([12, 18], [5, 3], [1, 2], 3),
            ([8, 8], [3, 3], [1, 1], 8),
        ] {
            let layer = Conv2dConfig::new(channels, kernel)
                .with_stride(stride)
                .with_groups(groups)
                .with_padding(padding.clone())
                .init(&device);
            let input =
                Tensor::random([2, channels[0], 19, 23], Distribution::Uniform(-1.0, 1.0), &device);
            let ours = layer.forward(input.clone());
            let burns = layer.as_burn().forward(input);
            assert_eq!(ours.dims(), burns.dims());
            let worst: f32 = (ours - burns).abs().max().into_scalar();
            assert!(worst < 1e-5, "{channels:?} {kernel:?}: {worst}");
        }
    }

    #[test]
    fn our_gradients_equal_burns() {
        let device = Device::flex().autodiff();
        let padding = PaddingConfig2d::Explicit(1, 2, 0, 1);
        for (channels, kernel, stride, dilation) in [
            ([3, 8], [7, 7], [2, 2], [1, 1]),
            ([32, 40], [3, 3], [1, 1], [1, 1]),
            ([20, 17], [1, 1], [2, 1], [1, 1]),
            ([12, 18], [2, 3], [3, 2], [2, 1]),
        ] {
            let layer = Conv2dConfig::new(channels, kernel)
                .with_stride(stride)
                .with_dilation(dilation)
                .with_padding(padding.clone())
                .init(&device);
            let uniform = Distribution::Uniform(-1.0, 1.0);
            let input =
                Tensor::<4>::random([2, channels[0], 19, 23], uniform, &device).require_grad();
            let outputs = [layer.forward(input.clone()), layer.as_burn().forward(input.clone())];
            let weighting = Tensor::random(outputs[0].dims(), uniform, &device);
            let [ours, burns] = outputs.map(|output| {
                let gradients = (output * weighting.clone()).sum().backward();
                let input = input.grad(&gradients).unwrap();
                let weight = layer.weight.val().grad(&gradients).unwrap();
                let bias = layer.bias.as_ref().unwrap().val().grad(&gradients).unwrap();
                (input, weight, bias)
            });
            let relative = |ours: Tensor<1>, burns: Tensor<1>| -> f32 {
                let error =
                    (ours - burns.clone()).powf_scalar(2.0).sum() / burns.powf_scalar(2.0).sum();
                error.sqrt().into_scalar()
            };
            for error in [
                relative(ours.0.flatten(0, 3), burns.0.flatten(0, 3)),
                relative(ours.1.flatten(0, 3), burns.1.flatten(0, 3)),
                relative(ours.2, burns.2),
            ] {
                assert!(error < 1e-5, "{channels:?} {kernel:?}: {error}");
            }
        }
    }

    #[test]
    fn new_weights_are_packed_anew() {
        let device = Device::flex();
        let mut layer = Conv2dConfig::new([16, 16], [3, 3]).init(&device);
        let input = Tensor::random([1, 16, 12, 12], Distribution::Uniform(-1.0, 1.0), &device);
        let before = layer.forward(input.clone());
        layer.weight = layer.weight.map(|weight| weight * 2.0);
        layer.bias = layer.bias.map(|bias| bias.map(|it| it * 2.0));
        let worst: f32 = (layer.forward(input) - before * 2.0).abs().max().into_scalar();
        assert!(worst < 1e-5, "{worst}");
    }
}
