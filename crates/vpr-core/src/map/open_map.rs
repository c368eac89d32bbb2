//! A map that is open, whether it is one file or a growing folder of them.

use std::{
    ops::Range,
    path::{Path, PathBuf},
};

use super::{About, Map, MapFile, Names, Opening, Origins, RowType, segments::Manifest};
use crate::{Descriptors, Error, Poses, Result, knn::RowSource};

/// A map on disk, open for reading: one file, or all segments of a folder as one sequence of rows.
///
/// What was open stays readable and as it was, whatever writers do.
#[derive(Debug)]
pub struct OpenMap {
    path: PathBuf,
    segments: Vec<MapFile>,
    /// First row of every segment, and the number of rows.
    starts: Vec<usize>,
    about: About,
}

impl OpenMap {
    /// Opens a map file, or a folder that holds a growing map.
    ///
    /// # Errors
    ///
    /// Those of [`MapFile::open_with`], [`Error::Format`] if a growing map has no segment yet.
    pub fn open(path: &Path, opening: Opening) -> Result<Self> {
        let segments = if path.is_dir() {
            let manifest = Manifest::read(path)?;
            let open = manifest.segments.iter().map(|segment| segment.open(path, opening));
            open.collect::<Result<Vec<_>>>()?
        } else {
            vec![MapFile::open_with(path, opening)?]
        };
        let none = || Error::format(path, "manifest", "the map has no segment yet");
        let about = segments.first().ok_or_else(none)?.about().clone();
        let mut starts = vec![0];
        for file in &segments {
            let (expected, actual) = (segments[0].dim(), file.dim());
            if expected != actual {
                let what = "dimension of the segments";
                return Err(Error::Mismatch { what, expected, actual }.in_file(path));
            }
            starts.push(starts[starts.len() - 1] + file.len());
        }
        Ok(Self { path: path.to_owned(), segments, starts, about })
    }

    /// The file or folder, as it was named when it was opened.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What the map says about itself.
    #[must_use]
    pub fn about(&self) -> &About {
        &self.about
    }

    /// Digest of everything in the map: another map has another one.
    #[must_use]
    pub fn digest(&self) -> String {
        let headers = self.segments.iter().filter_map(|file| {
            // The header has the digest of the table of digests, so it stands for all bytes.
            file.header().metadata.get(super::layout::HEADER_DIGEST).map(String::as_str)
        });
        super::BlockDigest::of(headers.collect::<Vec<_>>().join("\n").as_bytes()).to_hex()
    }

    /// The files it consists of.
    #[must_use]
    pub fn segments(&self) -> &[MapFile] {
        &self.segments
    }

    /// How descriptors are stored.
    #[must_use]
    pub fn row_type(&self) -> RowType {
        self.segments[0].row_type()
    }

    /// Number of references.
    #[must_use]
    pub fn len(&self) -> usize {
        self.starts[self.segments.len()]
    }

    /// Whether there is no reference.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Length of one descriptor.
    #[must_use]
    pub fn dim(&self) -> usize {
        self.segments[0].dim()
    }

    /// All descriptors, in memory.
    ///
    /// # Errors
    ///
    /// Those of [`MapFile::read_rows`].
    ///
    /// # Panics
    ///
    /// Never: there are as many values as rows and columns.
    pub fn descriptors(&self) -> Result<Descriptors> {
        let mut values = vec![0.0; self.len() * self.dim()];
        self.copy_rows(0..self.len(), &mut values)?;
        let rows = ndarray::Array2::from_shape_vec((self.len(), self.dim()), values);
        Descriptors::new(rows.expect("as many values as rows and columns"))
    }

    /// The poses of all references, if the map has any.
    ///
    /// # Errors
    ///
    /// Those of [`MapFile::poses`].
    pub fn poses(&self) -> Result<Option<Poses>> {
        let mut all: Option<Poses> = None;
        for file in &self.segments {
            match (&mut all, file.poses()?) {
                (None, poses) => all = poses,
                (Some(all), Some(more)) => all.extend(&more)?,
                (Some(all), None) => {
                    return Err(Error::PoseKind { needed: all.kind(), actual: "no" });
                }
            }
        }
        match all {
            Some(poses) if poses.len() != self.len() => {
                Err(Error::PoseKind { needed: poses.kind(), actual: "no" })
            }
            all => Ok(all),
        }
    }

