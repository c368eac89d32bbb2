//! How similar or how far every query is to every reference, from a file.

use std::path::Path;

use ndarray::Array2;
use vpr_core::{Error, Result, Similarities};
use vpr_files::{
    npy::{self, npz},
    pickle::{Elements, Value},
};

use super::text;
use crate::layout::vpr_bench::PublishedMatches;

/// Which way round the numbers of a matrix are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Higher is more similar.
    Similarities,
    /// Lower is nearer.
    Distances,
}

/// Reads a matrix, queries × references: `.npy` of any type of number, an `.npz` with nothing else,
/// text, or VPR-Bench's stored matches. Distances become similarities by their sign.
///
/// # Errors
///
/// [`Error::Io`]; [`Error::Format`] with the line of what is no number, for another shape, and for
/// a value that is not finite.
pub fn read_scores(path: &Path, scale: Scale) -> Result<Similarities> {
    let bytes = std::fs::read(path).map_err(Error::io(path))?;
    let values = if bytes.starts_with(b"\x93NUMPY") {
        match npy::read_value(path)? {
            Value::Array { elements: Elements::Object(_), .. } => {
                if scale == Scale::Distances {
                    let reason = "stored matches hold similarities: give `--similarities`";
                    return Err(Error::format(path, "content", reason));
                }
                return Ok(PublishedMatches::read(path)?.similarities);
            }
            value => of_array(path, value)?,
        }
    } else if bytes.starts_with(b"PK\x03\x04") {
        match npz::names(path)?.as_slice() {
            [only] => of_array(path, npz::read_value(path, only)?)?,
            names => {
                let names = vpr_files::shorten(&names.join(", "));
                let reason = format!("expected one array, got {names}");
                return Err(Error::format(path, "arrays", reason));
            }
        }
    } else {
        of_text(path, &bytes)?
    };
    let values = match scale {
        Scale::Similarities => values,
        Scale::Distances => values.mapv(|value| -value),
    };
    Similarities::new(values).map_err(|err| err.in_file(path))
}

fn of_array(path: &Path, value: Value) -> Result<Array2<f64>> {
    let err = |reason: String| Error::format(path, "content", reason);
    let Value::Array { shape, elements } = value else {
        return Err(err(format!("holds {}, not a matrix", value.kind())));
    };
    let [rows, columns] = shape[..] else {
        return Err(err(format!("has shape {shape:?}, but queries × references are expected")));
    };
    let values = elements.to_f64s().ok_or_else(|| err("holds no numbers".to_owned()))?;
    Array2::from_shape_vec((rows, columns), values).map_err(|cause| err(cause.to_string()))
}

fn of_text(path: &Path, bytes: &[u8]) -> Result<Array2<f64>> {
    let lines = text::lines(path, bytes)?;
    let n_columns = lines.first().map_or(0, |line| line.fields.len());
    let mut values = Vec::with_capacity(lines.len() * n_columns);
    for line in &lines {
        let err = |reason: String| Error::format(path, format!("line {}", line.number), reason);
        if line.fields.len() != n_columns {
            let n = line.fields.len();
            return Err(err(format!("{n} numbers, but the first line has {n_columns}")));
        }
        for field in &line.fields {
            let value = field
                .parse::<f64>()
                .map_err(|_| err(format!("`{}` is not a number", vpr_files::shorten(field))))?;
            values.push(value);
        }
    }
    Array2::from_shape_vec((lines.len(), n_columns), values)
        .map_err(|cause| Error::format(path, "content", cause.to_string()))
}
