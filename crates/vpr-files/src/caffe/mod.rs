//! Reads Caffe's weights: `.caffemodel` and `.binaryproto`.
//!
//! Both are protobuf messages of `caffe.proto`, of which this reads layer names and blobs: layers in
//! the form of 2014 (`layer`) and in the one before (`layers`), shapes as `shape` or as the four
//! older numbers, values in single or double precision, packed or not. What else a network says is
//! skipped by its length. The oldest form, in which a layer is nested once more, is refused.
//!
//! A blob's values are as many as its shape says, and there is at least one: what is allocated is
//! bounded by a small multiple of the length of the file.
//!
//! ```
//! use vpr_files::caffe::{Blob, decode_blob};
//!
//! // Field 7 is the shape, of which field 1 is packed: 2; field 5 holds the values.
//! let bytes = [&[0x3a, 3, 0x0a, 1, 2, 0x2a, 8][..], &[0, 0, 128, 63, 0, 0, 0, 64]].concat();
//! assert_eq!(decode_blob(&bytes)?, Blob { shape: vec![2], values: vec![1.0, 2.0] });
//!
//! let refusal = decode_blob(&bytes[..14]).unwrap_err();
//! assert_eq!(refusal.to_string(), "byte 5: needs 8 bytes, only 7 follow");
//! # Ok::<(), vpr_files::Refusal>(())
//! ```

mod wire;

use std::path::Path;

use self::wire::{Field, Message, Value};
use crate::{Error, Refusal, Result};

/// A layer that has weights.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Its name.
    pub name: String,
    /// Its weights, in Caffe's order: of a convolution or an inner product the weights, then the bias.
    pub blobs: Vec<Blob>,
}

/// An array of Caffe.
#[derive(Clone, Debug, PartialEq)]
pub struct Blob {
    /// Length along each axis: four of the older form, `number × channels × height × width`.
    pub shape: Vec<usize>,
    /// The values in row-major order, as many as the product of `shape`.
    pub values: Vec<f32>,
}

/// Where names and blobs are in the two forms of a layer.
struct Form {
    name: u64,
    blobs: u64,
}

/// `LayerParameter`, field 100 of a network.
const LAYER: Form = Form { name: 1, blobs: 7 };
/// `V1LayerParameter`, field 2 of a network.
const V1_LAYER: Form = Form { name: 4, blobs: 6 };

/// Reads the layers of a `.caffemodel` that have weights, in the order of the file.
///
/// # Errors
///
/// [`Error::Io`] if it cannot be read, [`Error::Format`] with the byte offset if it is refused.
pub fn read_model(path: &Path) -> Result<Vec<Layer>> {
    let bytes = std::fs::read(path).map_err(Error::io(path))?;
    decode_model(&bytes).map_err(|refusal| refusal.in_file(path, 0))
}

/// Reads a `.binaryproto`: one blob, such as the mean of the training images.
///
/// # Errors
///
/// As [`read_model`].
pub fn read_blob(path: &Path) -> Result<Blob> {
    let bytes = std::fs::read(path).map_err(Error::io(path))?;
    decode_blob(&bytes).map_err(|refusal| refusal.in_file(path, 0))
}

/// Decodes what [`read_model`] reads.
///
/// # Errors
///
/// A [`Refusal`] with the byte offset of what is malformed, or of the file's end if no layer has
/// weights.
pub fn decode_model(bytes: &[u8]) -> Result<Vec<Layer>, Refusal> {
    let mut network = Message::new(bytes);
    let mut layers = Vec::new();
    while let Some(Field { number, value, at }) = network.field()? {
        let form = match number {
            100 => LAYER,
            2 => V1_LAYER,
            _ => continue,
        };
        let layer = layer(message(value, at)?, &form, at)?;
        if !layer.blobs.is_empty() {
            layers.push(layer);
        }
    }
    if layers.is_empty() {
        let reason = "the file ends, and no layer had weights".to_owned();
        return Err(Refusal { offset: bytes.len(), reason });
    }
    Ok(layers)
}

/// Decodes what [`read_blob`] reads.
///
/// # Errors
///
/// A [`Refusal`] with the byte offset of what is malformed.
pub fn decode_blob(bytes: &[u8]) -> Result<Blob, Refusal> {
    blob(Message::new(bytes), 0)
}

