//! Datasets by name, generated and real ones alike.

use std::{
    fs,
    path::{Path, PathBuf},
};

use ndarray::{Array3, Axis};
use sha2::{Digest, Sha256};
use vpr_core::{Error, Observer, Result};

use crate::{
    DataRoots, Dataset, DatasetEntry, Layout, Manifest,
    layout::{npz_images::FramePairs, vpr_bench::GroundTruthFile},
};

/// Makes datasets that lie nowhere before they are asked for.
pub trait Generator: Sync + Send {
    /// Whether a dataset of this name is made here.
    fn makes(&self, id: &str) -> bool;

    /// What is known of it before it is made, as the manifest says it of others.
    ///
    /// # Errors
    ///
    /// If the name or one of its settings is unknown.
    fn entry(&self, id: &str) -> Result<DatasetEntry>;

    /// Opens it, making it in `cache` if it is not there; `roots` hold data that it may follow.
    ///
    /// # Errors
    ///
    /// As [`Self::entry`], and if `cache` cannot be written or what lies there is damaged.
    fn open(
        &self,
        id: &str,
        roots: &DataRoots,
        cache: &Path,
        observer: &dyn Observer,
    ) -> Result<Dataset>;
}

/// What of a dataset is there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AtHand {
    /// Its images.
    pub images: bool,
    /// What is correct, as a file or by order and positions of the images.
    pub truth: bool,
    /// Scores that its authors stored.
    pub scores: bool,
}

/// Makes nothing: all datasets are those of the manifest.
impl Generator for () {
    fn makes(&self, _: &str) -> bool {
        false
    }

    fn entry(&self, id: &str) -> Result<DatasetEntry> {
        Err(Error::Unknown { kind: "dataset", name: id.to_owned(), known: String::new() })
    }

    fn open(&self, id: &str, _: &DataRoots, _: &Path, _: &dyn Observer) -> Result<Dataset> {
        self.entry(id).and_then(|entry| Dataset::open(&entry, &DataRoots::default()))
    }
}

/// All datasets that have a name: those of the manifest, looked for in folders, and those that a
/// [`Generator`] makes.
pub struct Datasets {
    manifest: Manifest,
    roots: DataRoots,
    cache: PathBuf,
    generator: Box<dyn Generator>,
}

impl Datasets {
    /// The built-in manifest over `roots`; what is made or unpacked is kept in `cache`.
    #[must_use]
    pub fn new(roots: DataRoots, cache: &Path, generator: impl Generator + 'static) -> Self {
        let manifest = Manifest::builtin();
        Self { manifest, roots, cache: cache.to_owned(), generator: Box::new(generator) }
    }

    /// The datasets of the manifest.
    pub fn entries(&self) -> impl Iterator<Item = &DatasetEntry> {
        self.manifest.datasets.iter()
    }

    /// The folders that are searched.
    #[must_use]
    pub fn roots(&self) -> &DataRoots {
        &self.roots
    }

    /// The folder that keeps what is made.
    #[must_use]
    pub fn cache(&self) -> &Path {
        &self.cache
    }

    /// What is known of a dataset before it is opened.
    ///
    /// # Errors
    ///
    /// [`Error::Unknown`] with the names there are.
    pub fn entry(&self, id: &str) -> Result<DatasetEntry> {
        if self.generator.makes(id) {
            return self.generator.entry(id);
        }
        self.manifest.find(id).cloned()
    }

    /// The published ground truth of a dataset; `None` if the folders have none.
    ///
    /// # Errors
    ///
    /// A file that is there but cannot be read or is malformed, by its path.
    pub fn ground_truth(&self, id: &str) -> Result<Option<GroundTruthFile>> {
        if self.generator.makes(id) {
            return Ok(None);
        }
        let file = self.entry(id)?.path.join("ground_truth_new.npy");
        let found = self.roots.locate(&file)?;
        found.map(|path| GroundTruthFile::read(&path)).transpose()
    }

