//! `.npz` files: zip archives with one `.npy` per array.

use std::{
    borrow::Cow,
    fs::File,
    io::{self, BufReader, BufWriter, Seek, Write},
    path::Path,
};

use ndarray::{Array, Dimension};
use zip::{CompressionMethod, ZipArchive, ZipWriter, result::ZipError, write::SimpleFileOptions};

use super::{
    header::Header,
    read::{Element, Failure, read_from, with_dimensions},
};
use crate::{Error, Result};

/// No DEFLATE stream grows by more than this.
const MAX_INFLATION: u64 = 1032;

/// The names of the arrays in an archive, in its order.
///
/// # Errors
///
/// [`Error::Io`], or [`Error::Format`] if it is not a zip archive.
pub fn names(path: &Path) -> Result<Vec<String>> {
    let archive = open(path)?;
    let name = |name: Result<Cow<'_, str>, ZipError>| {
        let name = name.map_err(|cause| Error::format(path, "archive", cause.to_string()))?;
        Ok(name.strip_suffix(".npy").unwrap_or(&name).to_owned())
    };
    archive.file_names().map(name).collect()
}

/// Reads the array called `name`, without the extension.
///
/// # Errors
///
/// [`Error::Io`], or [`Error::Format`] with the array and what is wrong with it: it is not there,
/// its header does not match its length, it holds another type, or has another number of
/// dimensions than `D`.
pub fn read<T: Element, D: Dimension>(path: &Path, name: &str) -> Result<Array<T, D>> {
    let err = |reason: String| Error::format(path, format!("array `{name}`"), reason);
    let mut archive = open(path)?;
    let entry = match archive.by_name(&format!("{name}.npy")) {
        Ok(entry) => entry,
        Err(ZipError::FileNotFound) => {
            let known = names(path)?.join(", ");
            return Err(err(format!("is not there; known: {}", known.escape_debug())));
        }
        Err(cause) => return Err(err(cause.to_string())),
    };
    let (size, n_compressed) = (entry.size(), entry.compressed_size());
    let on_disk = path.metadata().map_err(Error::io(path))?.len();
    if n_compressed > on_disk || size > n_compressed.saturating_mul(MAX_INFLATION) {
        let reason = format!("{n_compressed} bytes cannot inflate to {size}");
        return Err(err(reason));
    }
    let array = read_from(entry, size, |offset, reason| err(format!("byte {offset}: {reason}")));
    let array = array.map_err(|failure| match failure {
        // An archive in good order can be read; what fails here is its compression or checksum.
        Failure::Io(cause) => err(cause.to_string()),
        Failure::Refused(err) => err,
    })?;
    with_dimensions(array).map_err(err)
}

fn open(path: &Path) -> Result<ZipArchive<BufReader<File>>> {
    let file = File::open(path).map_err(Error::io(path))?;
    ZipArchive::new(BufReader::new(file)).map_err(|cause| match cause {
        ZipError::Io(source) => Error::Io { path: path.to_owned(), source },
        cause => Error::format(path, "archive", cause.to_string()),
    })
}

/// Writes an archive array by array, uncompressed, as `numpy.savez` does.
pub struct Writer<W: Write + Seek>(ZipWriter<W>);

impl<W: Write + Seek> Writer<W> {
    /// An archive without arrays.
    pub fn new(out: W) -> Self {
        Self(ZipWriter::new(out))
    }

    /// Adds an array in C order: `descr` is `NumPy`'s short name of its element type, such as
    /// `<f4`, and `elements` are the bytes of each.
    ///
    /// # Errors
    ///
    /// If it cannot be written.
    pub fn add<const N: usize>(
        &mut self,
        name: &str,
        descr: &str,
        shape: &[usize],
        elements: impl Iterator<Item = [u8; N]>,
    ) -> io::Result<()> {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .large_file(true);
        self.0.start_file(format!("{name}.npy"), options)?;
        let mut out = BufWriter::with_capacity(1 << 16, &mut self.0);
        out.write_all(&Header::write(descr, shape))?;
        elements.into_iter().try_for_each(|element| out.write_all(&element))?;
        out.flush()
    }

    /// Ends the archive and gives back what it was written to.
    ///
    /// # Errors
    ///
    /// If it cannot be written.
    pub fn finish(self) -> io::Result<W> {
        Ok(self.0.finish()?)
    }
}
