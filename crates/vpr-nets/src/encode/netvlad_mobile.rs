//! The shipped NetVLAD on MobileNetV2.

use burn::{
    module::{Module, Param},
    tensor::{Device, Tensor, activation::softmax},
};

use crate::{
    Result,
    backbone::{MobileNetV2, MobileNetV2Config, mobilenet_v2},
    model::{Describe, Tunable},
    weights::{Report, Weights},
};

/// Clusters of the shipped weights.
const CLUSTERS: usize = 16;

/// Ten blocks of MobileNetV2, then a NetVLAD layer whose centres are added (Keras' form).
#[derive(Module, Debug)]
pub(super) struct NetVladMobile {
    trunk: MobileNetV2,
    /// Scores, `dim × clusters`.
    kernel: Param<Tensor<2>>,
    bias: Param<Tensor<1>>,
    /// `dim × clusters`.
    centres: Param<Tensor<2>>,
}

impl NetVladMobile {
    pub(super) fn new(channels: usize, device: &Device) -> Self {
        let config = MobileNetV2Config::new().with_channels(channels);
        let shape = [config.out_channels(), CLUSTERS];
        let zeros = || Param::from_tensor(Tensor::zeros(shape, device));
        Self {
            trunk: config.init(device),
            kernel: zeros(),
            bias: Param::from_tensor(Tensor::zeros([CLUSTERS], device)),
            centres: zeros(),
        }
    }

    /// The weights of its file, or of one that was trained further here, under its own keys.
    fn keys(weights: Weights) -> Result<Weights> {
        if weights.get("centres").is_some() {
            return Ok(weights);
        }
        let head = weights.mapped(|key, mut weight| {
            if key.starts_with("net_vlad_layer_1.") {
                weight.shape.retain(|&side| side != 1);
            }
            Some((key, weight))
        });
        mobilenet_v2::from_keras(head)?.renamed(&[
            (r"^(conv|norm|blocks)\.", "trunk.$1."),
            (r"^net_vlad_layer_1\.cluster_centers$", "centres"),
            (r"^net_vlad_layer_1\.weight$", "kernel"),
            (r"^net_vlad_layer_1\.bias$", "bias"),
        ])
    }

    /// Unit descriptors, `n × 64 · 16`.
    pub(super) fn forward(&self, images: Tensor<4>) -> Tensor<2> {
        let features = self.trunk.forward(images).flatten::<3>(2, 3);
        let scores = features.clone().swap_dims(1, 2).matmul(self.kernel.val().unsqueeze())
            + self.bias.val().unsqueeze();
        let assignment = softmax(scores, 2);
        let mass = assignment.clone().sum_dim(1);
        let sums = features.matmul(assignment) + self.centres.val().unsqueeze::<3>() * mass;
        let flat = keras_l2_normalize(sums).swap_dims(1, 2).flatten::<2>(1, 2);
        keras_l2_normalize(flat)
    }
}

impl Describe for NetVladMobile {
    fn describe(&self, images: Tensor<4>) -> Tensor<2> {
        self.forward(images)
    }
}

impl Tunable for NetVladMobile {
    fn take(&mut self, weights: Weights) -> Result<Report> {
        Self::keys(weights)?.apply(self)
    }
}

/// `x / √(max(Σ x², 1e-12))` along axis 1, as TensorFlow's `l2_normalize`, which Keras calls: the
/// bound is on the *square*, so that clusters shorter than 1e-6 stay near zero. About half of the
/// images of a corridor have one; [`crate::layer::l2_normalize`] would blow it up to full length.
fn keras_l2_normalize<const D: usize>(x: Tensor<D>) -> Tensor<D> {
    let norms = x.clone().square().sum_dim(1).clamp_min(1e-12).sqrt();
    x / norms
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_vectors_stay_short() {
        let rows = [[3.0, 4.0], [3e-7, 4e-7], [0.0, 0.0]];
        let scaled = keras_l2_normalize(Tensor::<2>::from_floats(rows, &Device::flex()));
        let values: Vec<f32> = scaled.into_data().try_to_vec().unwrap();
        // 5e-7 / √1e-12 is a half.
        for (value, expected) in values.into_iter().zip([0.6, 0.8, 0.3, 0.4, 0.0, 0.0]) {
            assert!((value - expected).abs() < 1e-6, "{value} is not {expected}");
        }
    }
}
