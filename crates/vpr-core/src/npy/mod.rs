//! Reads and writes NumPy's `.npy` files.
//!
//! A header is believed only if the file is exactly as long as it says, so a lie is an error and
//! not an allocation. Object arrays go through [`crate::pickle`].

pub(crate) mod dtype;
mod header;

use std::path::Path;

use crate::{
    Error, Result,
    pickle::{self, Elements, Value},
};
use header::Header;

/// Reads a `.npy` file of Python objects: its shape and the objects in C order.
///
/// # Errors
///
/// [`Error::Io`], or [`Error::Format`] with the byte offset of what is malformed or refused; see
/// [`crate::pickle`].
pub fn read_objects(path: &Path) -> Result<(Vec<usize>, Vec<Value>)> {
    let bytes = std::fs::read(path).map_err(Error::io(path))?;
    let header = Header::parse(&bytes).map_err(|(offset, reason)| at(path, offset, reason))?;
    if header.dtype.kind != dtype::Kind::Object {
        let name = header.dtype.kind.name();
        return Err(at(path, 0, format!("holds {name}, not objects")));
    }
    let refused = |refusal: pickle::Refusal| refusal.in_file(path, header.len);
    match pickle::decode(&bytes[header.len..]).map_err(refused)? {
        Value::Array { shape, elements: Elements::Object(values) } if shape == header.shape => {
            Ok((shape, values))
        }
        Value::Array { shape, .. } => {
            let reason = format!("the header says {:?}, the pickle holds {shape:?}", header.shape);
            Err(at(path, header.len, reason))
        }
        other => Err(at(path, header.len, format!("the pickle holds {}", other.kind()))),
    }
}

/// An error of the file at `path`, at a byte of it.
fn at(path: &Path, offset: usize, reason: impl Into<String>) -> Error {
    Error::format(path, format!("byte {offset}"), reason)
}
