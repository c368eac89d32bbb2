//! STUN's student, and how a teacher trains it.

use std::{path::Path, sync::Arc};

use burn::{
    module::{Module, ModuleDisplay},
    nn::{Linear, LinearConfig},
    tensor::{Device, Tensor},
};
use vpr_nets::{
    layer::linear,
    loss::{LogVariance, SelfTeaching},
    model::{
        SEQUENTIAL_RESNET,
        default::{DefaultEncoder, DefaultEncoderConfig},
    },
    train::{Trainable, seeded},
    weights::Weights,
};

use super::{Backbone, ResNetGem, variance_head::centred};
use crate::Result;

/// A descriptor and a variance for each of its dimensions (Cai, Lu and Huang, *STUN: Self-Teaching
/// Uncertainty Estimation for Place Recognition*, IROS 2022).
#[derive(Module, Debug)]
pub struct Stun<B: Module + ModuleDisplay> {
    encoder: B,
    var_head: Linear,
}

impl Stun<DefaultEncoder> {
    /// On the default network, random weights.
    ///
    /// # Panics
    ///
    /// As [`DefaultEncoderConfig::init`].
    #[must_use]
    pub fn init(config: &DefaultEncoderConfig, device: &Device) -> Self {
        let var_head = LinearConfig::new(config.pooled(), config.dimension).init(device);
        Self { encoder: config.init(device), var_head }
    }

    /// The same with weights drawn from `seed`, both heads centred on these images: where training
    /// starts. The student begins without the teacher's weights, as in the released code; one that
    /// began with them would have nothing to be unsure of.
    #[must_use]
    pub fn start(self, seed: u64, images: Tensor<4>) -> Self {
        let network = seeded(self, seed);
        let encoder = network.encoder.centred(images.clone());
        let pooled = encoder.trunk().forward(images);
        Self { var_head: centred(network.var_head, pooled, 0.0), encoder }
    }
}

impl Stun<ResNetGem> {
    /// On ResNet-50, random weights: descriptors and variances of 2048 values.
    #[must_use]
    pub fn resnet50(device: &Device) -> Self {
        let size = ResNetGem::DIMENSION;
        let var_head = LinearConfig::new(size, size).init(device);
        Self { encoder: ResNetGem::init(device), var_head }
    }

    /// Reads a student of `ramdrop/stun` (`ckpt.pth.tar`), keys `backbone.0.weight` to
    /// `var_head.0.bias`.
    ///
    /// # Errors
    ///
    /// [`vpr_nets::Error::Weights`] with the keys that are missing or of another shape.
    pub fn load_official(mut self, path: &Path) -> Result<Self> {
        let own = [
            (r"^backbone\.8\.p$", "encoder.pool.p"),
            (r"^var_head\.0\.", "var_head."),
            (r"^backbone\.", "encoder.backbone."),
        ];
        let weights = Weights::open(path)?.renamed(&SEQUENTIAL_RESNET)?.renamed(&own)?;
        weights.apply(&mut self)?;
        Ok(self)
    }
}

impl<B: Backbone> Stun<B> {
    /// Images, `batch × 3 × height × width`, to descriptors of length one and the variance head's
    /// outputs, `batch × dimension` each.
    #[must_use]
    pub fn forward(&self, images: Tensor<4>) -> (Tensor<2>, Tensor<2>) {
        let features = self.encoder.features(images);
        (features.descriptors, linear(&self.var_head, features.pooled))
    }

    /// Images to descriptors and variances in use, exp(sigmoid(s)) of the head's output s, between
    /// 1 and e; however the student was trained (reference-behaviour §4.3).
    #[must_use]
    pub fn describe(&self, images: Tensor<4>) -> (Tensor<2>, Tensor<2>) {
        let (descriptors, raw) = self.forward(images);
        (descriptors, LogVariance::Sigmoid.of(raw).exp())
    }
}

/// A student with its teacher: what is trained is the student, what is kept of it is the student.
#[derive(Module, Debug)]
pub struct SelfTaught {
    student: Stun<DefaultEncoder>,
    /// Outside gradients and checkpoints.
    #[module(skip)]
    teacher: Arc<DefaultEncoder>,
    #[module(skip)]
    loss: SelfTeaching,
    #[module(skip)]
    log_variance: LogVariance,
}

impl SelfTaught {
    /// Puts a student before a teacher, whose weights will stay.
    #[must_use]
    pub fn new(
        student: Stun<DefaultEncoder>,
        teacher: &DefaultEncoder,
        loss: SelfTeaching,
        log_variance: LogVariance,
    ) -> Self {
        Self { student, teacher: Arc::new(teacher.valid()), loss, log_variance }
    }

    /// The student.
    #[must_use]
    pub fn student(&self) -> &Stun<DefaultEncoder> {
        &self.student
    }

    /// The teacher's descriptors of images, `batch × dimension`.
    #[must_use]
    pub fn teacher(&self, images: Tensor<4>) -> Tensor<2> {
        self.teacher.forward(images.inner())
    }
}

impl Trainable for SelfTaught {
    /// The self-teaching loss; what the images show is not asked.
    fn loss(&self, images: Tensor<4>, _places: &[usize]) -> Tensor<1> {
        let teacher = Tensor::from_inner(self.teacher(images.clone()));
        let (mean, raw) = self.student.forward(images);
        self.loss.forward(mean, self.log_variance.of(raw), teacher)
    }
}
