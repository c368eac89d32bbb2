//! Caffe's `.caffemodel`: blobs become `weight` and `bias` below the names of their layers.

use std::{collections::BTreeMap, path::Path};

use vpr_files::caffe::{Layer, decode_model};

use super::Tensor;
use crate::{Error, Result};

/// Whether a file is Caffe's, which its bytes do not say.
pub(super) fn is_caffe(path: &Path) -> bool {
    path.extension().is_some_and(|it| it.eq_ignore_ascii_case("caffemodel"))
}

pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<BTreeMap<String, Tensor>> {
    let layers = decode_model(bytes).map_err(|refusal| refusal.in_file(path, 0))?;
    let mut tensors = BTreeMap::new();
    for Layer { name, blobs } in layers {
        for (at, blob) in blobs.into_iter().enumerate() {
            let key = match at {
                0 => format!("{name}.weight"),
                1 => format!("{name}.bias"),
                _ => format!("{name}.{at}"),
            };
            if blob.values.iter().any(|it| !it.is_finite()) {
                return Err(Error::format(path, key, "a value is NaN or infinite"));
            }
            // In the older form every blob has four axes.
            let shape = match (&blob.shape[..], at) {
                (&[1, 1, 1, n], _) if at > 0 => vec![n],
                (&[1, 1, rows, columns], 0) => vec![rows, columns],
                (shape, _) => shape.to_vec(),
            };
            if tensors.insert(key.clone(), Tensor { shape, data: blob.values }).is_some() {
                return Err(Error::format(path, key, "two layers have this name"));
            }
        }
    }
    Ok(tensors)
}
