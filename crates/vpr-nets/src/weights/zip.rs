//! Checkpoints since PyTorch 1.6: a zip archive of a pickle and one file per storage.

use std::{
    borrow::Cow,
    collections::BTreeMap,
    io::{Cursor, Read as _},
    path::Path,
};

use vpr_files::pickle::decode_checkpoint;
use zip::{CompressionMethod, ZipArchive};

use super::{Tensor, checkpoint, estimators, storage};
use crate::{Error, Result};

/// Whether a file begins like an archive.
pub(super) fn is_archive(bytes: &[u8]) -> bool {
    bytes.starts_with(b"PK\x03\x04")
}

/// All tensors of a file, and the arrays of the estimators beside them.
pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<[BTreeMap<String, Tensor>; 2]> {
    let mut archive = Archive::open(path, bytes)?;
    if archive.stored("byteorder")?.is_some_and(|order| order != b"little") {
        return Err(Error::format(path, "byteorder", "written by a big-endian machine"));
    }
    let pickle = archive.stored("data.pkl")?.ok_or_else(|| {
        Error::format(path, "data.pkl", "not in the archive, so this is no checkpoint")
    })?;
    let (root, _) = decode_checkpoint(pickle).map_err(|refusal| {
        let place = format!("data.pkl: byte {}", refusal.offset);
        Error::format(path, place, refusal.reason)
    })?;
    let arrays = estimators::arrays(path, &root)?;
    let views = checkpoint::views(path, root)?;
    let tensors = storage::tensors(path, views, bytes.len(), |view| {
        let name = format!("data/{}", view.storage);
        let data = archive.stored(&name)?;
        data.map(Cow::Borrowed)
            .ok_or_else(|| Error::format(path, name, "the storage is not in the archive"))
    })?;
    Ok([tensors, arrays])
}

struct Archive<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    zip: ZipArchive<Cursor<&'a [u8]>>,
    /// The folder that everything is in.
    folder: String,
}

impl<'a> Archive<'a> {
    fn open(path: &'a Path, bytes: &'a [u8]) -> Result<Self> {
        let zip = ZipArchive::new(Cursor::new(bytes))
            .map_err(|err| Error::format(path, "archive", err.to_string()))?;
        let folder = zip
            .file_names()
            .filter_map(|name| Some(name.ok()?.strip_suffix("data.pkl")?.to_owned()))
            .min_by_key(String::len)
            .unwrap_or_default();
        Ok(Self { path, bytes, zip, folder })
    }

    /// The bytes of an entry, which PyTorch never compresses; `None` if there is none.
    fn stored(&mut self, name: &str) -> Result<Option<&'a [u8]>> {
        let full_name = format!("{}{name}", self.folder);
        let Some(index) = self.zip.index_for_name(&full_name) else { return Ok(None) };
        let path = self.path;
        let wrong = |reason: String| Error::format(path, full_name.clone(), reason);
        let mut entry = self.zip.by_index(index).map_err(|err| wrong(err.to_string()))?;
        if entry.compression() != CompressionMethod::Stored {
            return Err(wrong("compressed, which checkpoints are not".to_owned()));
        }
        let start = entry.data_start().and_then(|start| usize::try_from(start).ok());
        let range = start.zip(usize::try_from(entry.size()).ok());
        let data = range
            .and_then(|(start, len)| self.bytes.get(start..start.checked_add(len)?))
            .ok_or_else(|| wrong("lies outside of the file".to_owned()))?;
        // Reading to the end checks the sum that the archive keeps of it.
        let mut chunk = [0; 1 << 14];
        loop {
            match entry.read(&mut chunk) {
                Ok(0) => return Ok(Some(data)),
                Ok(_) => {}
                Err(err) => return Err(wrong(err.to_string())),
            }
        }
    }
}
