//! A map file that is open: checked, mapped, its rows read as they are needed.

use std::{
    fs::File,
    ops::Range,
    path::{Path, PathBuf},
    sync::OnceLock,
};

use memmap2::Mmap;
use ndarray::Array2;

use super::{
    About, BlockDigest, Map, RowType, checks,
    header::Header,
    layout::{self, Rows},
    touch::{Touched, check_digest, check_finite},
};
use vpr_files::access;

use crate::{Descriptors, Error, Result};

mod row_source;

/// How the descriptors of an open map are reached.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Access {
    /// Through a memory map: rows of f32 are used in place, without a copy. Pages that were looked
    /// at count as memory of the process until the system needs them for something else.
    #[default]
    Mapped,
    /// Through reads into a buffer: memory stays at the size of the buffers, at one copy per scan.
    Read,
}

/// How to open a map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Opening {
    /// How descriptors are reached.
    pub access: Access,
    /// Skips the check of digests and finiteness when a block is first touched.
    pub trust: bool,
}

/// What happens to a problem that is found while opening a map.
pub(super) enum Strictness<'a> {
    /// Opening stops, and this is why.
    StopAt(&'a mut Option<Error>),
    /// It is noted, and opening goes on if that makes sense.
    Report(&'a mut Vec<Error>),
}

impl Strictness<'_> {
    /// The value that opening cannot do without.
    fn need<T>(&mut self, result: Result<T>) -> Option<T> {
        let err = match result {
            Ok(value) => return Some(value),
            Err(err) => err,
        };
        match self {
            Self::StopAt(first) => **first = Some(err),
            Self::Report(problems) => problems.push(err),
        }
        None
    }

    /// Whether opening may go on after a check.
    fn may_pass(&mut self, check: Result<()>) -> Option<()> {
        match (self.need(check), self) {
            (None, Self::StopAt(_)) => None,
            _ => Some(()),
        }
    }
}

/// One map file, open for reading.
///
/// Opening reads the header and the table of digests, nothing else. The digest and the finiteness
/// of descriptors are checked when a block of them (1 MiB) is first touched, unless trusted; those
/// of poses and names when they are read. The file may be replaced meanwhile: an open map stays
/// what it was.
#[derive(Debug)]
pub struct MapFile {
    path: PathBuf,
    file: File,
    map: Option<Mmap>,
    header: Header,
    about: About,
    rows: Rows,
    digests: Vec<u8>,
    touched: Touched,
    scales: OnceLock<Vec<f32>>,
}

impl MapFile {
    /// Opens a map: memory-mapped, and checked where it is touched.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the file cannot be read, [`Error::Format`] if it is no map or damaged.
    pub fn open(path: &Path) -> Result<Self> {
        Self::open_with(path, Opening::default())
    }

    /// Opens a map in a given way.
    ///
    /// # Errors
    ///
    /// Those of [`Self::open`].
    pub fn open_with(path: &Path, opening: Opening) -> Result<Self> {
        let mut first = None;
        Self::open_as(path, opening, &mut Strictness::StopAt(&mut first)).ok_or_else(|| {
            first.unwrap_or_else(|| Error::format(path, "file", "could not be opened"))
        })
    }

    /// Opens a map; `None` if that stopped at a problem, or if no reading is possible.
    pub(super) fn open_as(
        path: &Path,
        opening: Opening,
        strictness: &mut Strictness<'_>,
    ) -> Option<Self> {
        let file = strictness.need(File::open(path).map_err(Error::io(path)))?;
        let (header, json) = strictness.need(Header::read(path, &file))?;
        strictness.need(checks::check_format(path, &header))?;
        strictness.may_pass(checks::check_header(path, &header, &json))?;
        let rows = strictness.need(Rows::of(path, &header))?;
        for (name, entry) in &header.tensors {
            strictness.need(checks::check_tensor(path, &header, &rows, name, entry))?;
        }
        strictness.need(checks::check_companions(path, &header, &rows))?;
        let about = About::read_from(&header.metadata)
            .map_err(|(place, reason)| Error::format(path, place, reason));
        let (about, understood) = match about {
            Ok(about) => (about, Ok(())),
            Err(err) => (About::default(), Err(err)),
        };
        strictness.may_pass(understood)?;
        let digests = checks::read_tensor(path, &file, &header, layout::DIGESTS);
        let digests = strictness.need(digests)?;
        strictness.may_pass(checks::check_digests(path, &header, &digests))?;
        strictness.need(checks::check_n_digests(path, &header, &rows, &digests))?;
        let map = match opening.access {
            Access::Mapped => Some(strictness.need(access::map(&file).map_err(Error::io(path)))?),
            Access::Read => None,
        };
        let touched = if opening.trust { Touched::all() } else { Touched::none(rows.n_blocks()) };
        let path = path.to_owned();
        let scales = OnceLock::new();
        Some(Self { path, file, map, header, about, rows, digests, touched, scales })
    }