    /// The names of all images, if the map has them.
    ///
    /// # Errors
    ///
    /// Those of [`MapFile::names`].
    pub fn names(&self) -> Result<Option<Names>> {
        let mut all = Names::default();
        for file in &self.segments {
            let Some(names) = file.names()? else { return Ok(None) };
            names.iter().for_each(|name| all.push(name));
        }
        Ok(Some(all))
    }

    /// Which rows were regressed and from which others; `None` if all were measured.
    ///
    /// # Errors
    ///
    /// Those of [`MapFile::origins`].
    pub fn origins(&self) -> Result<Option<Origins>> {
        let mut all = Origins::default();
        let mut any = false;
        for file in &self.segments {
            let origins = file.origins()?;
            any |= origins.is_some();
            let origins = origins.unwrap_or_else(|| Origins::measured(file.len()));
            all.extend(&origins, all.len());
        }
        Ok(any.then_some(all))
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

    /// The segment a row lies in, and its place there.
    fn segment_of(&self, row: usize) -> (usize, usize) {
        let segment = self.starts.partition_point(|&start| start <= row) - 1;
        (segment, row - self.starts[segment])
    }

    fn copy_rows(&self, rows: Range<usize>, values: &mut [f32]) -> Result<()> {
        if rows.end > self.len() {
            return Err(Error::OutOfRange {
                what: "row of a map",
                index: rows.end,
                len: self.len(),
            });
        }
        let (mut row, mut values) = (rows.start, values);
        while row < rows.end {
            let (segment, start) = self.segment_of(row);
            let n_rows = (self.segments[segment].len() - start).min(rows.end - row);
            let (here, rest) = values.split_at_mut(n_rows * self.dim());
            self.segments[segment].read_rows(start, here)?;
            (row, values) = (row + n_rows, rest);
        }
        Ok(())
    }
}

impl RowSource for OpenMap {
    fn len(&self) -> usize {
        self.len()
    }

    fn dim(&self) -> usize {
        self.dim()
    }

    /// Within one segment, where that wants it.
    fn piece_end(&self, start: usize, wanted: usize) -> usize {
        if start >= self.len() {
            return self.len();
        }
        let (segment, row) = self.segment_of(start);
        self.starts[segment] + self.segments[segment].piece_end(row, wanted)
    }

