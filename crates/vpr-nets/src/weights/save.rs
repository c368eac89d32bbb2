//! Files of weights that we write.

use std::{collections::BTreeMap, path::Path};

use burn::store::{
    BurnToPyTorchAdapter, HalfPrecisionAdapter, ModuleAdapter, ModuleSnapshot, SafetensorsStore,
};
use serde_json::Value;
use vpr_files::replace;

use crate::{Error, Result};

/// How many bits of a weight are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// All 32.
    Single,
    /// 16, in half the space.
    Half,
}

/// Writes a network as safetensors under `PyTorch`'s names and axes, with `facts` beside the
/// weights. The file appears whole or not at all, and the same network and facts give the same
/// bytes.
///
/// # Errors
///
/// [`vpr_core::Error::Format`] and [`vpr_core::Error::Io`] with the file.
pub fn save<M: ModuleSnapshot>(
    network: &M,
    path: &Path,
    facts: &[(&str, String)],
    precision: Precision,
) -> Result<()> {
    let refused = |cause: String| Error::format(path, "weights", cause);
    // Names of enum variants are not part of any key, as where weights are read.
    let store = SafetensorsStore::from_bytes(None).skip_enum_variants(true);
    let store = match precision {
        Precision::Single => store.with_to_adapter(BurnToPyTorchAdapter),
        Precision::Half => {
            store.with_to_adapter(BurnToPyTorchAdapter.chain(HalfPrecisionAdapter::new()))
        }
    };
    let mut store = facts.iter().fold(store, |store, (key, value)| store.metadata(*key, value));
    network.save_into(&mut store).map_err(|cause| refused(cause.to_string()))?;
    let bytes = store.get_bytes().map_err(|cause| refused(cause.to_string()))?;
    let bytes = with_sorted_header(&bytes).ok_or_else(|| refused("no header".to_owned()))?;
    Ok(replace(path, &bytes)?)
}

/// The same file with the keys of its header in order: the writer below us has them in that of a
/// hash map, another one in every process.
fn with_sorted_header(bytes: &[u8]) -> Option<Vec<u8>> {
    let (length, rest) = bytes.split_first_chunk::<8>()?;
    let (header, data) = rest.split_at_checked(u64::from_le_bytes(*length).try_into().ok()?)?;
    let header: BTreeMap<String, BTreeMap<String, Value>> = serde_json::from_slice(header).ok()?;
    let mut header = serde_json::to_vec(&header).ok()?;
    // Data begins at a multiple of eight bytes.
    header.resize(header.len().next_multiple_of(8), b' ');
    let length = u64::try_from(header.len()).ok()?.to_le_bytes();
    Some([&length[..], &header, data].concat())
}

#[cfg(test)]
mod tests {
    use burn::{nn::LinearConfig, tensor::Device};

    use super::*;
    use crate::weights::Weights;

    #[test]
    fn a_file_is_read_as_it_was_written_and_has_one_order() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let linear = LinearConfig::new(3, 2).init(&Device::flex());
        let facts: Vec<(&str, String)> =
            ["seed", "steps", "rate", "licence"].map(|key| (key, key.to_owned())).to_vec();
        for precision in [Precision::Single, Precision::Half] {
            save(&linear, &at("a"), &facts, precision).unwrap();
            let first = std::fs::read(at("a")).unwrap();
            for _ in 0..8 {
                save(&linear, &at("a"), &facts, precision).unwrap();
                assert_eq!(std::fs::read(at("a")).unwrap(), first);
            }
            let read = Weights::open(&at("a")).unwrap();
            let values: Vec<f32> =
                linear.weight.val().transpose().into_data().try_to_vec().unwrap();
            let gap = if precision == Precision::Single { 0.0 } else { 1e-3 };
            let weight = read.get("weight").unwrap();
            assert_eq!(weight.shape, [2, 3]);
            assert!(weight.data.iter().zip(&values).all(|(a, b)| (a - b).abs() <= gap));
            for (key, value) in &facts {
                assert_eq!(read.facts().get(*key), Some(value), "facts are beside the weights");
            }
        }
        assert!(save(&linear, &at("none/a"), &facts, Precision::Single).is_err());
    }
}
