//! Writing a map file row by row, so that a map may be larger than memory.

use std::{
    io::{BufWriter, Write as _},
    path::{Path, PathBuf},
};

use ndarray::ArrayView2;

use super::{
    About, BlockDigest, Map, Names, Origins, RowType,
    header::{ElementType, Header, TensorEntry},
    layout::{self, Rows},
};
use vpr_files::NewFile;

use crate::{Error, Pose, Poses, Result, knn::RowLengths};

/// Writes a map file: rows go to the disk as they come, the map appears under its name at the end.
///
/// In memory are one block of descriptors (1 MiB) and, until the end, what is small per image:
/// pose, name, scale. Descriptors without poses or without names are allowed; what the first rows
/// have, all rows must have.
#[derive(Debug)]
pub struct MapWriter {
    path: PathBuf,
    file: NewFile,
    rows: Rows,
    about: About,
    block: Vec<u8>,
    digests: Vec<u8>,
    scales: Vec<f32>,
    lengths: Option<RowLengths>,
    poses: Option<Poses>,
    names: Option<Names>,
    origins: Option<Origins>,
}

impl MapWriter {
    /// Starts a map of descriptors of length `dim` that will replace the file at `path`.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the folder cannot be written, [`Error::Empty`] if `dim` is zero.
    pub fn create(path: &Path, dim: usize, row_type: RowType, about: About) -> Result<Self> {
        if dim == 0 {
            return Err(Error::Empty("values in a descriptor"));
        }
        let mut file = NewFile::create(path)?;
        let start = reserved_bytes(&about);
        let per_block = layout::rows_per_block(dim * row_type.size());
        let rows = Rows { len: 0, dim, row_type, start, per_block };
        std::io::Seek::seek(file.file(), std::io::SeekFrom::Start(start))
            .map_err(file.io_error())?;
        Ok(Self {
            path: path.to_owned(),
            block: Vec::with_capacity(per_block * rows.row_bytes()),
            file,
            rows,
            about,
            digests: Vec::new(),
            scales: Vec::new(),
            lengths: None,
            poses: None,
            names: None,
            origins: None,
        })
    }

