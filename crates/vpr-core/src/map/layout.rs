//! Which tensors a map file has, in which order, and which blocks of bytes have a digest.

use std::{ops::Range, path::Path};

use super::{
    digest::BlockDigest,
    header::{ElementType, Header, TensorEntry},
    row_type::RowType,
};
use crate::{Error, Result};

/// `n × dim`, [`RowType`].
pub(super) const DESCRIPTORS: &str = "descriptors";
/// `n`, f32: factor of every row of an int8 map.
pub(super) const SCALES: &str = "scales";
/// `n × 2` or `n × 3`, f64, metres.
pub(super) const POSITIONS: &str = "positions";
/// `n × 4`, f64, unit quaternions wxyz, world from camera.
pub(super) const ORIENTATIONS: &str = "orientations";
/// `n + 1`, i64: where in `names` each name starts.
pub(super) const NAME_OFFSETS: &str = "name_offsets";
/// `n + 1`, i64: where in `anchors` those of each row start.
pub(super) const ANCHOR_OFFSETS: &str = "anchor_offsets";
/// i64: the rows that regressed rows were computed from.
pub(super) const ANCHORS: &str = "anchors";
/// UTF-8 bytes of all names.
pub(super) const NAMES: &str = "names";
/// Up to seven bytes after the descriptors, so that doubles are aligned.
pub(super) const PADDING: &str = "padding";
/// `n_blocks × 16`, u8.
pub(super) const DIGESTS: &str = "block_digests";

/// All tensors in the order they lie in the file.
pub(super) const ORDER: [&str; 10] = [
    DESCRIPTORS,
    PADDING,
    POSITIONS,
    ORIENTATIONS,
    NAME_OFFSETS,
    ANCHOR_OFFSETS,
    ANCHORS,
    SCALES,
    NAMES,
    DIGESTS,
];

/// Metadata: what kind of safetensors file this is.
pub(super) const FORMAT: (&str, &str) = ("format", "vpr-map 1");
/// Metadata: the program that wrote it.
pub(super) const WRITER: &str = "writer";
/// Metadata: digest of the image names.
pub(super) const IMAGE_LIST: &str = "image_list_digest";
/// Metadata: Euclidean lengths of the shortest and the longest row, as given to the writer.
pub(super) const ROW_LENGTHS: &str = "row_lengths";
/// Metadata: rows of descriptors that share a digest.
pub(super) const ROWS_PER_BLOCK: &str = "rows_per_block";
/// Metadata: digest of the table of digests.
pub(super) const DIGESTS_DIGEST: &str = "block_digests_digest";
/// Metadata: digest of the header with these digits as zeros.
pub(super) const HEADER_DIGEST: &str = "header_digest";
/// What stands for the header's digest while it is computed.
pub(super) const NO_DIGEST: &str = "00000000000000000000000000000000";

/// Bytes that share a digest, about.
const BLOCK_BYTES: usize = 1 << 20;

/// Data start at a multiple of this, so that rows can be mapped and read page by page.
pub(super) const ALIGNMENT: usize = 4096;

/// How many rows of this many bytes share a digest.
pub(super) fn rows_per_block(row_bytes: usize) -> usize {
    (BLOCK_BYTES / row_bytes.max(1)).max(1)
}

/// The descriptors of a file: how many, of which type, where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Rows {
    pub(super) len: usize,
    pub(super) dim: usize,
    pub(super) row_type: RowType,
    /// Position in the file of the first row.
    pub(super) start: u64,
    pub(super) per_block: usize,
}

impl Rows {
    /// Bytes of one row.
    pub(super) fn row_bytes(&self) -> usize {
        self.dim * self.row_type.size()
    }

    /// Number of blocks with a digest.
    pub(super) fn n_blocks(&self) -> usize {
        self.len.div_ceil(self.per_block)
    }

    /// The rows of one block.
    pub(super) fn block(&self, block: usize) -> Range<usize> {
        let start = block * self.per_block;
        start..(start + self.per_block).min(self.len)
    }

    /// The blocks that these rows lie in.
    pub(super) fn blocks_of(&self, rows: &Range<usize>) -> Range<usize> {
        rows.start / self.per_block..rows.end.div_ceil(self.per_block)
    }

    /// Position in the file of the bytes of these rows.
    pub(super) fn bytes_of(&self, rows: &Range<usize>) -> Range<u64> {
        let at = |row: usize| self.start + row as u64 * self.row_bytes() as u64;
        at(rows.start)..at(rows.end)
    }

