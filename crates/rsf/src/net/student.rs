//! The network while it learns.

use burn::{
    module::{Module, ModuleDisplay, ParamGroup},
    tensor::{Device, Tensor, TensorData},
};
use vpr_nets::{
    loss::Triplet,
    model::{Tunable, default::DefaultEncoder},
    train::Learner,
};

use super::{TripletBatch, parts};
use crate::Result;

/// A network under the triplet loss (thesis eq. 4.4).
#[derive(Module, Debug)]
pub struct Student<N: Module + ModuleDisplay = DefaultEncoder> {
    network: N,
    #[module(skip)]
    margin: f64,
    #[module(skip)]
    frozen: Vec<String>,
}

impl<N: Tunable> Student<N> {
    /// A network that learns but for the parts that `frozen` names: `trunk`, `trunk.stages.0`,
    /// `head.bias`, …, and for its batch normalisations.
    ///
    /// # Errors
    ///
    /// [`crate::Error::NoSuchPart`] with the parts there are.
    pub fn new(network: N, margin: f64, frozen: &[String]) -> Result<Self> {
        parts::check(&network, frozen)?;
        let mut frozen = parts::parameters(&network, frozen);
        frozen.extend(network.batch_norms());
        Ok(Self { network: held(network, &frozen), margin, frozen })
    }

    /// The network.
    #[must_use]
    pub fn network(&self) -> &N {
        &self.network
    }
}

/// The same network, whose frozen parameters get no gradient. Nothing is left out by chance: a run
/// that goes on would draw something else.
fn held<N: Module>(network: N, frozen: &[String]) -> N {
    let network = network.freeze_group(ParamGroup::from_predicate("dropout"));
    if frozen.is_empty() {
        return network;
    }
    network.freeze_group(ParamGroup::from_paths(frozen.to_vec()))
}

impl<N: Tunable> Learner for Student<N> {
    type Batch = TripletBatch;

    fn learn(&self, batch: TripletBatch, device: &Device) -> Tensor<1> {
        // What a checkpoint brings back may ask for gradients again.
        let network = held(self.network.clone(), &self.frozen);
        let n = batch.n;
        let shape = [3 * n, 3, batch.size.1, batch.size.0];
        let images = Tensor::from_data(TensorData::new(batch.images, shape), device);
        let rows = network.describe(images);
        let part = |number: usize| rows.clone().narrow(0, number * n, n);
        Triplet { margin: self.margin }.forward(part(0), part(1), part(2))
    }
}
