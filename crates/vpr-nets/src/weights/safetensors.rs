//! `.safetensors`: a header of names, types and places, then bytes.

use std::{collections::BTreeMap, path::Path};

use safetensors::{Dtype, SafeTensorError, SafeTensors};
use vpr_files::pickle::Element;

use super::{Tensor, storage};
use crate::{Error, Result};

/// What stands beside the tensors.
pub(super) fn facts(path: &Path, bytes: &[u8]) -> Result<BTreeMap<String, String>> {
    let (_, header) =
        SafeTensors::read_metadata(bytes).map_err(|err| not_safetensors(path, &err))?;
    Ok(header.metadata().iter().flatten().map(|(key, it)| (key.clone(), it.clone())).collect())
}

fn not_safetensors(path: &Path, err: &SafeTensorError) -> Error {
    let reason = format!("neither a checkpoint of PyTorch nor safetensors: {err}");
    Error::format(path, "header", reason)
}

/// All tensors of a file.
pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<BTreeMap<String, Tensor>> {
    let file = SafeTensors::deserialize(bytes).map_err(|err| not_safetensors(path, &err))?;
    let mut tensors = BTreeMap::new();
    for (key, view) in file.iter() {
        let element = match view.dtype() {
            Dtype::F64 => Element::F64,
            Dtype::F32 => Element::F32,
            Dtype::F16 => Element::F16,
            Dtype::BF16 => Element::BF16,
            Dtype::I64 => Element::I64,
            Dtype::I32 => Element::I32,
            Dtype::I16 => Element::I16,
            Dtype::I8 => Element::I8,
            Dtype::U8 => Element::U8,
            Dtype::BOOL => Element::Bool,
            other => return Err(Error::format(path, key, format!("{other:?} is not read"))),
        };
        let data = storage::numbers(element, view.data());
        storage::check_finite(path, key, &data)?;
        tensors.insert(key.to_owned(), Tensor { shape: view.shape().to_vec(), data });
    }
    Ok(tensors)
}
