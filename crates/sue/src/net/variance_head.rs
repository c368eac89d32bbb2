//! From pooled features to one positive variance.

use burn::{
    module::{Module, Param},
    nn::{Linear, LinearConfig},
    tensor::{Device, Tensor, activation::relu},
};
use vpr_nets::{layer::linear, loss::positive};

/// Smallest standard deviation of a feature that is divided by.
const FLOOR: f64 = 1e-3;

/// Two layers and a softplus: `batch × pooled` to `batch × 1`, variances of a descriptor's
/// dimensions (BTL's paper, section 4).
#[derive(Module, Debug)]
pub struct VarianceHead {
    hidden: Linear,
    output: Linear,
}

impl VarianceHead {
    /// A head with random weights.
    #[must_use]
    pub fn init(pooled: usize, hidden: usize, device: &Device) -> Self {
        Self {
            hidden: LinearConfig::new(pooled, hidden).init(device),
            output: LinearConfig::new(hidden, 1).init(device),
        }
    }

    /// Variances, positive.
    #[must_use]
    pub fn forward(&self, pooled: Tensor<2>) -> Tensor<2> {
        positive(linear(&self.output, relu(linear(&self.hidden, pooled))))
    }

    /// The head for features like these, whose variances begin around `variance`. Without, the
    /// noise of a descriptor would be many times its length, and training would first have to
    /// bring it down.
    #[must_use]
    pub(super) fn centred(self, pooled: Tensor<2>, variance: f64) -> Self {
        // The inverse of softplus.
        let offset = variance.exp_m1().ln();
        let hidden = centred(self.hidden, pooled.clone(), 0.0);
        let output = centred(self.output, relu(hidden.forward(pooled)), offset);
        Self { hidden, output }
    }
}

/// The layer after its input was brought to mean 0 and variance 1 over these `rows`, feature by
/// feature; its output has mean `offset` over them.
pub(super) fn centred(mut layer: Linear, rows: Tensor<2>, offset: f64) -> Linear {
    let rows = rows.detach();
    let mean = rows.clone().mean_dim(0);
    let deviation = (rows - mean.clone()).square().mean_dim(0).sqrt() + FLOOR;
    let weight = layer.weight.val().detach() / deviation.transpose();
    let bias = mean.matmul(weight.clone()).neg().flatten(0, 1) + offset;
    layer.weight = Param::from_tensor(weight.detach());
    layer.bias = Some(Param::from_tensor(bias.detach()));
    layer
}
