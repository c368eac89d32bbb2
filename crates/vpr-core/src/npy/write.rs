//! Writes arrays as NumPy would; a file is complete or not there.

use std::{
    fs::{self, File},
    io::{BufWriter, Write},
    path::Path,
};

use super::header::Header;
use crate::{Error, Result};

/// Writes a header and `elements`, each as its little-endian bytes, to `path`.
///
/// The bytes go to a temporary file beside `path`, which takes its name once they are on disk.
pub(super) fn write<const N: usize>(
    path: &Path,
    descr: &str,
    shape: &[usize],
    elements: impl Iterator<Item = [u8; N]>,
) -> Result<()> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let temporary = path.with_file_name(format!(".{name}.{}.tmp", std::process::id()));
    let write = || {
        let mut out = BufWriter::with_capacity(1 << 16, File::create(&temporary)?);
        out.write_all(&Header::write(descr, shape))?;
        for element in elements {
            out.write_all(&element)?;
        }
        out.into_inner().map_err(std::io::IntoInnerError::into_error)?.sync_all()?;
        fs::rename(&temporary, path)
    };
    write().map_err(|source| {
        // The write has failed already; a leftover that cannot be removed either changes nothing.
        let _ = fs::remove_file(&temporary);
        Error::Io { path: path.to_owned(), source }
    })
}
