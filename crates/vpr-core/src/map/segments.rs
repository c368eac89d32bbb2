//! A map that grows: a folder of map files under one small manifest.

use std::{
    fs::{self, File},
    path::{Path, PathBuf},
};

use ndarray::ArrayView2;
use serde::{Deserialize, Serialize};

use super::{About, BlockDigest, MapFile, MapWriter, Names, Opening, RowType, layout, lock};
use crate::{Error, Poses, Result};
use vpr_files::replace;

/// The file that says which segments a folder's map consists of.
pub(super) const MANIFEST: &str = "manifest.json";
const LOCK: &str = "lock";
const FORMAT: &str = "vpr-map-segments 1";
/// A manifest is never longer than this: room for about half a million segments.
const LONGEST_MANIFEST: u64 = 64 << 20;

/// Which files a growing map consists of; replaced as a whole with every segment that is added.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Manifest {
    format: String,
    /// XXH3 of the manifest with this field empty.
    digest: String,
    pub(super) segments: Vec<Segment>,
}

/// One file of a growing map.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Segment {
    pub(super) file: String,
    pub(super) rows: usize,
    /// The header digest of the file, so that no other file can take its place.
    pub(super) header_digest: String,
}

impl Manifest {
    fn sealed(segments: Vec<Segment>) -> Self {
        let mut manifest = Self { format: FORMAT.to_owned(), digest: String::new(), segments };
        manifest.digest = manifest.actual_digest();
        manifest
    }

    fn actual_digest(&self) -> String {
        let unsealed = Self { digest: String::new(), ..self.clone() };
        BlockDigest::of(&unsealed.to_json()).to_hex()
    }

    fn to_json(&self) -> Vec<u8> {
        serde_json::to_vec_pretty(self).expect("text and numbers become JSON")
    }

    /// Reads and checks the manifest of a folder.
    pub(super) fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(MANIFEST);
        let wrong = |reason: String| Error::format(&path, "manifest", reason);
        let length = fs::metadata(&path).map_err(Error::io(&path))?.len();
        if length > LONGEST_MANIFEST {
            return Err(wrong(format!("has {length} bytes, more than a manifest can have")));
        }
        let json = fs::read(&path).map_err(Error::io(&path))?;
        let manifest: Self = serde_json::from_slice(&json).map_err(|err| wrong(err.to_string()))?;
        if manifest.format != FORMAT {
            let format = vpr_files::shorten(&manifest.format);
            return Err(wrong(format!("format is `{format}`, this program reads `{FORMAT}`")));
        }
        if manifest.actual_digest() != manifest.digest {
            return Err(wrong(super::touch::damaged().to_owned()));
        }
        match manifest.segments.iter().find(|segment| !is_segment_name(&segment.file)) {
            None => Ok(manifest),
            Some(segment) => {
                let file = vpr_files::shorten(&segment.file);
                Err(wrong(format!("`{file}` is not the name of a segment")))
            }
        }
    }
}

impl Segment {
    /// Opens the file and checks that it is the one the manifest means.
    pub(super) fn open(&self, folder: &Path, opening: Opening) -> Result<MapFile> {
        let path = folder.join(&self.file);
        let file = MapFile::open_with(&path, opening)?;
        let digest = file.header().metadata.get(layout::HEADER_DIGEST);
        if file.len() == self.rows && digest == Some(&self.header_digest) {
            Ok(file)
        } else {
            Err(Error::format(path, "header", "is not the file that the manifest means"))
        }
    }
}

/// A growing map, open for appending; only one process can have it.
///
/// Every [`Self::append`] writes one more file and then replaces the manifest. Readers that have
/// the map open keep what they saw; whoever opens it sees all of an append or nothing.
#[derive(Debug)]
pub struct GrowingMap {
    folder: PathBuf,
    manifest: Manifest,
    row_type: RowType,
    about: About,
    kind: Option<Kind>,
    _lock: File,
}

/// What all segments of a map have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Kind {
    dim: usize,
    poses: Option<&'static str>,
    names: bool,
}

