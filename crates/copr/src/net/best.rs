//! The best network of a training so far, as a file whose name says how good it is.

use std::{
    fs,
    path::{Path, PathBuf},
};

use burn::store::ModuleSnapshot;
use vpr_core::{Error as CoreError, Result};
use vpr_nets::weights::{self, Precision};

/// What the network with the lowest validation loss so far is called; step and loss follow.
const BEST: &str = "best-";

/// Keeps a network if none is better. One that a killed run had reached after its last checkpoint is
/// reached again, with the same loss.
pub(super) fn keep_if_best<M: ModuleSnapshot>(
    folder: &Path,
    step: usize,
    loss: f64,
    network: &M,
) -> Result<()> {
    let before = best(folder)?;
    if before.as_ref().is_some_and(|&(_, lowest, _)| loss >= lowest) {
        return Ok(());
    }
    let path = folder.join(format!("{BEST}{step}-{:016x}.safetensors", loss.to_bits()));
    weights::save(network, &path, &[], Precision::Single)
        .map_err(|err| CoreError::format(&path, "weights", err.to_string()))?;
    if let Some((_, _, old)) = before {
        fs::remove_file(&old).map_err(CoreError::io(&old))?;
    }
    Ok(())
}

/// Step, validation loss and file of the best network in a folder.
pub(super) fn best(folder: &Path) -> Result<Option<(usize, f64, PathBuf)>> {
    let mut all = Vec::new();
    for entry in fs::read_dir(folder).map_err(CoreError::io(folder))? {
        let path = entry.map_err(CoreError::io(folder))?.path();
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        let parts = name.strip_prefix(BEST).and_then(|name| name.strip_suffix(".safetensors"));
        let parsed = parts.and_then(|parts| {
            let (step, bits) = parts.split_once('-')?;
            let loss = f64::from_bits(u64::from_str_radix(bits, 16).ok()?);
            Some((step.parse::<usize>().ok()?, loss))
        });
        all.extend(parsed.map(|(step, loss)| (step, loss, path)));
    }
    Ok(all.into_iter().min_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0))))
}
