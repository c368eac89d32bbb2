//! Arrays of whatever type, as values.

use std::path::Path;

use ndarray::{ArrayD, IxDyn, ShapeBuilder};

use super::{at, header::Header, objects};
use crate::{
    Error, Result,
    dtype::Kind,
    pickle::{Elements, Value},
};

/// Reads an array of numbers, truth values, texts or objects as a [`Value::Array`].
///
/// # Errors
///
/// As for [`super::read()`] and [`super::read_objects`].
pub fn read_value(path: &Path) -> Result<Value> {
    decode_value(path, &std::fs::read(path).map_err(Error::io(path))?)
}

/// The same of bytes; `path` is what errors call them.
///
/// # Errors
///
/// Those of [`read_value`], reading apart.
pub fn decode_value(path: &Path, bytes: &[u8]) -> Result<Value> {
    value(bytes).map_err(|(offset, reason)| at(path, offset, reason))
}

/// The array of a whole `.npy` file, or where and why there is none.
pub(super) fn value(bytes: &[u8]) -> Result<Value, (usize, String)> {
    let header = Header::parse(bytes)?;
    if header.dtype.kind == Kind::Object {
        let (shape, values) = objects(bytes)?;
        return Ok(Value::Array { shape, elements: Elements::Object(values) });
    }
    let body = &bytes[header.len..];
    let Some((n, _)) = header.size().filter(|&(_, size)| size == body.len()) else {
        let (shape, name, n) = (&header.shape, header.dtype.kind.name(), body.len());
        let reason = format!("the header says {shape:?} {name}, but {n} bytes follow");
        return Err((header.len, reason));
    };
    let elements = header.dtype.decode(body).filter(|elements| elements.len() == n);
    let elements = elements.ok_or_else(|| (header.len, "an element does not fit".to_owned()))?;
    let elements =
        if header.fortran_order { in_c_order(elements, &header.shape) } else { elements };
    Ok(Value::Array { shape: header.shape, elements })
}

fn in_c_order(elements: Elements, shape: &[usize]) -> Elements {
    fn turned<T: Clone>(values: Vec<T>, shape: &[usize]) -> Vec<T> {
        // As many values as the shape says: checked before.
        match ArrayD::from_shape_vec(IxDyn(shape).f(), values.clone()) {
            Ok(array) => array.iter().cloned().collect(),
            Err(_) => values,
        }
    }
    match elements {
        Elements::Bool(values) => Elements::Bool(turned(values, shape)),
        Elements::Int(values) => Elements::Int(turned(values, shape)),
        Elements::F32(values) => Elements::F32(turned(values, shape)),
        Elements::F64(values) => Elements::F64(turned(values, shape)),
        Elements::Text(values) => Elements::Text(turned(values, shape)),
        Elements::Object(values) => Elements::Object(turned(values, shape)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(descr: &str, fortran: &str, shape: &str, body: &[u8]) -> Vec<u8> {
        let text =
            format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}\n");
        let len = u16::try_from(text.len()).unwrap().to_le_bytes();
        [b"\x93NUMPY\x01\x00", len.as_slice(), text.as_bytes(), body].concat()
    }

    #[test]
    fn truth_values_come_in_c_order() {
        let bytes = file("|b1", "True", "(2, 3)", &[1, 0, 0, 1, 1, 0]);
        let elements = Elements::Bool(vec![true, false, true, false, true, false]);
        assert_eq!(value(&bytes).unwrap(), Value::Array { shape: vec![2, 3], elements });
    }

    #[test]
    fn every_cut_is_noticed() {
        let bytes = file("<i2", "False", "(3,)", &[1, 0, 2, 0, 255, 255]);
        let elements = Elements::Int(vec![1, 2, -1]);
        assert_eq!(value(&bytes).unwrap(), Value::Array { shape: vec![3], elements });
        for len in 0..bytes.len() {
            assert!(value(&bytes[..len]).is_err(), "{len}");
        }
    }
}
