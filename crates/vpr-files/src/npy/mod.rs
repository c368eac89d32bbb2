//! Reads and writes NumPy's `.npy` files.
//!
//! A header is believed only if the file is exactly as long as it says, so a lie is an error and
//! not an allocation. Either byte order and either memory order is read; arrays come back in C
//! order. Object arrays go through [`crate::pickle`], archives of arrays through [`npz`].

mod any;
mod header;
pub mod npz;
mod read;
mod write;

use std::path::Path;

use ndarray::{Array, Array1, Array2, ArrayView2, Dimension};

pub use any::{decode_value, read_value};
pub use read::Element;

use crate::{
    Error, Result,
    pickle::{self, Elements, Value},
};
pub(crate) use header::Header;

/// Reads an array of numbers.
///
/// # Errors
///
/// [`Error::Io`], or [`Error::Format`] if the header does not match the length of the file, the
/// type is none that [`Element`] says, or the number of dimensions is not that of `D`.
pub fn read<T: Element, D: Dimension>(path: &Path) -> Result<Array<T, D>> {
    read::with_dimensions(read::read_file(path)?.0).map_err(|reason| at(path, 0, reason))
}

/// Reads a matrix of `float32` or `float16`, as descriptors are stored.
///
/// # Errors
///
/// As for [`read()`]; wider types are refused, see [`read_f32_rounded`].
pub fn read_f32(path: &Path) -> Result<Array2<f32>> {
    read(path)
}

/// Reads a matrix of any numbers, rounded to f32, and says which type they have in the file, by
/// `NumPy`'s name, such as `float64`.
///
/// # Errors
///
/// As for [`read()`].
pub fn read_f32_rounded(path: &Path) -> Result<(Array2<f32>, &'static str)> {
    let (values, stored) = read::read_file(path)?;
    let values = read::with_dimensions(values).map_err(|reason| at(path, 0, reason))?;
    Ok((unwrapped(values), stored))
}

/// The numbers that were rounded, in the memory they have.
fn unwrapped(values: Array2<read::Rounded>) -> Array2<f32> {
    values.mapv_into_any(|read::Rounded(value)| value)
}

/// Reads a matrix of any numbers that f64 holds.
///
/// # Errors
///
/// As for [`read()`].
pub fn read_f64(path: &Path) -> Result<Array2<f64>> {
    read(path)
}

/// Reads a vector of integers of any type.
///
/// # Errors
///
/// As for [`read()`]; an unsigned integer beyond i64 is refused.
pub fn read_i64(path: &Path) -> Result<Array1<i64>> {
    read(path)
}

/// Writes a matrix of `float32`; the file is complete or not there.
///
/// # Errors
///
/// [`Error::Io`].
pub fn write_f32(path: &Path, values: ArrayView2<'_, f32>) -> Result<()> {
    write::write(path, "<f4", values.shape(), values.iter().map(|value| value.to_le_bytes()))
}

/// Writes a matrix of `float64`; the file is complete or not there.
///
/// # Errors
///
/// [`Error::Io`].
pub fn write_f64(path: &Path, values: ArrayView2<'_, f64>) -> Result<()> {
    write::write(path, "<f8", values.shape(), values.iter().map(|value| value.to_le_bytes()))
}

/// Writes a vector of `int64`; the file is complete or not there.
///
/// # Errors
///
/// [`Error::Io`].
pub fn write_i64(path: &Path, values: &[i64]) -> Result<()> {
    write::write(path, "<i8", &[values.len()], values.iter().map(|value| value.to_le_bytes()))
}

/// Reads a `.npy` file of Python objects: its shape and the objects in C order.
///
/// # Errors
///
/// [`Error::Io`], or [`Error::Format`] with the byte offset of what is malformed or refused; see
/// [`crate::pickle`].
pub fn read_objects(path: &Path) -> Result<(Vec<usize>, Vec<Value>)> {
    let bytes = std::fs::read(path).map_err(Error::io(path))?;
    objects(&bytes).map_err(|(offset, reason)| at(path, offset, reason))
}

/// The shape and the objects of a whole `.npy` file, or where and why there are none.
fn objects(bytes: &[u8]) -> Result<(Vec<usize>, Vec<Value>), (usize, String)> {
    let header = Header::parse(bytes)?;
    if header.dtype.kind != crate::dtype::Kind::Object {
        return Err((0, format!("holds {}, not objects", header.dtype.kind.name())));
    }
    let refused = |refusal: pickle::Refusal| (header.len + refusal.offset, refusal.reason);
    match pickle::decode(&bytes[header.len..]).map_err(refused)? {
        Value::Array { shape, elements: Elements::Object(values) } if shape == header.shape => {
            Ok((shape, values))
        }
        Value::Array { shape, .. } => {
            let reason = format!("the header says {:?}, the pickle holds {shape:?}", header.shape);
            Err((header.len, reason))
        }
        other => Err((header.len, format!("the pickle holds {}", other.kind()))),
    }
}

/// An error of the file at `path`, at a byte of it.
fn at(path: &Path, offset: usize, reason: impl Into<String>) -> Error {
    Error::format(path, format!("byte {offset}"), reason)
}
