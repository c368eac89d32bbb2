//! `manifest.toml`: which datasets there are, where they lie and what the thesis says of them.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    num::NonZeroUsize,
    path::{Component, Path, PathBuf},
};

use serde::{Deserialize, Serialize};

use crate::layout::vpr_bench::GroundTruthFile;
use vpr_core::{Error, Provenance, Result};

/// All known datasets, in the order of the file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// The entries, each id once.
    #[serde(rename = "dataset")]
    pub datasets: Vec<DatasetEntry>,
}

/// What is known of a dataset before it is opened.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DatasetEntry {
    /// Short name, as typed: lower case, digits and hyphens.
    pub id: String,
    /// As the thesis writes it.
    pub name: String,
    /// How it is laid out on disk.
    pub layout: Layout,
    /// Where it is, relative to a data directory.
    pub path: PathBuf,
    /// Where the stored matches of techniques are, one folder each, if there are any.
    pub matches: Option<PathBuf>,
    /// Number of queries of the whole dataset.
    pub queries: Option<usize>,
    /// Number of references of the whole dataset.
    pub references: Option<usize>,
    /// How far a correct reference may be, as the thesis states it.
    pub tolerance: Tolerance,
    /// Metres between consecutive frames, where the layout has no positions but this is known.
    pub spacing_m: Option<f64>,
    /// First frame used and the one after the last, of an archive of which not all is used.
    pub frames: Option<(usize, usize)>,
    /// Of the frames used, only every one of this many, from the first.
    pub every: Option<NonZeroUsize>,
    /// Citation or address.
    pub origin: String,
    /// Licence of the data.
    pub licence: String,
    /// What a user should know besides.
    pub note: Option<String>,
    /// Where numbers from its images come from: real ones are `measured`, drawn ones `generated`.
    #[serde(default = "measured")]
    pub provenance: Provenance,
}

fn measured() -> Provenance {
    Provenance::Measured
}

/// How a dataset is laid out on disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Layout {
    /// `query/`, `ref/` and `ground_truth_new.npy`.
    VprBench,
    /// `query/` and `ref/`, aligned by index, without a ground truth file.
    ImagePairs,
    /// `queries/` and `database/` with positions in the names.
    UtmNames,
    /// Two traverses as arrays of images in one archive, aligned by index.
    Npz,
    /// Sequences of frames with a pose each, or lists of such poses.
    SevenScenes,
    /// Dictionaries of scores, no images.
    InvarianceScores,
}

/// How far a correct reference may be from the query.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Tolerance {
    /// At most this many frames.
    Frames(usize),
    /// At most this many metres, the limit included.
    Metres(f64),
    /// No single number: the files say.
    PerFile,
}

/// The directories in which datasets are looked for, the first that has one wins.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DataRoots {
    /// The directories.
    pub roots: Vec<PathBuf>,
}

impl Manifest {
    /// The manifest this crate was built with.
    ///
    /// # Panics
    ///
    /// If that file is malformed, which a test of this crate rules out.
    #[must_use]
    pub fn builtin() -> Self {
        let text = include_str!("../manifest.toml");
        match Self::parse(text, Path::new("manifest.toml")) {
            Ok(manifest) => manifest,
            Err(err) => panic!("{err}"),
        }
    }

    /// Reads a manifest file.
    ///
    /// # Errors
    ///
    /// [`Error::Io`]; [`Error::Format`] with the line for malformed TOML, an unknown or missing
    /// key, or with the dataset for an id that is repeated or a path that leaves the directory.
    pub fn read(path: &Path) -> Result<Self> {
        let text = fs::read_to_string(path).map_err(Error::io(path))?;
        Self::parse(&text, path)
    }

    /// The entry called `id`.
    ///
    /// # Errors
    ///
    /// [`Error::Unknown`] with all ids.
    pub fn find(&self, id: &str) -> Result<&DatasetEntry> {
        self.datasets.iter().find(|entry| entry.id == id).ok_or_else(|| {
            let known = self.datasets.iter().map(|entry| entry.id.as_str()).collect::<Vec<_>>();
            Error::Unknown { kind: "dataset", name: id.to_owned(), known: known.join(", ") }
        })
    }

    fn parse(text: &str, path: &Path) -> Result<Self> {
        let manifest: Self = toml::from_str(text).map_err(|cause| {
            let before = cause.span().map_or(0, |span| span.start);
            let line = text[..before.min(text.len())].matches('\n').count() + 1;
            Error::format(path, format!("line {line}"), cause.message())
        })?;
        let mut ids = BTreeSet::new();
        for entry in &manifest.datasets {
            let err = |reason: &str| Error::format(path, format!("dataset `{}`", entry.id), reason);
            let is_plain =
                |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'-';
            if entry.id.is_empty() || !entry.id.bytes().all(is_plain) {
                return Err(err("an id is made of lower case letters, digits and hyphens"));
            }
            if !ids.insert(&entry.id) {
                return Err(err("appears twice"));
            }
            for path in std::iter::once(&entry.path).chain(&entry.matches) {
                if !path.components().all(|part| matches!(part, Component::Normal(_))) {
                    return Err(err("paths are relative and stay inside of the data directory"));
                }
            }
        }
        Ok(manifest)
    }
}