impl GrowingMap {
    /// Opens the map in `folder` for appending, or starts one if the folder has none.
    ///
    /// Row type and description are those of the new segments; a map that exists must agree.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the folder cannot be written or another process is appending to it, and which,
    /// [`Error::Format`] if what is there is damaged, [`Error::Parameter`] if it has another row
    /// type, encoder, metric or coordinate system.
    pub fn open(folder: &Path, row_type: RowType, about: About) -> Result<Self> {
        fs::create_dir_all(folder).map_err(Error::io(folder))?;
        let lock = lock::take(&folder.join(LOCK))?;
        let folder = folder.to_owned();
        if !folder.join(MANIFEST).exists() {
            let manifest = Manifest::sealed(Vec::new());
            replace(&folder.join(MANIFEST), &manifest.to_json())?;
            return Ok(Self { folder, manifest, row_type, about, kind: None, _lock: lock });
        }
        let manifest = Manifest::read(&folder)?;
        let mut kind = None;
        if let Some(first) = manifest.segments.first() {
            let first = first.open(&folder, Opening::default())?;
            agree("row_type", first.row_type(), row_type)?;
            let changed = about.changes_since(first.about());
            if !changed.is_empty() {
                let (name, value) = ("settings", changed.join("; "));
                let reason = "all segments of a map must agree";
                return Err(Error::Parameter { name, value, reason });
            }
            kind = Some(Kind::of_file(&first));
        }
        Ok(Self { folder, manifest, row_type, about, kind, _lock: lock })
    }

    /// Number of segments.
    #[must_use]
    pub fn n_segments(&self) -> usize {
        self.manifest.segments.len()
    }

    /// Number of references in all segments.
    #[must_use]
    pub fn len(&self) -> usize {
        self.manifest.segments.iter().map(|segment| segment.rows).sum()
    }

    /// Whether there is no reference.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds images as one segment: their descriptors, `n × dim`, and poses and names where known.
    ///
    /// # Errors
    ///
    /// Those of [`MapWriter::append`], [`Error::Mismatch`] or [`Error::PoseKind`] if the segments
    /// before have another dimension, kind of pose, or names where these have none.
    pub fn append(
        &mut self,
        descriptors: ArrayView2<'_, f32>,
        poses: Option<&Poses>,
        names: Option<&Names>,
    ) -> Result<()> {
        let dim = descriptors.ncols();
        let kind = Kind { dim, poses: poses.map(Poses::kind), names: names.is_some() };
        kind.check(self.kind)?;
        let file = segment_name(self.n_segments() + 1);
        let path = self.folder.join(&file);
        let mut writer = MapWriter::create(&path, dim, self.row_type, self.about.clone())?;
        writer.append(descriptors, poses, names)?;
        let header_digest = writer.finish()?;
        let mut segments = self.manifest.segments.clone();
        segments.push(Segment { file, rows: descriptors.nrows(), header_digest });
        let manifest = Manifest::sealed(segments);
        replace(&self.folder.join(MANIFEST), &manifest.to_json())?;
        self.manifest = manifest;
        self.kind = Some(kind);
        Ok(())
    }
}

impl Kind {
    fn of_file(file: &MapFile) -> Self {
        let has = |name: &str| file.header().tensors.contains_key(name);
        Self { dim: file.dim(), poses: file.pose_kind(), names: has(layout::NAMES) }
    }

    fn check(self, before: Option<Self>) -> Result<()> {
        let Some(before) = before else { return Ok(()) };
        if self.dim != before.dim {
            let what = "dimension of the descriptors";
            return Err(Error::Mismatch { what, expected: before.dim, actual: self.dim });
        }
        if self.poses != before.poses {
            let [needed, actual] = [self.poses, before.poses].map(|kind| kind.unwrap_or("no"));
            return Err(Error::PoseKind { needed, actual });
        }
        agree("names", before.names, self.names)
    }
}

/// The map has `there`, this segment would have `here`.
fn agree<T: PartialEq + ToString>(name: &'static str, there: T, here: T) -> Result<()> {
    if there == here {
        return Ok(());
    }
    let value = format!("{} here, {} in the map", here.to_string(), there.to_string());
    Err(Error::Parameter { name, value, reason: "all segments of a map must agree" })
}

fn segment_name(number: usize) -> String {
    format!("segment-{number:06}.safetensors")
}

fn is_segment_name(file: &str) -> bool {
    let number = file.strip_prefix("segment-").and_then(|file| file.strip_suffix(".safetensors"));
    number.is_some_and(|digits| digits.len() >= 6 && digits.bytes().all(|b| b.is_ascii_digit()))
}