    /// The file, as it was named when it was opened.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What the map says about itself.
    #[must_use]
    pub fn about(&self) -> &About {
        &self.about
    }

    /// Number of references.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len
    }

    /// Whether there is no reference.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.len == 0
    }

    /// Length of one descriptor.
    #[must_use]
    pub fn dim(&self) -> usize {
        self.rows.dim
    }

    /// How descriptors are stored.
    #[must_use]
    pub fn row_type(&self) -> RowType {
        self.rows.row_type
    }

    /// Everything the file's header says, for people who want to see it.
    #[must_use]
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Copies the descriptors from row `start` on into `values`, a whole number of rows.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] if there are not so many rows, [`Error::Format`] if a block that is
    /// touched for the first time is damaged, [`Error::NotFinite`] if it holds a NaN.
    ///
    /// # Panics
    ///
    /// If the length of `values` is no multiple of [`Self::dim`].
    pub fn read_rows(&self, start: usize, values: &mut [f32]) -> Result<()> {
        let dim = self.rows.dim;
        assert!(values.len().is_multiple_of(dim), "whole rows are read");
        let rows = self.check_range(start..start + values.len() / dim)?;
        let scales = self.scales()?;
        let scale = |row: usize| scales.get(row).copied().unwrap_or(1.0);
        let row_bytes = self.rows.row_bytes();
        let decode = |bytes: &[u8], values: &mut [f32]| {
            let stored = bytes.chunks_exact(row_bytes).zip(values.chunks_exact_mut(dim));
            for (row, (bytes, values)) in rows.clone().zip(stored) {
                self.rows.row_type.decode(bytes, scale(row), values);
            }
        };
        let range = self.rows.bytes_of(&rows);
        if let Some(bytes) = self.mapped(&range) {
            self.touch(&rows)?;
            decode(bytes, values);
        } else if self.rows.row_type == RowType::F32 && cfg!(target_endian = "little") {
            let bytes = bytemuck::cast_slice_mut(values);
            self.read_at(bytes, range.start)?;
            self.touch_read(&rows, bytes)?;
        } else {
            let bytes = self.read_bytes(&range)?;
            self.touch_read(&rows, &bytes)?;
            decode(&bytes, values);
        }
        Ok(())
    }

    /// The descriptors of these rows in place, if they are memory-mapped and stored as f32.
    ///
    /// # Errors
    ///
    /// Those of [`Self::read_rows`].
    pub fn rows_in_place(&self, rows: Range<usize>) -> Result<Option<&[f32]>> {
        let rows = self.check_range(rows)?;
        self.touch(&rows)?;
        if self.rows.row_type != RowType::F32 || cfg!(target_endian = "big") {
            return Ok(None);
        }
        let bytes = self.mapped(&self.rows.bytes_of(&rows));
        Ok(bytes.and_then(|bytes| bytemuck::try_cast_slice(bytes).ok()))
    }

    /// Shows the stored bytes of these rows, and the scales of int8 rows.
    pub(super) fn with_stored(
        &self,
        rows: Range<usize>,
        show: impl FnOnce(&[u8], &[f32]) -> Result<()>,
    ) -> Result<()> {
        let rows = self.check_range(rows)?;
        self.touch(&rows)?;
        let scales = self.scales()?.get(rows.clone()).unwrap_or_default();
        self.with_bytes(&rows, |bytes| show(bytes, scales))
    }

    /// All descriptors, in memory.
    ///
    /// # Errors
    ///
    /// Those of [`Self::read_rows`].
    pub fn descriptors(&self) -> Result<Descriptors> {
        let mut rows = Array2::zeros((self.rows.len, self.rows.dim));
        self.read_rows(0, rows.as_slice_mut().unwrap_or_default())?;
        Descriptors::new(rows)
    }

    /// The whole map in memory.
    ///
    /// # Errors
    ///
    /// [`Error::PoseKind`] if the map has no poses, and those of [`Self::descriptors`] and
    /// [`Self::poses`].
    pub fn to_map(&self) -> Result<Map> {
        let none = Error::PoseKind { needed: "any kind of", actual: "none" };
        Map::new(self.descriptors()?, self.poses()?.ok_or(none)?)
    }
}

