//! What is checked when a map file is opened: header, shapes, digests; nothing that takes time.

use std::{fs::File, path::Path};

use super::{
    BlockDigest,
    header::{ElementType, Header, TensorEntry},
    layout::{self, Rows},
    touch::damaged,
};
use vpr_files::{access, shorten};

use crate::{Error, Result};

/// The file is a map of this version.
pub(super) fn check_format(path: &Path, header: &Header) -> Result<()> {
    let (key, expected) = layout::FORMAT;
    match header.metadata.get(key) {
        Some(format) if format == expected => Ok(()),
        Some(format) => {
            let reason = format!("is `{}`, this program reads `{expected}`", shorten(format));
            Err(Error::format(path, format!("metadata `{key}`"), reason))
        }
        None => {
            let reason = "a safetensors file, but no map: its metadata have no `format`";
            Err(Error::format(path, "header", reason))
        }
    }
}

/// The header is the one that was written.
pub(super) fn check_header(path: &Path, header: &Header, json: &[u8]) -> Result<()> {
    let stored = header.metadata.get(layout::HEADER_DIGEST).map_or("", String::as_str);
    if layout::header_digest(json, stored).to_hex() == stored {
        Ok(())
    } else {
        Err(Error::format(path, "header", damaged()))
    }
}

/// A tensor has the shape it must have and lies where it can be read.
pub(super) fn check_tensor(
    path: &Path,
    header: &Header,
    rows: &Rows,
    name: &str,
    entry: &TensorEntry,
) -> Result<()> {
    let place = || format!("tensor `{}`", shorten(name));
    if !layout::ORDER.contains(&name) {
        return Err(Error::format(path, place(), "is no part of a map"));
    }
    layout::check_shape(path, name, entry, rows.len as u64)?;
    let size = entry.dtype.size().unwrap_or(1);
    if (header.data_start + entry.data_offsets[0]).is_multiple_of(size) {
        Ok(())
    } else {
        Err(Error::format(path, place(), "is not aligned"))
    }
}

/// No tensor is there without those it needs.
pub(super) fn check_companions(path: &Path, header: &Header, rows: &Rows) -> Result<()> {
    let has = |name: &str| header.tensors.contains_key(name);
    let int8 = rows.row_type.element() == ElementType::I8;
    let lone = |name: &str, needed: &str| {
        Err(Error::format(path, "header", format!("has `{name}` and `{needed}` not both")))
    };
    if has(layout::NAMES) != has(layout::NAME_OFFSETS) {
        return lone(layout::NAMES, layout::NAME_OFFSETS);
    }
    if has(layout::ANCHORS) != has(layout::ANCHOR_OFFSETS) {
        return lone(layout::ANCHORS, layout::ANCHOR_OFFSETS);
    }
    if has(layout::SCALES) != int8 {
        return lone(layout::SCALES, "int8 descriptors");
    }
    let spatial = header.tensors.get(layout::POSITIONS).is_some_and(|entry| entry.shape[1] == 3);
    if has(layout::ORIENTATIONS) && !spatial {
        return lone(layout::ORIENTATIONS, "positions in space");
    }
    Ok(())
}

/// The table of digests is the one that was written.
pub(super) fn check_digests(path: &Path, header: &Header, digests: &[u8]) -> Result<()> {
    let stored = header.metadata.get(layout::DIGESTS_DIGEST).map_or("", String::as_str);
    if BlockDigest::of(digests).to_hex() == stored {
        return Ok(());
    }
    Err(Error::format(path, format!("tensor `{}`", layout::DIGESTS), damaged()))
}

/// Every block has a digest.
pub(super) fn check_n_digests(
    path: &Path,
    header: &Header,
    rows: &Rows,
    digests: &[u8],
) -> Result<()> {
    let n_blocks = rows.n_blocks() + layout::other_blocks(header).len();
    let n_digests = digests.len() / BlockDigest::LENGTH;
    if n_digests == n_blocks {
        return Ok(());
    }
    let reason = format!("has {n_digests} digests for {n_blocks} blocks");
    Err(Error::format(path, format!("tensor `{}`", layout::DIGESTS), reason))
}

/// Reads the bytes of a tensor without checking its digests.
pub(super) fn read_tensor(
    path: &Path,
    file: &File,
    header: &Header,
    name: &str,
) -> Result<Vec<u8>> {
    let entry = header.tensor(path, name)?;
    let mut bytes = vec![0; usize::try_from(entry.n_bytes()).unwrap_or(usize::MAX)];
    access::read_exact_at(file, &mut bytes, header.data_start + entry.data_offsets[0])
        .map_err(Error::io(path))?;
    Ok(bytes)
}

/// Checks the digests of a tensor other than the descriptors.
pub(super) fn check_tensor_digests(
    path: &Path,
    header: &Header,
    rows: &Rows,
    digests: &[u8],
    name: &str,
    bytes: &[u8],
) -> Result<()> {
    let blocks = layout::other_blocks(header);
    let stored = digests.as_chunks().0.iter().skip(rows.n_blocks());
    let stored = blocks.iter().zip(stored).filter(|(block, _)| block.tensor == name);
    for ((block, stored), actual) in stored.zip(layout::block_digests(bytes)) {
        if actual.to_bytes() != *stored {
            let place =
                format!("tensor `{name}`, bytes {}..{}", block.bytes.start, block.bytes.end);
            return Err(Error::format(path, place, damaged()));
        }
    }
    Ok(())
}
