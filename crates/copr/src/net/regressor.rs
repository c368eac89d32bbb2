//! H as a strategy.

use std::path::Path;

use burn::{
    module::Module,
    tensor::{Device, Tensor, TensorData},
};
use vpr_core::{Definition, Error as CoreError};
use vpr_nets::{
    regress::{DescriptorRegressor, DescriptorRegressorConfig, RELATIVE_POSE, from_official},
    weights::Weights,
};

use super::relative_pose;
use crate::{
    Error, Result, Selection,
    regression::{Regressor, Request, Told},
};

/// The network H: one anchor, the one a target was placed from.
#[derive(Clone, Debug)]
pub struct NetworkRegressor {
    network: DescriptorRegressor,
    definition: Definition,
    dimension: usize,
    encoder: Option<String>,
    digest: String,
}

const NAME: &str = "network H";

impl NetworkRegressor {
    /// A trained network; `definition` is that of the relative poses it was trained on.
    #[must_use]
    pub fn new(network: DescriptorRegressor, dimension: usize, definition: Definition) -> Self {
        let network = network.valid();
        Self { network, definition, dimension, encoder: None, digest: String::new() }
    }

    /// Reads weights that [`super::train`] or the authors' code wrote. What ours say of the relative
    /// poses they were trained on counts; the authors' are [`Definition::Published`].
    ///
    /// # Errors
    ///
    /// [`vpr_nets::Error::Weights`] with keys that are missing, unexpected or of another shape;
    /// [`CoreError::Format`] if the file says what this program does not know.
    pub fn open(path: &Path) -> Result<Self> {
        let weights = Weights::open(path)?;
        let said = weights.facts().get("relative_pose").map(String::as_str);
        let definition = match said {
            None | Some("published") => Definition::Published,
            Some("corrected") => Definition::Corrected,
            Some(other) => {
                let reason = format!("`{}` is neither published nor corrected", shown(other));
                return Err(CoreError::format(path, "metadata `relative_pose`", reason).into());
            }
        };
        let encoder = weights.facts().get("encoder").cloned();
        let digest = weights.digest().to_owned();
        // The authors count activations too, so that they have no layer of an odd number.
        let is_official = weights.get("net_regdesc.1.weight").is_none();
        let weights = if is_official { from_official(weights) } else { weights };
        let config = DescriptorRegressorConfig::from_weights(&weights, "")?;
        let mut network = config.init(&Device::flex());
        weights.apply(&mut network)?;
        let dimension = config.dimension;
        Ok(Self { encoder, digest, ..Self::new(network, dimension, definition) })
    }

    /// Length of the descriptors it regresses.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// Which relative poses it was trained on.
    #[must_use]
    pub fn definition(&self) -> Definition {
        self.definition
    }

    /// The encoder whose descriptors it was trained on, if the file says so.
    #[must_use]
    pub fn encoder(&self) -> Option<&str> {
        self.encoder.as_deref()
    }

    /// SHA-256 of the file, empty if there was none.
    #[must_use]
    pub fn digest(&self) -> &str {
        &self.digest
    }
}

/// The start of a text that somebody else wrote.
fn shown(text: &str) -> String {
    text.chars().take(40).collect()
}

impl Regressor for NetworkRegressor {
    fn name(&self) -> &'static str {
        NAME
    }

    fn selection(&self) -> Selection {
        Selection::Own
    }

    fn regress(&self, requests: &[Request<'_>], out: &mut [f32]) -> Result<Told> {
        let (n, dim) = (requests.len(), self.dimension);
        if out.len() != n * dim {
            let (what, actual) = ("values of a descriptor", out.len() / n.max(1));
            return Err(CoreError::Mismatch { what, expected: dim, actual }.into());
        }
        if n == 0 {
            return Ok(Told::default());
        }
        let (mut anchors, mut relative) = (Vec::with_capacity(n * dim), Vec::new());
        for request in requests {
            let Some(anchor) = request.anchors.first() else {
                let (target, method) = (request.target, NAME);
                return Err(Error::TooFewAnchors { target, method, needed: 1, found: 0 });
            };
            anchors.extend_from_slice(anchor.descriptor);
            relative.extend(relative_pose(anchor.pose, &request.pose, self.definition));
        }
        let device = Device::flex();
        let tensor = |values: Vec<f32>, width: usize| {
            Tensor::<2>::from_data(TensorData::new(values, [n, width]), &device)
        };
        let found = self.network.forward(tensor(anchors, dim), tensor(relative, RELATIVE_POSE));
        let values = found.into_data();
        for (at, (out, value)) in out.iter_mut().zip(values.iter::<f32>()).enumerate() {
            if !value.is_finite() {
                let (target, column) = (requests[at / dim].target, at % dim);
                return Err(Error::NotFinite { target, column, value: f64::from(value) });
            }
            *out = value;
        }
        Ok(Told::default())
    }
}