    /// Opens a dataset: images, ground truth, poses of the kind its layout has (planar in metres,
    /// or six degrees of freedom), and whether it is real or generated. `None` if its images are
    /// not in the folders.
    ///
    /// Images that lie in one archive are unpacked into the cache.
    ///
    /// # Errors
    ///
    /// [`Error::Unknown`] with the names there are, those of [`Generator::open`], and those of
    /// [`Dataset::open`] for data that is there but malformed.
    pub fn open(&self, id: &str, observer: &dyn Observer) -> Result<Option<Dataset>> {
        if self.generator.makes(id) {
            return self.generator.open(id, &self.roots, &self.cache, observer).map(Some);
        }
        let entry = self.manifest.find(id)?;
        match (entry.layout, self.images(entry)?) {
            (_, None) => Ok(None),
            (Layout::Npz, Some(folder)) => unpack(entry, &folder, &self.cache).map(Some),
            (_, Some(_)) => Dataset::open(entry, &self.roots).map(Some),
        }
    }

    /// Where the images of a dataset are, if they are in the folders. Ground truths, scores and lists
    /// of poses are published without them.
    fn images(&self, entry: &DatasetEntry) -> Result<Option<PathBuf>> {
        let images = match entry.layout {
            Layout::VprBench | Layout::ImagePairs => "query",
            Layout::UtmNames => "queries",
            Layout::SevenScenes => "seq-01",
            Layout::Npz => return self.roots.locate(&entry.path),
            Layout::InvarianceScores => return Ok(None),
        };
        self.roots.locate(&entry.path.join(images))
    }

    /// What of a dataset is in the folders; nothing is opened.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if a folder cannot be looked into.
    pub fn at_hand(&self, entry: &DatasetEntry) -> Result<AtHand> {
        let is_there = |path: &Path| Ok::<_, Error>(self.roots.locate(path)?.is_some());
        let images = self.images(entry)?.is_some();
        let truth = match entry.layout {
            Layout::VprBench => is_there(&entry.path.join("ground_truth_new.npy"))?,
            // It follows from order or positions.
            _ => images,
        };
        let scores = match (&entry.matches, entry.layout) {
            (Some(matches), _) => is_there(matches)?,
            (None, Layout::InvarianceScores) => is_there(&entry.path)?,
            (None, _) => false,
        };
        Ok(AtHand { images, truth, scores })
    }

    /// One line that says what is missing and where to get it.
    ///
    /// # Errors
    ///
    /// [`Error::Unknown`].
    pub fn why_absent(&self, id: &str, what: &str) -> Result<String> {
        let entry = self.entry(id)?;
        Ok(format!("{}: no {what} at hand; origin: {}", entry.name, entry.origin))
    }
}

/// Writes the frames of an archive as PNG files, those that are not there yet byte by byte.
fn unpack(entry: &DatasetEntry, folder: &Path, cache: &Path) -> Result<Dataset> {
    let pairs = FramePairs::read(folder, entry.frames, entry.every)?;
    let mut digest = Sha256::new();
    for side in [&pairs.references, &pairs.queries] {
        digest.update(side.as_standard_layout().as_slice().unwrap_or_default());
    }
    let digest = digest.finalize();
    let short = u64::from_be_bytes(std::array::from_fn(|byte| digest[byte]));
    let root = cache.join(format!("{}-{short:016x}", entry.id));
    let queries = unpack_side(&pairs.queries, &pairs.frames, &root.join("query"))?;
    let references = unpack_side(&pairs.references, &pairs.frames, &root.join("ref"))?;
    Dataset::of_pairs(entry, queries, references)
}

fn unpack_side(images: &Array3<u8>, frames: &[usize], folder: &Path) -> Result<Vec<PathBuf>> {
    fs::create_dir_all(folder).map_err(Error::io(folder))?;
    let (_, height, width) = images.dim();
    let length =
        |n: usize| u32::try_from(n).map_err(|err| Error::format(folder, "size", err.to_string()));
    let (height, width) = (length(height)?, length(width)?);
    let mut paths = Vec::new();
    for (image, frame) in images.axis_iter(Axis(0)).zip(frames) {
        let path = folder.join(format!("{frame:07}.png"));
        let levels: Vec<u8> = image.iter().copied().collect();
        let bytes = encode(&levels, width, height)
            .map_err(|cause| Error::format(&path, "image", cause.to_string()))?;
        // A file that differs or cannot be read is written anew.
        if fs::read(&path).ok().as_ref() != Some(&bytes) {
            vpr_files::replace(&path, &bytes)?;
        }
        paths.push(path);
    }
    Ok(paths)
}

fn encode(levels: &[u8], width: u32, height: u32) -> image::ImageResult<Vec<u8>> {
    use image::{ExtendedColorType, ImageEncoder as _, codecs::png::PngEncoder};
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes).write_image(levels, width, height, ExtendedColorType::L8)?;
    Ok(bytes)
}
