//! Published networks whole: a backbone, an aggregator, and the names of their official weights.

mod convolutional;
pub mod default;
pub mod headed;
mod keys;
mod netvlad;
mod transformer;
mod tunable;

use burn::module::Module;
use burn::store::ModuleSnapshot;
use burn::tensor::{Device, Tensor};

use crate::Result;
use crate::weights::{Report, Weights};

pub use convolutional::{Trunk, ap_gem, boq_resnet50, convap, cosplace, gem_resnet50, mixvpr};
pub use keys::SEQUENTIAL_RESNET;
pub use netvlad::{NetVladHead, netvlad};
pub use transformer::{boq_dinov2, cricavpr, salad};
pub use tunable::Tunable;

/// From images to descriptors.
pub trait Describe {
    /// Descriptors, `batch × dimension`, of preprocessed images, `batch × channels × height × width`.
    fn describe(&self, images: Tensor<4>) -> Tensor<2>;

    /// Whether images of this size can be described.
    ///
    /// # Errors
    ///
    /// What the network needs, in words.
    fn accepts(&self, _height: usize, _width: usize) -> Result<(), String> {
        Ok(())
    }
}

/// A backbone and what makes one descriptor of its features.
#[derive(Module, Debug)]
pub struct Parts<B: Module, A: Module> {
    backbone: B,
    aggregator: A,
}

/// A network with its weights.
#[derive(Debug)]
pub struct Loaded<M> {
    network: M,
    dimension: usize,
    report: Report,
}

impl<B: Module, A: Module> Loaded<Parts<B, A>> {
    /// The parts with `weights`, whose keys begin with `backbone.` and `aggregator.`.
    fn new(backbone: B, aggregator: A, dimension: usize, weights: Weights) -> Result<Self>
    where
        Parts<B, A>: ModuleSnapshot,
    {
        let mut network = Parts { backbone, aggregator };
        let report = weights.apply(&mut network)?;
        Ok(Self { network, dimension, report })
    }
}

/// A network with its weights, whichever it is.
pub trait Model: Describe + Send + Sync {
    /// Length of a descriptor.
    fn dimension(&self) -> usize;

    /// What was loaded.
    fn report(&self) -> &Report;
}

impl<M> Loaded<M> {
    /// The network alone, such as to train it further.
    #[must_use]
    pub fn into_network(self) -> M {
        self.network
    }
}

impl<M: Describe> Describe for Loaded<M> {
    fn describe(&self, images: Tensor<4>) -> Tensor<2> {
        self.network.describe(images)
    }

    fn accepts(&self, height: usize, width: usize) -> Result<(), String> {
        self.network.accepts(height, width)
    }
}

impl<M: Describe + Send + Sync> Model for Loaded<M> {
    fn dimension(&self) -> usize {
        self.dimension
    }

    fn report(&self) -> &Report {
        &self.report
    }
}

/// The names that [`open`] takes.
pub const NAMES: [&str; 9] = [
    "boq-dinov2",
    "boq-resnet50",
    "convap",
    "cosplace",
    "cricavpr",
    "gem-resnet50",
    "mixvpr",
    "netvlad",
    "salad",
];

/// The network `name` with the weights of its official checkpoint; sizes are read off the weights.
/// `None` if there is no network of this name.
///
/// # Errors
///
/// [`Error::Weights`](crate::Error::Weights) lists the keys that are missing, unexpected or of
/// another shape; [`Error::Core`](crate::Error::Core) names a key whose shape no such network has.
#[must_use]
pub fn open(name: &str, weights: Weights, device: &Device) -> Option<Result<Box<dyn Model>>> {
    fn boxed<M: Describe + Send + Sync + 'static>(
        loaded: Result<Loaded<M>>,
    ) -> Result<Box<dyn Model>> {
        Ok(Box::new(loaded?))
    }
    Some(match name {
        "boq-dinov2" => boxed(boq_dinov2(weights, device)),
        "boq-resnet50" => boxed(boq_resnet50(weights, device)),
        "convap" => boxed(convap(weights, device)),
        "cosplace" => boxed(cosplace(weights, device)),
        "cricavpr" => boxed(cricavpr(weights, device)),
        "gem-resnet50" => boxed(gem_resnet50(weights, device)),
        "mixvpr" => boxed(mixvpr(weights, device)),
        "netvlad" => boxed(netvlad(weights, device)),
        "salad" => boxed(salad(weights, device)),
        _ => return None,
    })
}