    /// Takes the layout of the descriptors from a header that has been checked for consistency.
    pub(super) fn of(path: &Path, header: &Header) -> Result<Self> {
        let wrong = |reason: &str| Error::format(path, "tensor `descriptors`", reason);
        let entry = header.tensor(path, DESCRIPTORS)?;
        let row_type = RowType::of_element(entry.dtype)
            .ok_or_else(|| wrong("stored as neither f32, f16 nor int8"))?;
        let [len, dim] = entry.shape[..] else { return Err(wrong("is no matrix")) };
        let (Ok(len), Ok(dim)) = (usize::try_from(len), usize::try_from(dim)) else {
            return Err(wrong("is larger than memory can address"));
        };
        if dim == 0 {
            return Err(wrong("has rows of length zero"));
        }
        let per_block = header.metadata.get(ROWS_PER_BLOCK).and_then(|text| text.parse().ok());
        let per_block = per_block.filter(|&rows| rows > 0).ok_or_else(|| {
            Error::format(path, "metadata `rows_per_block`", "is no positive number")
        })?;
        let start = header.data_start + entry.data_offsets[0];
        if !start.is_multiple_of(64) {
            return Err(wrong("does not start at a multiple of 64 bytes"));
        }
        Ok(Self { len, dim, row_type, start, per_block })
    }
}

/// One block of bytes that has a digest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Block {
    /// The tensor it belongs to.
    pub(super) tensor: &'static str,
    /// Its bytes in the file.
    pub(super) bytes: Range<u64>,
}

/// The blocks of every tensor but the descriptors, in the order of the digest table.
pub(super) fn other_blocks(header: &Header) -> Vec<Block> {
    let mut blocks = Vec::new();
    for tensor in ORDER.into_iter().filter(|&name| name != DESCRIPTORS && name != DIGESTS) {
        let Some(entry) = header.tensors.get(tensor) else { continue };
        let [from, to] = entry.data_offsets.map(|offset| header.data_start + offset);
        for start in (from..to).step_by(BLOCK_BYTES) {
            blocks.push(Block { tensor, bytes: start..(start + BLOCK_BYTES as u64).min(to) });
        }
    }
    blocks
}

/// The digest of every block of a tensor's bytes.
pub(super) fn block_digests(bytes: &[u8]) -> impl Iterator<Item = BlockDigest> {
    bytes.chunks(BLOCK_BYTES).map(BlockDigest::of)
}

/// The digest of a header's JSON, its own digest replaced by zeros.
pub(super) fn header_digest(json: &[u8], stored: &str) -> BlockDigest {
    let mut json = json.to_vec();
    let needle = format!("\"{HEADER_DIGEST}\":\"{stored}\"");
    let at = json.windows(needle.len()).position(|window| window == needle.as_bytes());
    if let Some(at) = at {
        let end = at + needle.len() - 1;
        json[end - stored.len()..end].fill(b'0');
    }
    BlockDigest::of(&json)
}

/// A tensor of a map and the shape and type it must have for `n` rows.
pub(super) fn check_shape(path: &Path, name: &str, entry: &TensorEntry, n: u64) -> Result<()> {
    let expected: (ElementType, &[&[u64]]) = match name {
        SCALES => (ElementType::F32, &[&[n]]),
        POSITIONS => (ElementType::F64, &[&[n, 2], &[n, 3]]),
        ORIENTATIONS => (ElementType::F64, &[&[n, 4]]),
        NAME_OFFSETS | ANCHOR_OFFSETS => (ElementType::I64, &[&[n + 1]]),
        ANCHORS => (ElementType::I64, &[&[entry.n_bytes() / 8]]),
        NAMES => (ElementType::U8, &[&[entry.n_bytes()]]),
        PADDING => (ElementType::U8, &[&[1], &[2], &[3], &[4], &[5], &[6], &[7]]),
        DIGESTS => (ElementType::U8, &[&[entry.n_bytes() / 16, 16]]),
        _ => return Ok(()),
    };
    if entry.dtype == expected.0 && expected.1.contains(&entry.shape.as_slice()) {
        return Ok(());
    }
    let reason = format!(
        "is {:?} of shape {:?}, a map of {n} rows has {:?} of shape {:?}",
        entry.dtype, entry.shape, expected.0, expected.1[0]
    );
    Err(Error::format(path, format!("tensor `{name}`"), reason))
}
