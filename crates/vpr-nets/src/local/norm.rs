//! Normalisations without parameters of their own.

use burn::{
    module::{Module, RunningState},
    tensor::{Device, Tensor, module::batch_norm},
};

/// Batch normalisation at inference without scale and shift: `(x − running_mean) / √(running_var + ε)`.
#[derive(Module, Debug)]
pub(super) struct Standardize {
    running_mean: RunningState<Tensor<1>>,
    running_var: RunningState<Tensor<1>>,
}

/// PyTorch's default.
const EPSILON: f64 = 1e-5;

impl Standardize {
    pub(super) fn new(channels: usize, device: &Device) -> Self {
        Self {
            running_mean: RunningState::new(Tensor::zeros([channels], device)),
            running_var: RunningState::new(Tensor::ones([channels], device)),
        }
    }

    /// `n × channels × …`, same shape.
    pub(super) fn forward<const D: usize>(&self, x: Tensor<D>) -> Tensor<D> {
        let (mean, var) = (self.running_mean.value(), self.running_var.value());
        let (ones, zeros) = (mean.ones_like(), mean.zeros_like());
        batch_norm(x, ones, zeros, mean, var, EPSILON)
    }
}

/// Instance normalisation: every channel of every image gets mean 0 and variance 1.
pub(super) fn instance_norm(x: Tensor<4>) -> Tensor<4> {
    let centred = x.clone() - x.mean_dims(&[2, 3]);
    let variance = centred.clone().square().mean_dims(&[2, 3]);
    centred / (variance + EPSILON).sqrt()
}
