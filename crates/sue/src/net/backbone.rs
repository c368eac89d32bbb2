//! What the heads sit on.

use burn::{
    module::{Module, ModuleDisplay},
    tensor::{Device, Tensor},
};
use vpr_nets::{
    aggregate::{Gem, GemConfig},
    backbone::{ResNet, ResNetConfig},
    layer::l2_normalize,
    model::default::DefaultEncoder,
};

/// What a backbone makes of `batch` images.
#[derive(Clone, Debug)]
pub struct Features {
    /// Descriptors, `batch × dimension`, rows of length one.
    pub descriptors: Tensor<2>,
    /// What a variance is read from, `batch × pooled`.
    pub pooled: Tensor<2>,
}

/// A network that gives descriptors and, in the same pass, pooled features for another head.
pub trait Backbone: Module + ModuleDisplay {
    /// Both of images, `batch × 3 × height × width`, preprocessed.
    fn features(&self, images: Tensor<4>) -> Features;
}

impl Backbone for DefaultEncoder {
    fn features(&self, images: Tensor<4>) -> Features {
        let pooled = self.trunk().forward(images);
        Features { descriptors: self.project(pooled.clone()), pooled }
    }
}

/// ResNet-50 and one generalised mean for descriptor and variance: STUN's network
/// (`networks/res50gem.py` of `ramdrop/stun`), 2048 values each.
#[derive(Module, Debug)]
pub struct ResNetGem {
    backbone: ResNet,
    pool: Gem,
}

/// ResNet-50 with a generalised mean for the descriptor and one for the variance, each with an
/// exponent of its own, as BTL's paper draws it; 2048 values each.
#[derive(Module, Debug)]
pub struct ResNetTwoGem {
    backbone: ResNet,
    mean_pool: Gem,
    variance_pool: Gem,
}

impl ResNetGem {
    /// Length of descriptors and of pooled features.
    pub const DIMENSION: usize = 2048;

    /// Random weights.
    #[must_use]
    pub fn init(device: &Device) -> Self {
        let backbone = ResNetConfig::resnet50().init(device);
        Self { backbone, pool: GemConfig::new().init(device) }
    }
}

impl ResNetTwoGem {
    /// Random weights.
    #[must_use]
    pub fn init(device: &Device) -> Self {
        let pool = || GemConfig::new().init(device);
        let backbone = ResNetConfig::resnet50().init(device);
        Self { backbone, mean_pool: pool(), variance_pool: pool() }
    }
}

impl Backbone for ResNetGem {
    fn features(&self, images: Tensor<4>) -> Features {
        let pooled = self.pool.forward(self.backbone.forward(images));
        Features { descriptors: l2_normalize(pooled.clone(), 1), pooled }
    }
}

impl Backbone for ResNetTwoGem {
    fn features(&self, images: Tensor<4>) -> Features {
        let map = self.backbone.forward(images);
        let pooled = self.variance_pool.forward(map.clone());
        Features { descriptors: l2_normalize(self.mean_pool.forward(map), 1), pooled }
    }
}