    /// Number of rows so far.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len
    }

    /// Whether there is no row yet.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.len == 0
    }

    /// Adds images: their descriptors, `n × dim`, and their poses and names where known.
    ///
    /// # Errors
    ///
    /// [`Error::NotFinite`] for a descriptor or pose that is not finite (once stored),
    /// [`Error::Mismatch`] if the numbers of rows, columns, poses or names disagree, or if earlier
    /// images had poses or names and these have not; [`Error::PoseKind`] if they had another kind
    /// of pose; [`Error::Io`] if the disk refuses.
    pub fn append(
        &mut self,
        descriptors: ArrayView2<'_, f32>,
        poses: Option<&Poses>,
        names: Option<&Names>,
    ) -> Result<()> {
        let (what, expected) = ("dimension of the descriptors", self.rows.dim);
        if descriptors.ncols() != expected {
            return Err(Error::Mismatch { what, expected, actual: descriptors.ncols() });
        }
        self.begin(descriptors.nrows(), poses, names)?;
        self.push_rows(descriptors)
    }

    /// Adds rows of which some are regressed: as [`Self::append`], and where each row is from. Anchors
    /// are rows of the map that is being written, measured ones.
    ///
    /// # Errors
    ///
    /// Those of [`Self::append`]; [`Error::Mismatch`] if there is not an origin for every row, and
    /// [`Error::Format`] if an anchor is no measured row up to here.
    pub fn append_regressed(
        &mut self,
        descriptors: ArrayView2<'_, f32>,
        poses: Option<&Poses>,
        names: Option<&Names>,
        origins: &Origins,
    ) -> Result<()> {
        let before = self.rows.len;
        self.add_origins(Some(origins), descriptors.nrows(), 0)?;
        self.append(descriptors, poses, names).inspect_err(|_| {
            self.origins.iter_mut().for_each(|all| all.truncate(before));
        })
    }

    /// Takes where the next `n_rows` rows are from; their anchors are counted from row `shift`.
    /// Rows of which nothing is said are measured.
    pub(super) fn add_origins(
        &mut self,
        origins: Option<&Origins>,
        n_rows: usize,
        shift: usize,
    ) -> Result<()> {
        let Some(origins) = origins else { return Ok(()) };
        if origins.len() != n_rows {
            let (what, actual) = ("origins of rows, one per descriptor", origins.len());
            return Err(Error::Mismatch { what, expected: n_rows, actual });
        }
        let all = self.origins.get_or_insert_default();
        let said = all.len();
        (said..self.rows.len).for_each(|_| all.push_measured());
        all.extend(origins, shift);
        let checked = all.check_from(self.rows.len);
        checked.map_err(|(row, reason)| {
            all.truncate(self.rows.len);
            Error::format(&self.path, format!("row {row}"), reason)
        })
    }

    /// Adds rows whose poses and names have been given to [`Self::begin`].
    pub(super) fn push_rows(&mut self, descriptors: ArrayView2<'_, f32>) -> Result<()> {
        let mut contiguous = vec![0.0; self.rows.dim];
        for row in descriptors.outer_iter() {
            if let Some(row) = row.as_slice() {
                self.push_row(row)?;
            } else {
                contiguous.iter_mut().zip(row).for_each(|(to, &from)| *to = from);
                self.push_row(&contiguous)?;
            }
        }
        Ok(())
    }

    /// Takes poses and names of the `n_rows` images whose descriptors come next.
    pub(super) fn begin(
        &mut self,
        n_rows: usize,
        poses: Option<&Poses>,
        names: Option<&Names>,
    ) -> Result<()> {
        self.add_poses(poses, n_rows)?;
        self.add_names(names, n_rows)
    }

    /// Adds rows that are already stored as this writer stores them.
    pub(super) fn push_stored(&mut self, bytes: &[u8], scales: &[f32]) -> Result<()> {
        self.scales.extend(scales);
        let mut values = vec![0.0; self.rows.dim];
        for (index, row) in bytes.chunks_exact(self.rows.row_bytes()).enumerate() {
            let scale = scales.get(index).copied().unwrap_or(1.0);
            self.rows.row_type.decode(row, scale, &mut values);
            self.lengths = RowLengths::and(self.lengths, Some(RowLengths::of_row(&values)));
            self.block.extend(row);
            self.end_row()?;
        }
        Ok(())
    }

    fn push_row(&mut self, row: &[f32]) -> Result<()> {
        let scale = self.rows.row_type.encode(row, &mut self.block).map_err(|column| {
            let value = f64::from(row[column]);
            Error::NotFinite { what: "descriptors, as stored", row: self.rows.len, column, value }
        })?;
        if self.rows.row_type == RowType::I8 {
            self.scales.push(scale);
        }
        self.lengths = RowLengths::and(self.lengths, Some(RowLengths::of_row(row)));
        self.end_row()
    }

    fn end_row(&mut self) -> Result<()> {
        self.rows.len += 1;
        if self.rows.len.is_multiple_of(self.rows.per_block) {
            self.flush_block()?;
        }
        Ok(())
    }

    fn flush_block(&mut self) -> Result<()> {
        self.digests.extend(BlockDigest::of(&self.block).to_bytes());
        self.file.file().write_all(&self.block).map_err(self.file.io_error())?;
        self.block.clear();
        Ok(())
    }

    fn add_poses(&mut self, poses: Option<&Poses>, n_rows: usize) -> Result<()> {
        let n_poses = poses.map_or(0, Poses::len);
        let expected = if poses.is_some() || self.poses.is_some() { n_rows } else { 0 };
        let first_with_poses = self.poses.is_none() && n_poses > 0 && self.rows.len > 0;
        if n_poses != expected || first_with_poses {
            let what = "poses of a map, one per descriptor";
            return Err(Error::Mismatch {
                what,
                expected: self.rows.len + n_rows,
                actual: n_poses,
            });
        }
        let Some(poses) = poses else { return Ok(()) };
        poses.check_finite()?;
        match &mut self.poses {
            None => self.poses = Some(poses.clone()),
            Some(all) => all.extend(poses)?,
        }
        Ok(())
    }

    fn add_names(&mut self, names: Option<&Names>, n_rows: usize) -> Result<()> {
        let n_names = names.map_or(0, Names::len);
        let expected = if names.is_some() || self.names.is_some() { n_rows } else { 0 };
        let first_with_names = self.names.is_none() && n_names > 0 && self.rows.len > 0;
        if n_names != expected || first_with_names {
            let what = "image names, one per descriptor";
            return Err(Error::Mismatch {
                what,
                expected: self.rows.len + n_rows,
                actual: n_names,
            });
        }
        if let Some(names) = names {
            let all = self.names.get_or_insert_default();
            names.iter().for_each(|name| all.push(name));
        }
        Ok(())
    }

    /// Writes the rest and makes the map appear under its name; returns its header's digest.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the disk refuses; an older map is then still there.
    ///
    /// # Panics
    ///
    /// Never: the header has room for every number it may hold.
    pub fn finish(mut self) -> Result<String> {
        if !self.block.is_empty() {
            self.flush_block()?;
        }
        let (header, tail, digest) = self.header_and_tail();
        let path = self.path.clone();
        let io_error = || Error::io(&path);
        let mut out = BufWriter::new(self.file.file());
        tail.iter().try_for_each(|bytes| out.write_all(bytes)).map_err(io_error())?;
        std::io::Seek::rewind(&mut out).map_err(io_error())?;
        out.write_all(&header).map_err(io_error())?;
        out.flush().map_err(io_error())?;
        drop(out);
        self.file.commit()?;
        Ok(digest)
    }

    /// The finished header, the bytes of every tensor after the descriptors, the header's digest.
    fn header_and_tail(&mut self) -> (Vec<u8>, Vec<Vec<u8>>, String) {
        let mut header = Header { data_start: self.rows.start, ..Header::default() };
        let mut end = 0;
        let mut place =
            |header: &mut Header, name: &str, dtype, shape: Vec<usize>, bytes: usize| {
                let shape = shape.into_iter().map(|side| side as u64).collect();
                let data_offsets = [end, end + bytes as u64];
                end += bytes as u64;
                header.tensors.insert(name.to_owned(), TensorEntry { dtype, shape, data_offsets });
            };
        let rows = &self.rows;
        let n_bytes = rows.len * rows.row_bytes();
        let shape = vec![rows.len, rows.dim];
        place(&mut header, layout::DESCRIPTORS, rows.row_type.element(), shape, n_bytes);
        let mut tail = Vec::new();
        for (name, dtype, shape, bytes) in self.other_tensors(n_bytes) {
            place(&mut header, name, dtype, shape, bytes.len());
            self.digests.extend(layout::block_digests(&bytes).flat_map(BlockDigest::to_bytes));
            tail.push(bytes);
        }
        let n_digests = self.digests.len() / BlockDigest::LENGTH;
        let shape = vec![n_digests, BlockDigest::LENGTH];
        place(&mut header, layout::DIGESTS, ElementType::U8, shape, self.digests.len());
        let image_list = self
            .names
            .as_ref()
            .map(|names| super::image_list_digest(&names.iter().collect::<Vec<_>>()));
        let digests_digest = BlockDigest::of(&self.digests).to_hex();
        header.metadata = metadata(&self.about, self.rows.per_block, digests_digest, image_list);
        let lengths = self.lengths.map(|it| it.to_string());
        header.metadata.extend(lengths.map(|it| (layout::ROW_LENGTHS.to_owned(), it)));
        tail.push(std::mem::take(&mut self.digests));
        let unsigned = header.render(layout::ALIGNMENT);
        let digest = layout::header_digest(&unsigned[8..], layout::NO_DIGEST).to_hex();
        header.metadata.insert(layout::HEADER_DIGEST.to_owned(), digest.clone());
        (header.render(layout::ALIGNMENT), tail, digest)
    }

    /// Name, type, shape and bytes of every tensor between descriptors and digests.
    fn other_tensors(
        &self,
        n_bytes: usize,
    ) -> Vec<(&'static str, ElementType, Vec<usize>, Vec<u8>)> {
        let n = self.rows.len;
        let mut tensors = Vec::new();
        let padding = n_bytes.next_multiple_of(8) - n_bytes;
        if padding > 0 {
            tensors.push((layout::PADDING, ElementType::U8, vec![padding], vec![0; padding]));
        }
        if let Some(poses) = &self.poses {
            let width = if matches!(poses, Poses::Planar(_)) { 2 } else { 3 };
            let positions =
                (0..n).flat_map(|row| poses.position(row).coords.as_slice()[..width].to_vec());
            let bytes = positions.flat_map(f64::to_le_bytes).collect();
            tensors.push((layout::POSITIONS, ElementType::F64, vec![n, width], bytes));
        }
        if let Some(Poses::SixDof(poses)) = &self.poses {
            let bytes = poses.iter().flat_map(wxyz).flat_map(f64::to_le_bytes).collect();
            tensors.push((layout::ORIENTATIONS, ElementType::F64, vec![n, 4], bytes));
        }
        let names = self.names.as_ref().map(Names::to_parts);
        if let Some((_, offsets)) = &names {
            let bytes = offsets.iter().flat_map(|offset| offset.to_le_bytes()).collect();
            tensors.push((layout::NAME_OFFSETS, ElementType::I64, vec![n + 1], bytes));
        }
        if let Some(origins) = self.origins.as_ref().filter(|origins| origins.n_regressed() > 0) {
            let mut origins = origins.clone();
            (origins.len()..n).for_each(|_| origins.push_measured());
            let (anchors, offsets) = origins.to_parts();
            let bytes = |values: &[i64]| values.iter().flat_map(|it| it.to_le_bytes()).collect();
            let offsets = bytes(&offsets);
            tensors.push((layout::ANCHOR_OFFSETS, ElementType::I64, vec![n + 1], offsets));
            let shape = vec![anchors.len()];
            tensors.push((layout::ANCHORS, ElementType::I64, shape, bytes(&anchors)));
        }
        if self.rows.row_type == RowType::I8 {
            let bytes = self.scales.iter().flat_map(|scale| scale.to_le_bytes()).collect();
            tensors.push((layout::SCALES, ElementType::F32, vec![n], bytes));
        }
        if let Some((text, _)) = names {
            let bytes = text.as_bytes().to_vec();
            tensors.push((layout::NAMES, ElementType::U8, vec![bytes.len()], bytes));
        }
        tensors
    }
}

