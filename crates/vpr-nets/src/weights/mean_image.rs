//! Mean images that lie beside Caffe's networks: `.binaryproto` and `.npy`.

use std::{collections::BTreeMap, path::Path};

use vpr_files::{
    caffe::decode_blob,
    npy,
    pickle::{Elements, Value},
};

use super::{Tensor, storage};
use crate::{Error, Result};

/// The key of a mean image, `channels × rows × columns`.
pub(crate) const MEAN_IMAGE: &str = "mean_image";

/// Whether a file is one, which its bytes do not say.
pub(super) fn is_mean_image(path: &Path) -> bool {
    let is = |kind: &str| path.extension().is_some_and(|it| it.eq_ignore_ascii_case(kind));
    is("binaryproto") || is("npy")
}

pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<BTreeMap<String, Tensor>> {
    let (shape, data) = if bytes.starts_with(b"\x93NUMPY") {
        match npy::decode_value(path, bytes)? {
            Value::Array { shape, elements } => (shape, numbers(path, elements)?),
            other => return Err(Error::format(path, "content", other.kind())),
        }
    } else {
        let blob = decode_blob(bytes).map_err(|refusal| refusal.in_file(path, 0))?;
        (blob.shape, blob.values)
    };
    storage::check_finite(path, MEAN_IMAGE, &data)?;
    let shape = match shape[..] {
        [1, channels, rows, columns] | [channels, rows, columns] if !data.is_empty() => {
            vec![channels, rows, columns]
        }
        _ => {
            let reason = format!("{shape:?} is not channels × rows × columns");
            return Err(Error::format(path, "shape", reason));
        }
    };
    Ok(BTreeMap::from([(MEAN_IMAGE.to_owned(), Tensor { shape, data })]))
}

#[expect(clippy::cast_possible_truncation, reason = "weights are f32")]
fn numbers(path: &Path, elements: Elements) -> Result<Vec<f32>> {
    match elements {
        Elements::F32(values) => Ok(values),
        Elements::F64(values) => Ok(values.into_iter().map(|it| it as f32).collect()),
        _ => Err(Error::format(path, "type", "a mean image is of f32 or f64")),
    }
}
