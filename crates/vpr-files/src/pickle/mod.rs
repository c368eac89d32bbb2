//! Reads Python pickles as data: never executes, refuses what it does not know.
//!
//! Published datasets come as pickles inside `.npy` files and as `.pkl` dictionaries. This reader
//! knows the opcodes and the few NumPy constructors that those need (protocols 0 to 5, NumPy 1 and
//! 2, Python 2 and 3); everything else is an error that names the opcode and its byte offset.
//! Decoding does not recurse, and what it allocates is linear in the length of the input: at worst
//! some hundred bytes per byte (144 measured, for nothing but empty lists), one for a stored score
//! matrix. An object that a pickle shares is copied, but all values together may hold at most
//! [`MAX_EXPANSION`] times as many bytes and objects as the pickle has bytes, nested at most
//! [`MAX_DEPTH`] levels deep.
//!
//! PyTorch's checkpoints have a dialect of their own, [`decode_checkpoint`], and so have files of
//! scikit-learn's estimators, [`decode_estimators`].
//!
//! ```
//! use vpr_files::pickle::{Value, decode};
//!
//! assert_eq!(decode(b"(I0\nI-1\nl.")?, Value::List(vec![Value::Int(0), Value::Int(-1)]));
//!
//! let refusal = decode(b"cos\nsystem\n(S'true'\ntR.").unwrap_err();
//! assert_eq!(refusal.to_string(), "byte 0: GLOBAL: `os.system` is not on the list of what is read");
//! # Ok::<(), vpr_files::pickle::Refusal>(())
//! ```

mod cursor;
mod machine;
mod numpy;
mod object;
mod scikit;
mod text;
mod torch;
mod unfold;

use std::path::Path;

pub use crate::value::{Element, Elements, Tensor, Value};
pub use unfold::{MAX_DEPTH, MAX_EXPANSION};

pub use crate::Refusal;
use crate::{Error, Result};

/// Decodes one pickle that fills all of `bytes`.
///
/// # Errors
///
/// A [`Refusal`] with the byte offset of what is malformed, unknown or too deeply nested.
pub fn decode(bytes: &[u8]) -> Result<Value, Refusal> {
    let (root, arena) = machine::run(bytes)?;
    unfold::unfold(root, &arena, bytes.len())
}

/// Reads a pickle file.
///
/// # Errors
///
/// [`Error::Io`] if it cannot be read, [`Error::Format`] with the byte offset if it is refused.
pub fn read(path: &Path) -> Result<Value> {
    let bytes = std::fs::read(path).map_err(Error::io(path))?;
    decode(&bytes).map_err(|refusal| refusal.in_file(path, 0))
}

/// Decodes one pickle that fills all of `bytes` and may hold estimators of scikit-learn.
///
/// Beside what [`decode`] reads, `PCA`, `KMeans` and `MiniBatchKMeans` are [`Value::Record`], and ordered
/// dictionaries and those with a default are dictionaries. Nothing is called.
///
/// # Errors
///
/// As [`decode`].
pub fn decode_estimators(bytes: &[u8]) -> Result<Value, Refusal> {
    let (root, arena) = machine::run_estimators(bytes)?;
    unfold::unfold(root, &arena, bytes.len())
}

/// Decodes the checkpoint's pickle that `bytes` begin with; returns its value and its length.
///
/// Beside what [`decode`] reads, tensors are [`Value::Tensor`], ordered
/// dictionaries are dictionaries, estimators of scikit-learn are [`Value::Record`], and settings that lie beside weights (`argparse.Namespace`,
/// paths, devices) are [`Value::None`]. Nothing is called.
///
/// # Errors
///
/// A [`Refusal`] with the byte offset of what is malformed, unknown or too deeply nested.
pub fn decode_checkpoint(bytes: &[u8]) -> Result<(Value, usize), Refusal> {
    let (root, arena, len) = machine::run_checkpoint(bytes)?;
    Ok((unfold::unfold(root, &arena, bytes.len())?, len))
}
