//! Checkpoints before PyTorch 1.6: five pickles, then the storages one after another.

use std::{
    borrow::Cow,
    collections::{BTreeMap, HashMap},
    ops::Range,
    path::Path,
};

use vpr_files::pickle::{Element, Value, decode_checkpoint};

use super::{Tensor, checkpoint, estimators, storage};
use crate::{Error, Result};

/// The first pickle, a long number, and the start of the second.
const MAGIC: &[u8] = b"\x80\x02\x8a\x0a\x6c\xfc\x9c\x46\xf9\x20\x6a\xa8\x50\x19.";
/// The second pickle: the version of this format.
const PROTOCOL: i64 = 1001;

/// Whether a file begins like one.
pub(super) fn is_legacy(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

/// All tensors of a file, and the arrays of the estimators beside them.
pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<[BTreeMap<String, Tensor>; 2]> {
    let mut at = MAGIC.len();
    let mut next = || {
        let start = at;
        let (value, len) = decode_checkpoint(&bytes[start..])
            .map_err(|refusal| Error::from(refusal.in_file(path, start)))?;
        at += len;
        Ok::<_, Error>((value, at))
    };
    let (protocol, end) = next()?;
    if protocol != Value::Int(PROTOCOL) {
        return Err(Error::format(path, format!("byte {end}"), "not version 1001 of the format"));
    }
    let (system, end) = next()?;
    if !is_little_endian(&system) {
        return Err(Error::format(path, format!("byte {end}"), "written by a big-endian machine"));
    }
    let (root, _) = next()?;
    let (keys, start) = next()?;
    let arrays = estimators::arrays(path, &root)?;
    let views = checkpoint::views(path, root)?;
    let elements = views.values().map(|view| (view.storage.as_str(), view.element)).collect();
    let places = places(path, bytes, start, keys, &elements)?;
    let tensors = storage::tensors(path, views.clone(), bytes.len(), |view| {
        match places.get(view.storage.as_str()) {
            Some(place) => Ok(Cow::Borrowed(&bytes[place.clone()])),
            None => Err(Error::format(path, &view.storage, "the storage is not in the file")),
        }
    })?;
    Ok([tensors, arrays])
}

fn is_little_endian(system: &Value) -> bool {
    let Value::Dict(entries) = system else { return false };
    entries
        .iter()
        .all(|(key, value)| key.as_text() != Some("little_endian") || *value == Value::Bool(true))
}

/// Where each storage lies: a count of eight bytes, then that many elements.
fn places(
    path: &Path,
    bytes: &[u8],
    start: usize,
    keys: Value,
    elements: &HashMap<&str, Element>,
) -> Result<HashMap<String, Range<usize>>> {
    let Value::List(keys) = keys else {
        return Err(Error::format(path, format!("byte {start}"), "not a list of storages"));
    };
    let (mut at, mut places) = (start, HashMap::new());
    for key in keys {
        let at_error = |reason: &str| Error::format(path, format!("byte {at}"), reason);
        let key = key.as_text().ok_or_else(|| at_error("the key of a storage is not text"))?;
        // A storage that no tensor of ours uses has a length we cannot know.
        let Some(element) = elements.get(key) else {
            return Err(at_error("a storage that no weight uses"));
        };
        let count = bytes[at..].first_chunk::<8>().ok_or_else(|| at_error("truncated"))?;
        let end = usize::try_from(u64::from_le_bytes(*count))
            .ok()
            .and_then(|count| count.checked_mul(element.size()))
            .and_then(|len| len.checked_add(at + 8))
            .filter(|&end| end <= bytes.len())
            .ok_or_else(|| at_error("a storage that is longer than the file"))?;
        places.insert(key.to_owned(), at + 8..end);
        at = end;
    }
    Ok(places)
}
