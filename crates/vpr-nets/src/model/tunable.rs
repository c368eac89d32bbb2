//! Networks that can be trained further.

use std::path::Path;

use burn::{
    module::{Module, ModuleDisplay},
    store::ModuleSnapshot,
};

use vpr_core::Descriptors;

use super::{
    Describe, Parts,
    default::{DefaultEncoder, rows},
};
use crate::{
    Result,
    weights::{self, Precision, Report, Weights},
};

/// A network that can be trained further, and how its weights are read and written.
pub trait Tunable: Describe + Module + ModuleDisplay + ModuleSnapshot {
    /// Takes weights under the names that [`Self::write`] gives them.
    ///
    /// # Errors
    ///
    /// As [`Weights::apply`].
    fn take(&mut self, weights: Weights) -> Result<Report> {
        weights.apply(self)
    }

    /// Writes weights that whatever reads those of the network takes.
    ///
    /// # Errors
    ///
    /// As [`weights::save`].
    fn write(&self, path: &Path, facts: &[(&str, String)], precision: Precision) -> Result<()> {
        weights::save(self, path, facts, precision)
    }

    /// Names of what batch normalisations are made of, flags of training among them: they keep
    /// statistics, scale and shift where the rest learns from few images.
    fn batch_norms(&self) -> Vec<String> {
        let names = self.collect(None, None, false).into_iter().map(|it| it.name.clone());
        let norms = names.filter_map(|it| it.strip_suffix("running_mean").map(str::to_owned));
        norms
            .flat_map(|norm| ["gamma", "beta", "training"].map(|part| format!("{norm}{part}")))
            .collect()
    }

    /// Describes images without tensors: `images` holds `n × 3 × height × width` values, preprocessed,
    /// `size` is width and height. `batch` images go through the network at a time.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::Format`] if the images are not of that size;
    /// [`vpr_core::Error::NotFinite`].
    fn rows(
        &self,
        images: &[f32],
        size: (usize, usize),
        batch: usize,
    ) -> vpr_core::Result<Descriptors> {
        let network = self.valid();
        Descriptors::new(rows(images, size, batch, |images| Describe::describe(&network, images))?)
    }
}

impl Tunable for DefaultEncoder {}

impl<B: Module + ModuleDisplay, A: Module + ModuleDisplay> Tunable for Parts<B, A> where
    Self: Describe
{
}