impl MapFile {
    fn check_range(&self, rows: Range<usize>) -> Result<Range<usize>> {
        if rows.start <= rows.end && rows.end <= self.rows.len {
            Ok(rows)
        } else {
            Err(Error::OutOfRange { what: "row of a map", index: rows.end, len: self.rows.len })
        }
    }

    /// Checks the blocks these rows lie in, if that has not happened before.
    fn touch(&self, rows: &Range<usize>) -> Result<()> {
        self.touched.check(self.rows.blocks_of(rows), |block| self.check_block(block))
    }

    /// Like [`Self::touch`], with the bytes of these rows at hand: a block that lies in them as a
    /// whole is not read again.
    fn touch_read(&self, rows: &Range<usize>, bytes: &[u8]) -> Result<()> {
        let row_bytes = self.rows.row_bytes();
        self.touched.check(self.rows.blocks_of(rows), |block| {
            let range = self.rows.block(block);
            if range.start < rows.start || range.end > rows.end {
                return self.check_block(block);
            }
            let at = |row: usize| (row - rows.start) * row_bytes;
            self.check_bytes(block, &bytes[at(range.start)..at(range.end)])
        })
    }

    /// Checks digest and finiteness of one block of descriptors.
    fn check_block(&self, block: usize) -> Result<()> {
        self.with_bytes(&self.rows.block(block), |bytes| self.check_bytes(block, bytes))
    }

    fn check_bytes(&self, block: usize, bytes: &[u8]) -> Result<()> {
        let range = self.rows.block(block);
        check_digest(&self.path, &range, bytes, self.stored_digest(block))?;
        check_finite(&self.path, &self.rows, &range, bytes)
    }

    /// Checks the digest of one block of descriptors.
    pub(super) fn check_digest(&self, block: usize) -> Result<()> {
        let range = self.rows.block(block);
        let stored = self.stored_digest(block);
        self.with_bytes(&range, |bytes| check_digest(&self.path, &range, bytes, stored))
    }

    fn stored_digest(&self, block: usize) -> &[u8] {
        &self.digests[block * BlockDigest::LENGTH..][..BlockDigest::LENGTH]
    }

    /// Shows the bytes of these rows as they are stored.
    fn with_bytes(
        &self,
        rows: &Range<usize>,
        show: impl FnOnce(&[u8]) -> Result<()>,
    ) -> Result<()> {
        let bytes = self.rows.bytes_of(rows);
        match self.mapped(&bytes) {
            Some(bytes) => show(bytes),
            None => show(&self.read_bytes(&bytes)?),
        }
    }

    /// Checks the scales of an int8 map.
    pub(super) fn check_scales(&self) -> Result<()> {
        self.scales().map(drop)
    }

    /// The descriptors, how many and where.
    pub(super) fn rows(&self) -> &Rows {
        &self.rows
    }

    pub(super) fn digests(&self) -> &[u8] {
        &self.digests
    }

    /// Reads a tensor other than the descriptors.
    pub(super) fn read_tensor_unchecked(&self, name: &str) -> Result<Vec<u8>> {
        checks::read_tensor(&self.path, &self.file, &self.header, name)
    }

    fn mapped(&self, bytes: &Range<u64>) -> Option<&[u8]> {
        let at = |position: u64| usize::try_from(position).ok();
        self.map.as_ref()?.get(at(bytes.start)?..at(bytes.end)?)
    }

    fn read_bytes(&self, bytes: &Range<u64>) -> Result<Vec<u8>> {
        let mut buffer = vec![0; usize::try_from(bytes.end - bytes.start).unwrap_or(usize::MAX)];
        self.read_at(&mut buffer, bytes.start)?;
        Ok(buffer)
    }

    fn read_at(&self, buffer: &mut [u8], start: u64) -> Result<()> {
        access::read_exact_at(&self.file, buffer, start).map_err(Error::io(&self.path))
    }

    /// The factor of every row of an int8 map; empty for other types.
    fn scales(&self) -> Result<&[f32]> {
        if let Some(scales) = self.scales.get() {
            return Ok(scales);
        }
        let mut scales = Vec::new();
        if self.rows.row_type == RowType::I8 {
            let bytes = self.read_tensor(layout::SCALES)?;
            scales = bytes.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
        }
        if let Some(row) = scales.iter().position(|scale| !scale.is_finite() || *scale < 0.0) {
            let reason = format!("is {}, not a finite positive number", scales[row]);
            return Err(Error::format(&self.path, format!("scales, row {row}"), reason));
        }
        Ok(self.scales.get_or_init(|| scales))
    }
}

#[cfg(test)]
#[path = "file_tests.rs"]
mod tests;