/// Writes a map that is in memory to one file.
///
/// # Errors
///
/// Those of [`MapWriter`].
pub fn write(path: &Path, map: &Map, names: Option<&Names>, about: About) -> Result<()> {
    let dim = map.descriptors().dim();
    let mut writer = MapWriter::create(path, dim, RowType::F32, about)?;
    writer.append(map.descriptors().view(), Some(map.poses()), names)?;
    writer.finish().map(drop)
}

fn wxyz(pose: &Pose) -> [f64; 4] {
    let quaternion = pose.rotation.quaternion();
    [quaternion.w, quaternion.i, quaternion.j, quaternion.k]
}

fn metadata(
    about: &About,
    per_block: usize,
    digests_digest: String,
    image_list: Option<String>,
) -> std::collections::BTreeMap<String, String> {
    let mut metadata = std::collections::BTreeMap::new();
    about.write_to(&mut metadata);
    let writer = concat!(env!("CARGO_PKG_NAME"), " ", env!("CARGO_PKG_VERSION")).to_owned();
    let entries = [
        (layout::FORMAT.0, layout::FORMAT.1.to_owned()),
        (layout::WRITER, writer),
        (layout::ROWS_PER_BLOCK, per_block.to_string()),
        (layout::DIGESTS_DIGEST, digests_digest),
        (layout::HEADER_DIGEST, layout::NO_DIGEST.to_owned()),
    ];
    metadata.extend(entries.map(|(key, value)| (key.to_owned(), value)));
    metadata.extend(image_list.map(|digest| (layout::IMAGE_LIST.to_owned(), digest)));
    metadata
}

/// No length takes more digits.
const LONGEST_NUMBER: f64 = 1.797_693_134_862_315_7e-300;

/// Room for the header of a map of any size: every tensor there may be, every number at its longest.
fn reserved_bytes(about: &About) -> u64 {
    let longest = TensorEntry {
        dtype: ElementType::F32,
        shape: vec![u64::MAX; 2],
        data_offsets: [u64::MAX; 2],
    };
    let tensors = layout::ORDER.map(|name| (name.to_owned(), longest.clone()));
    let digest = layout::NO_DIGEST.to_owned();
    let image_list = Some(super::image_list_digest::<&str>(&[]));
    let mut metadata = metadata(about, usize::MAX, digest, image_list);
    let lengths = RowLengths { shortest: LONGEST_NUMBER, longest: LONGEST_NUMBER };
    metadata.insert(layout::ROW_LENGTHS.to_owned(), lengths.to_string());
    let header = Header { tensors: tensors.into(), metadata, data_start: 0 };
    header.render(layout::ALIGNMENT).len() as u64
}
