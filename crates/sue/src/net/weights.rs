//! Files of weights.

use std::{fs, path::Path};

use burn::store::{
    BurnToPyTorchAdapter, HalfPrecisionAdapter, ModuleAdapter, ModuleSnapshot, SafetensorsStore,
};
use vpr_core::Error;

use crate::Result;

/// Writes a network as safetensors under `PyTorch`'s names and axes, in half precision, with
/// `metadata` beside the weights; under a temporary name first.
///
/// # Errors
///
/// [`Error::Format`] and [`Error::Io`] with the file.
pub fn save<M: ModuleSnapshot>(
    network: &M,
    path: &Path,
    metadata: &[(&str, String)],
) -> Result<()> {
    let partial = path.with_extension("partial.safetensors");
    let store = SafetensorsStore::from_file(&partial)
        .with_to_adapter(BurnToPyTorchAdapter.chain(HalfPrecisionAdapter::new()))
        .overwrite(true);
    let mut store = metadata.iter().fold(store, |store, (key, value)| store.metadata(*key, value));
    network
        .save_into(&mut store)
        .map_err(|cause| Error::format(path, "weights", cause.to_string()))?;
    fs::rename(&partial, path).map_err(Error::io(path))?;
    Ok(())
}
