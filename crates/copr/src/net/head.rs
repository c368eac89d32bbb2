//! From two descriptors to the pose between their cameras.

use burn::{
    module::Module,
    nn::{Linear, LinearConfig},
    tensor::{Tensor, activation::gelu},
};
use vpr_nets::{layer::linear, regress::RELATIVE_POSE, train::device};

/// Two linear layers as wide as two descriptors: as released but for the dropout.
#[derive(Module, Debug)]
pub(super) struct RelativeHead {
    hidden: Linear,
    pose: Linear,
}

impl RelativeHead {
    pub(super) fn new(dimension: usize) -> Self {
        let device = device();
        Self {
            hidden: LinearConfig::new(2 * dimension, 2 * dimension).init(&device),
            pose: LinearConfig::new(2 * dimension, RELATIVE_POSE).init(&device),
        }
    }

    /// `n × dim` twice to `n × 7`; the released head has no activation between its layers, so that all
    /// of it is one linear map.
    pub(super) fn forward(&self, firsts: Tensor<2>, seconds: Tensor<2>, bent: bool) -> Tensor<2> {
        let both = Tensor::cat(vec![firsts, seconds], 1);
        let hidden = linear(&self.hidden, both);
        linear(&self.pose, if bent { gelu(hidden) } else { hidden })
    }
}
