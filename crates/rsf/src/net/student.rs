//! The network while it learns.

use burn::{
    module::{Module, ParamGroup},
    tensor::{Device, Tensor, TensorData},
};
use vpr_nets::{
    loss::Triplet,
    model::default::{DefaultEncoder, INPUT},
    train::Learner,
};

use super::{TripletBatch, parts};
use crate::Result;

/// The default network under the triplet loss (thesis eq. 4.4).
#[derive(Module, Debug)]
pub struct Student {
    network: DefaultEncoder,
    #[module(skip)]
    margin: f64,
    #[module(skip)]
    frozen: Vec<String>,
}

impl Student {
    /// A network that learns but for the parts that `frozen` names: `trunk`, `trunk.stages.0`,
    /// `head.bias`, ….
    ///
    /// # Errors
    ///
    /// [`crate::Error::NoSuchPart`] with the parts there are.
    pub fn new(network: DefaultEncoder, margin: f64, frozen: &[String]) -> Result<Self> {
        parts::check(&network, frozen)?;
        let frozen = parts::parameters(&network, frozen);
        Ok(Self { network: held(network, &frozen), margin, frozen })
    }

    /// The network.
    #[must_use]
    pub fn network(&self) -> &DefaultEncoder {
        &self.network
    }
}

/// The same network, whose frozen parameters get no gradient.
fn held(network: DefaultEncoder, frozen: &[String]) -> DefaultEncoder {
    if frozen.is_empty() {
        return network;
    }
    network.set_require_grad_group(ParamGroup::from_paths(frozen.to_vec()), false)
}

impl Learner for Student {
    type Batch = TripletBatch;

    fn learn(&self, batch: TripletBatch, device: &Device) -> Tensor<1> {
        // What a checkpoint brings back may ask for gradients again.
        let network = held(self.network.clone(), &self.frozen);
        let n = batch.n;
        let shape = [3 * n, 3, INPUT.1, INPUT.0];
        let images = Tensor::from_data(TensorData::new(batch.images, shape), device);
        let rows = network.forward(images);
        let part = |number: usize| rows.clone().narrow(0, number * n, n);
        Triplet { margin: self.margin }.forward(part(0), part(1), part(2))
    }
}
