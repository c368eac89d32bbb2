//! `.npz` files: zip archives with one `.npy` per array.

use std::{
    borrow::Cow,
    fs::File,
    io::{self, BufReader, BufWriter, Read, Seek, Write},
    path::Path,
};

use ndarray::{Array, Array2, Dimension, Ix1};
use zip::{CompressionMethod, ZipArchive, ZipWriter, result::ZipError, write::SimpleFileOptions};

use super::{
    header::Header,
    read::{Element, Failure, Stored, read_from, with_dimensions},
};
use crate::{Error, Result, pickle::Value, shorten};

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
    with_dimensions(read_stored(path, name)?.0).map_err(|reason| wrong(path, name, reason))
}

/// Reads a matrix of any numbers, rounded to f32, and says which type they have in the file, by
/// `NumPy`'s name, such as `float64`.
///
/// # Errors
///
/// As for [`read()`].
pub fn read_f32_rounded(path: &Path, name: &str) -> Result<(Array2<f32>, &'static str)> {
    let (values, stored) = read_stored(path, name)?;
    let values = with_dimensions(values).map_err(|reason| wrong(path, name, reason))?;
    Ok((super::unwrapped(values), stored))
}

/// Reads a vector of texts: of fixed length, or Python's strings in an array of objects.
///
/// # Errors
///
/// As for [`read()`]; of objects those that [`crate::pickle`] refuses, and what is no string.
pub fn read_texts(path: &Path, name: &str) -> Result<Vec<String>> {
    if describe(path, name)?.0 != "object" {
        return Ok(read::<String, Ix1>(path, name)?.to_vec());
    }
    let mut bytes = Vec::new();
    with_entry(path, name, |entry, size| {
        entry.take(size).read_to_end(&mut bytes).map_err(|err| wrong(path, name, err.to_string()))
    })?;
    let (shape, values) = super::objects(&bytes)
        .map_err(|(offset, reason)| wrong(path, name, format!("byte {offset}: {reason}")))?;
    if shape.len() != 1 {
        return Err(wrong(
            path,
            name,
            format!("has shape {shape:?}, but 1 dimensions are expected"),
        ));
    }
    let text = |(row, value): (usize, &Value)| {
        let text = value.as_text().map(str::to_owned);
        text.ok_or_else(|| wrong(path, name, format!("row {row} is {}, not text", value.kind())))
    };
    values.iter().enumerate().map(|(row, value)| text((row, value))).collect()
}

/// Reads an array of numbers, truth values, texts or objects as a [`Value::Array`].
///
/// # Errors
///
/// As for [`read()`] and [`super::read_objects`].
pub fn read_value(path: &Path, name: &str) -> Result<Value> {
    let mut bytes = Vec::new();
    with_entry(path, name, |entry, size| {
        entry.take(size).read_to_end(&mut bytes).map_err(|err| wrong(path, name, err.to_string()))
    })?;
    super::any::value(&bytes)
        .map_err(|(offset, reason)| wrong(path, name, format!("byte {offset}: {reason}")))
}

/// The type of an array's elements by `NumPy`'s name, and its shape, from its header alone.
///
/// # Errors
///
/// [`Error::Io`], or [`Error::Format`] if it is not there or its header is not understood.
pub fn describe(path: &Path, name: &str) -> Result<(&'static str, Vec<usize>)> {
    with_entry(path, name, |entry, _| {
        super::read::describe(entry).map_err(|reason| wrong(path, name, reason))
    })
}

fn wrong(path: &Path, name: &str, reason: String) -> Error {
    Error::format(path, format!("array `{}`", shorten(name)), reason)
}

fn read_stored<T: Element>(path: &Path, name: &str) -> Result<Stored<T>> {
    let err = |offset, reason| wrong(path, name, format!("byte {offset}: {reason}"));
    with_entry(path, name, |entry, size| {
        read_from(entry, size, err).map_err(|failure| match failure {
            // An archive in good order can be read; what fails here is its compression or checksum.
            Failure::Io(cause) => wrong(path, name, cause.to_string()),
            Failure::Refused(err) => err,
        })
    })
}

/// Hands on the bytes of an array and how many there are, as far as its archive can be believed.
fn with_entry<R>(
    path: &Path,
    name: &str,
    then: impl FnOnce(&mut dyn Read, u64) -> Result<R>,
) -> Result<R> {
    let err = |reason: String| wrong(path, name, reason);
    let mut archive = open(path)?;
    let mut entry = match archive.by_name(&format!("{name}.npy")) {
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
    then(&mut entry, size)
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
