//! Writes arrays as NumPy would; a file is complete or not there.

use std::{
    io::{BufWriter, Write},
    path::Path,
};

use super::header::Header;
use crate::{NewFile, Result};

/// Writes a header and `elements`, each as its little-endian bytes, to `path`.
pub(super) fn write<const N: usize>(
    path: &Path,
    descr: &str,
    shape: &[usize],
    elements: impl Iterator<Item = [u8; N]>,
) -> Result<()> {
    let mut new = NewFile::create(path)?;
    let io_error = new.io_error();
    let write = || {
        let mut out = BufWriter::with_capacity(1 << 16, new.file());
        out.write_all(&Header::write(descr, shape))?;
        for element in elements {
            out.write_all(&element)?;
        }
        out.flush()
    };
    write().map_err(io_error)?;
    new.commit()
}
