//! From a decoded checkpoint to its tensors by key.

use std::{collections::BTreeMap, path::Path};

use vpr_files::pickle::{Tensor as View, Value};

use crate::{Error, Result};

/// Entries of a training checkpoint that hold the weights, the first that exists.
const WRAPPERS: [&str; 3] = ["state_dict", "model_state_dict", "model"];

/// All tensors of a checkpoint's root, in order of the file.
pub(super) fn views(path: &Path, root: Value) -> Result<BTreeMap<String, View>> {
    let mut views = BTreeMap::new();
    match unwrap(root) {
        Value::Dict(entries) => flatten(path, "", entries, &mut views)?,
        other => {
            let reason = format!("the checkpoint holds {}, not a dictionary", other.kind());
            return Err(Error::format(path, "pickle", reason));
        }
    }
    Ok(views)
}

fn unwrap(root: Value) -> Value {
    let Value::Dict(mut entries) = root else { return root };
    let wrapper = WRAPPERS.iter().find_map(|name| {
        entries
            .iter()
            .position(|(key, value)| key.as_text() == Some(name) && matches!(value, Value::Dict(_)))
    });
    match wrapper {
        Some(index) => entries.swap_remove(index).1,
        None => Value::Dict(entries),
    }
}

fn flatten(
    path: &Path,
    prefix: &str,
    entries: Vec<(Value, Value)>,
    views: &mut BTreeMap<String, View>,
) -> Result<()> {
    for (key, value) in entries {
        let Some(key) = key.as_text() else { continue };
        let key = if prefix.is_empty() { key.to_owned() } else { format!("{prefix}.{key}") };
        match value {
            Value::Dict(entries) => flatten(path, &key, entries, views)?,
            Value::Tensor(view) => match views.insert(key.clone(), view) {
                None => {}
                Some(_) => return Err(Error::format(path, key, "the key appears twice")),
            },
            _ => {}
        }
    }
    Ok(())
}