fn layer(mut fields: Message<'_>, form: &Form, layer_at: usize) -> Result<Layer, Refusal> {
    let (mut name, mut blobs) = (String::new(), Vec::new());
    while let Some(Field { number, value, at }) = fields.field()? {
        if number == form.name {
            let text = message(value, at)?.bytes;
            let refuse = |_| Refusal { offset: at, reason: "the name is not UTF-8".to_owned() };
            str::from_utf8(text).map_err(refuse)?.clone_into(&mut name);
        } else if number == form.blobs {
            blobs.reserve_exact(1);
            blobs.push(blob(message(value, at)?, at)?);
        } else if number == 1 {
            // Field 1 of `V1LayerParameter` is a layer of the form before.
            let reason = "a layer in the form of 2013, which is not read".to_owned();
            return Err(Refusal { offset: at, reason });
        }
    }
    if name.is_empty() && !blobs.is_empty() {
        return Err(Refusal { offset: layer_at, reason: "a layer has no name".to_owned() });
    }
    Ok(Layer { name, blobs })
}

#[expect(clippy::cast_possible_truncation, reason = "weights are f32")]
fn blob(mut fields: Message<'_>, blob_at: usize) -> Result<Blob, Refusal> {
    let (mut older, mut shape, mut values) = ([None; 4], None, Vec::new());
    while let Some(Field { number, value, at }) = fields.field()? {
        let wrong = || Refusal { offset: at, reason: format!("field {number} is of another type") };
        match (number, value) {
            (1..=4, Value::Varint(len)) => older[number as usize - 1] = Some(len),
            (5, Value::Fixed32(bytes)) => values.push(f32::from_le_bytes(bytes)),
            (5, Value::Bytes(packed)) => {
                let (numbers, []) = packed.bytes.as_chunks() else { return Err(wrong()) };
                values.reserve_exact(numbers.len());
                values.extend(numbers.iter().copied().map(f32::from_le_bytes));
            }
            (8, Value::Fixed64(bytes)) => values.push(f64::from_le_bytes(bytes) as f32),
            (8, Value::Bytes(packed)) => {
                let (numbers, []) = packed.bytes.as_chunks() else { return Err(wrong()) };
                values.reserve_exact(numbers.len());
                values.extend(numbers.iter().map(|&it| f64::from_le_bytes(it) as f32));
            }
            (7, Value::Bytes(message)) => shape = Some(dimensions(message)?),
            (1..=5 | 7 | 8, _) => return Err(wrong()),
            _ => {}
        }
    }
    let shape = match shape {
        Some(shape) => shape,
        None if older.iter().any(Option::is_some) => {
            older.iter().map(|len| len.unwrap_or(0)).collect()
        }
        None => Vec::new(),
    };
    let n_values = shape.iter().try_fold(1_u64, |n, &len| n.checked_mul(len));
    if values.is_empty() || n_values != Some(values.len() as u64) {
        let reason = format!("a blob of shape {} has {} values", listed(&shape), values.len());
        return Err(Refusal { offset: blob_at, reason });
    }
    // Each is at most their product, which is a length.
    let shape = shape.into_iter().map(|len| len as usize).collect();
    Ok(Blob { shape, values })
}

/// The lengths of a `BlobShape`.
fn dimensions(mut fields: Message<'_>) -> Result<Vec<u64>, Refusal> {
    let mut lengths = Vec::new();
    while let Some(Field { number, value, at }) = fields.field()? {
        match (number, value) {
            (1, Value::Varint(len)) => lengths.push(len),
            (1, Value::Bytes(packed)) => packed.varints(|len| lengths.push(len))?,
            (1, _) => {
                return Err(Refusal { offset: at, reason: "a length is no number".to_owned() });
            }
            _ => {}
        }
        // Caffe's own limit; more would be no blob.
        if lengths.len() > 32 {
            return Err(Refusal { offset: at, reason: "a blob of more than 32 axes".to_owned() });
        }
    }
    Ok(lengths)
}

fn message(value: Value<'_>, at: usize) -> Result<Message<'_>, Refusal> {
    match value {
        Value::Bytes(message) => Ok(message),
        _ => Err(Refusal { offset: at, reason: "a number stands where bytes belong".to_owned() }),
    }
}

fn listed(shape: &[u64]) -> String {
    let lengths: Vec<String> = shape.iter().map(ToString::to_string).collect();
    format!("[{}]", lengths.join(", "))
}