    fn block<'a>(&'a self, rows: Range<usize>, scratch: &'a mut Vec<f32>) -> Result<&'a [f32]> {
        if rows.is_empty() {
            return Ok(&[]);
        }
        let (segment, start) = self.segment_of(rows.start);
        let file = self.segments.get(segment);
        if let Some(file) = file.filter(|file| start + rows.len() <= file.len()) {
            return file.block(start..start + rows.len(), scratch);
        }
        scratch.resize(rows.len() * self.dim(), 0.0);
        self.copy_rows(rows, scratch)?;
        Ok(scratch)
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;
    use crate::{
        PlanarPosition,
        map::{GrowingMap, MapWriter, Origin, merge},
    };

    fn rows(n: usize, seed: usize) -> Array2<f32> {
        Array2::from_shape_fn((n, 3), |(row, column)| ((seed + row * 3 + column) as f32).sin())
    }

    fn poses(n: usize, seed: usize) -> Poses {
        let position = |row| PlanarPosition::new((seed + row) as f64, 1.0);
        Poses::Planar((0..n).map(position).collect())
    }

    fn grow(folder: &Path, row_type: RowType, n: usize, seed: usize) {
        let mut map = GrowingMap::open(folder, row_type, About::default()).unwrap();
        map.append(rows(n, seed).view(), Some(&poses(n, seed)), None).unwrap();
    }

    #[test]
    fn segments_read_as_one_sequence_of_rows() {
        let folder = tempfile::tempdir().unwrap();
        grow(folder.path(), RowType::F32, 4, 0);
        let before = OpenMap::open(folder.path(), Opening::default()).unwrap();
        grow(folder.path(), RowType::F32, 5, 100);
        let map = OpenMap::open(folder.path(), Opening::default()).unwrap();
        assert_eq!((before.len(), map.len()), (4, 9), "an open map keeps its view");
        assert_ne!(before.digest(), map.digest());
        let pieces = [0, 3, 4, 8].map(|start| map.piece_end(start, 1));
        assert_eq!(pieces, [4, 4, 9, 9], "unchecked blocks end with their segments");
        let all = ndarray::concatenate![ndarray::Axis(0), rows(4, 0), rows(5, 100)];
        let mut scratch = Vec::new();
        let across = map.block(2..7, &mut scratch).unwrap();
        assert_eq!(across, &all.as_slice().unwrap()[6..21]);
        assert_eq!(map.descriptors().unwrap().view(), all);
        assert_eq!(map.poses().unwrap().unwrap().position(4).x, 100.0);
    }

    #[test]
    fn merging_copies_stored_rows_bit_by_bit() {
        for row_type in [RowType::F32, RowType::F16, RowType::I8] {
            let folder = tempfile::tempdir().unwrap();
            let parts = folder.path().join("parts");
            grow(&parts, row_type, 4, 0);
            grow(&parts, row_type, 5, 100);
            let map = OpenMap::open(&parts, Opening::default()).unwrap();
            let path = folder.path().join("merged.safetensors");
            assert_eq!(merge(std::slice::from_ref(&map), &path).unwrap(), 9);
            let merged = OpenMap::open(&path, Opening::default()).unwrap();
            assert_eq!(merged.to_map().unwrap(), map.to_map().unwrap());
        }
    }

    #[test]
    fn regressed_rows_stay_regressed_through_merging_and_copying() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let mut writer = MapWriter::create(&path("a"), 3, RowType::F32, About::default()).unwrap();
        writer.append(rows(2, 0).view(), Some(&poses(2, 0)), None).unwrap();
        let mut origins = Origins::default();
        origins.push_regressed(&[1]).unwrap();
        origins.push_regressed(&[0, 1]).unwrap();
        writer.append_regressed(rows(2, 9).view(), Some(&poses(2, 9)), None, &origins).unwrap();
        // Rows of which nothing is said are measured.
        writer.append(rows(1, 5).view(), Some(&poses(1, 5)), None).unwrap();
        writer.finish().unwrap();
        let mut plain = MapWriter::create(&path("b"), 3, RowType::F32, About::default()).unwrap();
        plain.append(rows(2, 0).view(), Some(&poses(2, 0)), None).unwrap();
        plain.finish().unwrap();
        let open = |name: &str| OpenMap::open(&path(name), Opening::default()).unwrap();
        assert_eq!(open("b").origins().unwrap(), None);
        assert_eq!(open("a").origins().unwrap().unwrap().measured_rows(), [0, 1, 4]);
        merge(&[open("b"), open("a")], &path("c")).unwrap();
        crate::map::copy_as(&open("c"), RowType::I8, &path("d")).unwrap();
        for name in ["c", "d"] {
            let origins = open(name).origins().unwrap().unwrap();
            assert_eq!(origins.get(4), Some(Origin::Regressed(&[3])));
            assert_eq!(origins.get(5), Some(Origin::Regressed(&[2, 3])));
            assert_eq!(origins.measured_rows(), [0, 1, 2, 3, 6]);
            assert!(crate::map::verify(&path(name)).is_empty());
        }
    }

    #[test]
    fn an_anchor_that_is_no_measured_row_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map");
        let mut writer = MapWriter::create(&path, 3, RowType::F32, About::default()).unwrap();
        writer.append(rows(1, 0).view(), None, None).unwrap();
        for anchor in [1, 2] {
            let mut origins = Origins::default();
            origins.push_regressed(&[anchor]).unwrap();
            let err = writer.append_regressed(rows(1, 0).view(), None, None, &origins);
            assert!(err.unwrap_err().to_string().contains("row 1: is regressed from row"));
        }
    }

    #[test]
    fn only_one_process_appends_at_a_time() {
        let folder = tempfile::tempdir().unwrap();
        let open = || GrowingMap::open(folder.path(), RowType::F32, About::default());
        let first = open().unwrap();
        assert!(matches!(open(), Err(Error::Io { .. })));
        drop(first);
        open().unwrap();
    }

    #[test]
    fn a_segment_of_another_kind_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        grow(folder.path(), RowType::F32, 4, 0);
        let err = GrowingMap::open(folder.path(), RowType::F16, About::default()).unwrap_err();
        assert!(matches!(err, Error::Parameter { name: "row_type", .. }), "{err}");
        let mut map = GrowingMap::open(folder.path(), RowType::F32, About::default()).unwrap();
        let err = map.append(rows(1, 0).view(), None, None).unwrap_err();
        assert_eq!(err.to_string(), "needs no poses, the map has planar");
    }
}