impl DatasetEntry {
    /// The ground truth file of a VPR-Bench dataset; its images need not be there.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if no root has it, and those of [`GroundTruthFile::read`].
    pub fn ground_truth(&self, roots: &DataRoots) -> Result<GroundTruthFile> {
        GroundTruthFile::read(&roots.find(&self.path.join("ground_truth_new.npy"))?)
    }

    /// The files of stored matches, by technique; empty if none are published.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the folder that the manifest names is not there.
    pub fn published_matches(&self, roots: &DataRoots) -> Result<BTreeMap<String, PathBuf>> {
        let Some(matches) = &self.matches else { return Ok(BTreeMap::new()) };
        let folder = roots.find(matches)?;
        let mut files = BTreeMap::new();
        for technique in fs::read_dir(&folder).map_err(Error::io(&folder))? {
            let technique = technique.map_err(Error::io(&folder))?.path();
            let file = technique.join("precomputed_data_corrected.npy");
            if let (true, Some(name)) = (file.is_file(), technique.file_name()) {
                files.insert(name.to_string_lossy().into_owned(), file);
            }
        }
        Ok(files)
    }
}

impl DataRoots {
    /// The given directories, in the order in which they are searched.
    #[must_use]
    pub fn new(roots: impl IntoIterator<Item = PathBuf>) -> Self {
        Self { roots: roots.into_iter().collect() }
    }

    /// The file or folder at `relative` in the first root that has it; `None` if none has.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if a root does not let itself be searched.
    pub fn locate(&self, relative: &Path) -> Result<Option<PathBuf>> {
        for root in &self.roots {
            let path = root.join(relative);
            if path.try_exists().map_err(Error::io(&path))? {
                return Ok(Some(path));
            }
        }
        Ok(None)
    }

    /// The file or folder at `relative` in the first root that has it.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] with the path in the first root if none has it.
    pub fn find(&self, relative: &Path) -> Result<PathBuf> {
        self.locate(relative)?.ok_or_else(|| {
            let first = self.roots.first().map_or(relative.to_owned(), |root| root.join(relative));
            let roots: Vec<_> = self.roots.iter().map(|root| root.display().to_string()).collect();
            let reason = format!("not found in {}", roots.join(", nor in "));
            Error::Io {
                path: first,
                source: std::io::Error::new(std::io::ErrorKind::NotFound, reason),
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ENTRY: &str = "[[dataset]]\nid = \"a\"\nname = \"A\"\nlayout = \"vpr-bench\"\n\
        path = \"a\"\ntolerance = { frames = 2 }\norigin = \"\"\nlicence = \"unknown\"\n";

    fn reason(text: &str) -> String {
        Manifest::parse(text, Path::new("manifest.toml")).unwrap_err().to_string()
    }

    #[test]
    fn the_builtin_manifest_has_the_twelve_datasets_of_table_3_1_first() {
        let manifest = Manifest::builtin();
        let counts = |entry: &DatasetEntry| (entry.queries.unwrap(), entry.references.unwrap());
        let twelve: Vec<_> = manifest.datasets[..12]
            .iter()
            .map(|entry| (entry.name.as_str(), counts(entry)))
            .collect();
        assert_eq!(twelve[0], ("GardensPoint", (200, 200)));
        assert_eq!(twelve[11], ("INRIA Holidays", (300, 512)));
        assert_eq!(twelve.iter().map(|(_, counts)| counts.0).sum::<usize>(), 6945);
        assert_eq!(manifest.find("corridor").unwrap().tolerance, Tolerance::Frames(2));
    }

    #[test]
    fn unknown_keys_are_refused_with_their_line() {
        let err = reason(&format!("{ENTRY}color = 1\n"));
        assert!(err.starts_with("manifest.toml: line 9: unknown field `color`"), "{err}");
        let err = reason(&ENTRY.replace("frames = 2", "miles = 2"));
        assert!(err.starts_with("manifest.toml: line 6: unknown variant `miles`"), "{err}");
    }

    #[test]
    fn ids_are_unique_and_paths_stay_inside() {
        assert!(reason(&format!("{ENTRY}\n{ENTRY}")).ends_with("dataset `a`: appears twice"));
        for path in ["../a", "/a"] {
            let text = ENTRY.replace("path = \"a\"", &format!("path = \"{path}\""));
            assert!(reason(&text).contains("stay inside"), "{path}");
        }
    }

    #[test]
    fn unknown_datasets_list_the_known() {
        let err = Manifest::builtin().find("coridor").unwrap_err().to_string();
        assert!(err.starts_with("unknown dataset `coridor`; known: gardens-point,"), "{err}");
    }

    #[test]
    fn the_first_root_that_has_a_dataset_wins() {
        let (first, second) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        fs::create_dir(second.path().join("a")).unwrap();
        let roots = DataRoots::new([first.path().to_owned(), second.path().to_owned()]);
        assert_eq!(roots.find(Path::new("a")).unwrap(), second.path().join("a"));
        fs::create_dir(first.path().join("a")).unwrap();
        assert_eq!(roots.find(Path::new("a")).unwrap(), first.path().join("a"));
        assert!(roots.find(Path::new("b")).is_err());
    }
}
