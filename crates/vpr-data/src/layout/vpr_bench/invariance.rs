//! The dictionaries of the invariance study: a curve, or an area, per technique.

use std::{collections::BTreeMap, path::Path};

use vpr_core::{Error, Result};
use vpr_files::pickle::{self, Value};

/// Reads a dictionary of curves: scores per image of the series, by technique.
///
/// # Errors
///
/// [`Error::Io`], or [`Error::Format`] that names the technique whose entry is not a curve of
/// finite numbers.
pub fn read_curves(path: &Path) -> Result<BTreeMap<String, Vec<f64>>> {
    read(path, "a vector of finite numbers", |value| {
        value.to_f64s().filter(|curve| curve.iter().all(|score| score.is_finite()))
    })
}

/// Reads a dictionary of areas between curves, by technique.
///
/// # Errors
///
/// [`Error::Io`], or [`Error::Format`] that names the technique whose entry is not a finite number.
pub fn read_areas(path: &Path) -> Result<BTreeMap<String, f64>> {
    read(path, "a finite number", |value| value.as_f64().filter(|area| area.is_finite()))
}

fn read<T>(
    path: &Path,
    expected: &str,
    entry: impl Fn(&Value) -> Option<T>,
) -> Result<BTreeMap<String, T>> {
    let pairs = match pickle::read(path)? {
        Value::Dict(pairs) => pairs,
        other => {
            let reason = format!("expected a dict by technique, got {}", other.kind());
            return Err(Error::format(path, "byte 0", reason));
        }
    };
    let mut entries = BTreeMap::new();
    for (key, value) in &pairs {
        let name = key.as_text().ok_or_else(|| {
            Error::format(path, "keys", format!("expected names, got {}", key.kind()))
        })?;
        let place = || format!("`{}`", name.escape_debug());
        let entry = entry(value).ok_or_else(|| {
            Error::format(path, place(), format!("expected {expected}, got {}", value.kind()))
        })?;
        if entries.insert(name.to_owned(), entry).is_some() {
            return Err(Error::format(path, place(), "appears twice"));
        }
    }
    Ok(entries)
}
