//! Arrays of scikit-learn's estimators, in checkpoints and in pickles of their own.

use std::{collections::BTreeMap, path::Path};

use vpr_files::pickle::{Elements, Value, decode_estimators};

use super::{Tensor, storage};
use crate::{Error, Result};

/// Whether a file is a pickle, which its bytes do not say.
pub(super) fn is_pickle(path: &Path) -> bool {
    path.extension().is_some_and(|it| it.eq_ignore_ascii_case("pkl"))
}

/// All arrays of the estimators in a pickle, below the keys of the dictionaries around them, such as
/// `400.256.conv3.cluster_centers_`.
pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<BTreeMap<String, Tensor>> {
    let root = decode_estimators(bytes).map_err(|refusal| refusal.in_file(path, 0))?;
    arrays(path, &root)
}

/// The same of what was decoded; nothing if there is no estimator in it.
pub(super) fn arrays(path: &Path, root: &Value) -> Result<BTreeMap<String, Tensor>> {
    let mut tensors = BTreeMap::new();
    walk(path, "", root, false, &mut tensors)?;
    Ok(tensors)
}

/// Decoding bounds the depth.
fn walk(
    path: &Path,
    place: &str,
    value: &Value,
    in_estimator: bool,
    tensors: &mut BTreeMap<String, Tensor>,
) -> Result<()> {
    let (entries, in_estimator) = match value {
        Value::Dict(entries) => (entries, in_estimator),
        Value::Record { fields, .. } => (fields, true),
        Value::Array { shape, elements } if in_estimator => {
            if let Some(data) = numbers(elements) {
                storage::check_finite(path, place, &data)?;
                let tensor = Tensor { shape: shape.clone(), data };
                if tensors.insert(place.to_owned(), tensor).is_some() {
                    return Err(Error::format(path, place, "the key appears twice"));
                }
            }
            return Ok(());
        }
        _ => return Ok(()),
    };
    for (key, value) in entries {
        let key = match key {
            Value::Int(key) => key.to_string(),
            key => match key.as_text() {
                Some(key) => key.to_owned(),
                None => continue,
            },
        };
        let place = if place.is_empty() { key } else { format!("{place}.{key}") };
        walk(path, &place, value, in_estimator, tensors)?;
    }
    Ok(())
}

/// Fractions as f32; labels and other integers are no weights.
#[expect(clippy::cast_possible_truncation, reason = "weights are f32")]
fn numbers(elements: &Elements) -> Option<Vec<f32>> {
    match elements {
        Elements::F32(values) => Some(values.clone()),
        Elements::F64(values) => Some(values.iter().map(|&it| it as f32).collect()),
        _ => None,
    }
}
