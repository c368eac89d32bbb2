//! Convolution, batch normalisation, residual and activation in one pass.

use burn::{
    nn::BatchNorm,
    tensor::{Tensor, activation::relu},
};

use super::{Activation, Conv2d, conv2d::Last, normalize::batch_norm};
use crate::layer::memory::InMemory;

/// `activation(norm(conv(input)) + residual)`.
///
/// Without gradients this is one pass over the output: the normalisation by running statistics
/// becomes a factor and a term per channel. On an autodiff device it is the layers one by one,
/// and `norm` uses the batch's statistics if it is in training.
///
/// # Shapes
///
/// - input: `[images, channels_in, height, width]`
/// - residual, output: `[images, channels_out, height_out, width_out]`
///
/// # Panics
///
/// As [`Conv2d::forward`], or if the residual has another shape than the output.
#[must_use]
pub fn conv_norm(
    conv: &Conv2d,
    norm: &BatchNorm,
    input: Tensor<4>,
    residual: Option<Tensor<4>>,
    activation: Activation,
) -> Tensor<4> {
    if let Some(last) = last(conv, norm, residual.as_ref(), activation)
        && let Some(output) = conv.fast(&input, &last)
    {
        if let Some(residual) = &residual {
            assert_eq!(residual.dims(), output.dims(), "shape of the residual");
        }
        return output;
    }
    let mut output = batch_norm(norm, conv.forward(input));
    if let Some(residual) = residual {
        output = output + residual;
    }
    match activation {
        Activation::None => output,
        Activation::Relu => relu(output),
        Activation::Relu6 => output.clamp(0.0, 6.0),
    }
}

/// The normalisation as scale and shift, if everything can be read here.
fn last(
    conv: &Conv2d,
    norm: &BatchNorm,
    residual: Option<&Tensor<4>>,
    activation: Activation,
) -> Option<Last> {
    let read = |tensor: &Tensor<1>| InMemory::new(tensor);
    let (gamma, beta) = (read(&norm.gamma.val())?, read(&norm.beta.val())?);
    let (mean, variance) = (read(&norm.running_mean.value())?, read(&norm.running_var.value())?);
    let bias = conv.bias_values()?;
    let residual = match residual {
        Some(residual) => Some(InMemory::new(residual)?),
        None => None,
    };
    #[expect(clippy::cast_possible_truncation, reason = "a small constant")]
    let epsilon = norm.epsilon as f32;
    let scale: Vec<f32> = gamma
        .values()
        .iter()
        .zip(variance.values())
        .map(|(gamma, variance)| gamma / (variance + epsilon).sqrt())
        .collect();
    let shift = beta.values().iter().zip(mean.values()).zip(bias.iter().zip(&scale));
    let shift = shift.map(|((beta, mean), (bias, scale))| beta + (bias - mean) * scale);
    let shift = Some(shift.collect());
    Some(Last { scale: Some(scale), shift, residual, activation })
}

#[cfg(test)]
mod tests {
    use burn::{
        module::Module,
        nn::{BatchNormConfig, PaddingConfig2d},
        tensor::{Device, Distribution},
    };

    use super::*;
    use crate::layer::Conv2dConfig;

    #[test]
    fn one_pass_equals_the_layers_one_by_one() {
        let device = Device::flex();
        let random = |shape: [usize; 4]| {
            Tensor::<4>::random(shape, Distribution::Uniform(-1.0, 1.0), &device)
        };
        for (channels, stride) in [([3, 20], 2), ([24, 20], 1)] {
            let conv = Conv2dConfig::new(channels, [3, 3])
                .with_stride([stride, stride])
                .with_padding(PaddingConfig2d::Explicit(1, 1, 1, 1))
                .init(&device);
            let mut norm = BatchNormConfig::new(20).init(&device);
            norm.gamma = norm.gamma.map(|it| it.random_like(Distribution::Uniform(0.5, 2.0)));
            norm.beta = norm.beta.map(|it| it.random_like(Distribution::Uniform(-1.0, 1.0)));
            norm.running_mean.update(Tensor::random(
                [20],
                Distribution::Uniform(-1.0, 1.0),
                &device,
            ));
            norm.running_var.update(Tensor::random([20], Distribution::Uniform(0.5, 2.0), &device));
            let norm = norm.valid();
            let input = random([2, channels[0], 16, 12]);
            let residual = random([2, 20, 16 / stride, 12 / stride]);
            let slow = relu(norm.forward(conv.forward(input.clone())) + residual.clone());
            let fast = conv_norm(&conv, &norm, input, Some(residual), Activation::Relu);
            let worst: f32 = (fast - slow).abs().max().into_scalar();
            assert!(worst < 1e-4, "{worst}");
        }
    }
}
