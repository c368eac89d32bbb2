//! From keys and values to the parameters of a module.

use std::{collections::BTreeMap, path::Path};

use burn::{
    store::{BurnToPyTorchAdapter, ModuleSnapshot, PyTorchToBurnAdapter, bridge},
    tensor::TensorData,
};

use super::Tensor;
use crate::{Error, Mismatch, Result};

/// Gives `tensors` to `module`; returns how many tensors and values it took.
pub(super) fn apply<M: ModuleSnapshot>(
    path: &Path,
    mut tensors: BTreeMap<String, Tensor>,
    module: &mut M,
) -> Result<(usize, usize)> {
    tensors.retain(|key, _| key.rsplit('.').next() != Some("num_batches_tracked"));
    let expected: BTreeMap<String, Vec<usize>> = module
        .collect(None, Some(Box::new(BurnToPyTorchAdapter)), true)
        .into_iter()
        .map(|tensor| (tensor.name.clone(), tensor.shape.iter().copied().collect()))
        .collect();
    let mismatch = differences(&expected, &tensors);
    if !mismatch.is_empty() {
        return Err(Error::Weights { path: path.to_owned(), mismatch: Box::new(mismatch) });
    }
    let (n_tensors, n_values) = (tensors.len(), tensors.values().map(|it| it.data.len()).sum());
    let snapshots = tensors
        .into_iter()
        .map(|(key, tensor)| {
            bridge::from_data(TensorData::new(tensor.data, tensor.shape), key, None)
        })
        .collect();
    let result = module.apply(snapshots, None, Some(Box::new(PyTorchToBurnAdapter)), true);
    if result.errors.is_empty() && result.missing.is_empty() && result.unused.is_empty() {
        return Ok((n_tensors, n_values));
    }
    Err(Error::format(path, "content", result.to_string()))
}

fn differences(
    expected: &BTreeMap<String, Vec<usize>>,
    actual: &BTreeMap<String, Tensor>,
) -> Mismatch {
    let missing = expected.keys().filter(|&key| !actual.contains_key(key)).cloned().collect();
    let unexpected = actual.keys().filter(|&key| !expected.contains_key(key)).cloned().collect();
    let shapes = expected
        .iter()
        .filter_map(|(key, network)| {
            let file = &actual.get(key)?.shape;
            (file != network).then(|| (key.clone(), network.clone(), file.clone()))
        })
        .collect();
    Mismatch { missing, unexpected, shapes }
}
