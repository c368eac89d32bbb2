//! Files of the field, read carefully and written whole.
//!
//! [`npy`] reads and writes NumPy's arrays and archives, [`pickle`] decodes pickles as data and
//! never executes them, [`caffe`] and [`mat`] read Caffe's weights and MATLAB's arrays, [`replace()`] makes a file appear whole or not at all: the one way in which
//! this workspace writes files that others read.
//!
//! ```
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("frames.npy");
//! vpr_files::npy::write_i64(&path, &[3, 1, 2])?;
//! assert_eq!(vpr_files::npy::read_i64(&path)?.to_vec(), [3, 1, 2]);
//!
//! // What is cut off is an error that names the place, never a shorter array.
//! let bytes = std::fs::read(&path)?;
//! vpr_files::replace(&path, &bytes[..bytes.len() - 1])?;
//! let error = vpr_files::npy::read_i64(&path).unwrap_err();
//! assert!(error.to_string().contains("frames.npy"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod access;
pub mod caffe;
mod dtype;
mod error;
pub mod mat;
pub mod npy;
pub mod pickle;
mod replace;
mod value;

pub use error::{Error, Refusal, Result, shorten};
pub use replace::{NewFile, replace};

/// The examples of the README, as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
