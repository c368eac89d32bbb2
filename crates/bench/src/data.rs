//! The data at hand: which datasets lie in the data folders and what is stored for them.

use std::path::{Path, PathBuf};

use vpr_core::{
    BestMatches, GroundTruth, Result, Similarities,
    dataset::{
        DataRoots, Dataset, DatasetEntry, Layout, Manifest,
        layout::vpr_bench::{GroundTruthFile, PublishedMatches},
    },
    metrics::Timing,
    table::Provenance,
};

use crate::technique::Technique;

/// The manifest and the folders it is resolved in.
#[derive(Clone, Debug)]
pub struct Data {
    manifest: Manifest,
    roots: DataRoots,
}

/// Matches that the authors stored, with the ground truth they are judged by.
#[derive(Clone, Debug)]
pub struct Stored {
    /// Similarity of every query with every reference.
    pub similarities: Similarities,
    /// The best references as stored.
    pub best: BestMatches,
    /// Encoding and matching time as stored, in seconds.
    pub timing: Timing,
    /// Which references are correct.
    pub truth: GroundTruth,
    /// Entries of the ground truth that point past the references (VB-15).
    pub n_clamped: usize,
}

impl Data {
    /// The built-in manifest over `data` (what the user names) and the workspace's own `data`.
    #[must_use]
    pub fn new(data: &Path, workspace_data: &Path) -> Self {
        let roots = DataRoots::new([data.to_owned(), workspace_data.to_owned()]);
        Self { manifest: Manifest::builtin(), roots }
    }

    /// All datasets the manifest knows.
    pub fn entries(&self) -> impl Iterator<Item = &DatasetEntry> {
        self.manifest.datasets.iter()
    }

    /// The manifest's entry.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::Unknown`] with the names there are.
    pub fn entry(&self, id: &str) -> Result<&DatasetEntry> {
        self.manifest.find(id)
    }

    /// Where a path of the manifest lies, if it is at hand.
    #[must_use]
    pub fn find(&self, path: impl AsRef<Path>) -> Option<PathBuf> {
        self.roots.find(path.as_ref()).ok()
    }

    /// The published ground truth of a dataset, if at hand.
    ///
    /// # Errors
    ///
    /// If the file is there but cannot be read.
    pub fn ground_truth(&self, id: &str) -> Result<Option<GroundTruthFile>> {
        let path = self.entry(id)?.path.join("ground_truth_new.npy");
        self.find(path).map(|path| GroundTruthFile::read(&path)).transpose()
    }

    /// The matches stored for a technique, if at hand.
    ///
    /// # Errors
    ///
    /// If a file is there but cannot be read, or the matches and the truth do not fit.
    pub fn stored(&self, id: &str, technique: Technique) -> Result<Option<Stored>> {
        let Some(folder) = &self.entry(id)?.matches else { return Ok(None) };
        let file = folder.join(technique.stored_name()).join("precomputed_data_corrected.npy");
        let (Some(path), Some(truth)) = (self.find(file), self.ground_truth(id)?) else {
            return Ok(None);
        };
        let matches = PublishedMatches::read(&path)?;
        let (truth, n_clamped) = truth.truth(matches.similarities.n_references())?;
        let timing = Timing { encoding: matches.encode_s, matching: matches.match_s };
        let best = BestMatches { reference: matches.reference, confidence: matches.score };
        Ok(Some(Stored { similarities: matches.similarities, best, timing, truth, n_clamped }))
    }

    /// The images of a dataset with their truth, if at hand.
    ///
    /// # Errors
    ///
    /// If the folders are there but something in them is wrong.
    pub fn images(&self, id: &str) -> Result<Option<Dataset>> {
        let entry = self.entry(id)?;
        let folder = match entry.layout {
            Layout::VprBench | Layout::ImagePairs => "query",
            Layout::UtmNames => "queries",
            Layout::Npz | Layout::SevenScenes | Layout::InvarianceScores => return Ok(None),
        };
        let at_hand = self.find(entry.path.join(folder)).is_some();
        at_hand.then(|| Dataset::open(entry, &self.roots)).transpose()
    }

    /// Where numbers from the images of a dataset come from.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::Unknown`].
    pub fn provenance(&self, id: &str) -> Result<Provenance> {
        let is_generated = self.entry(id)?.path.starts_with("fixture");
        Ok(if is_generated { Provenance::Generated } else { Provenance::Measured })
    }

    /// One line that says what is missing and where to get it.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::Unknown`].
    pub fn why_absent(&self, id: &str, what: &str) -> Result<String> {
        let entry = self.entry(id)?;
        Ok(format!("{}: no {what} at hand; origin: {}", entry.name, entry.origin))
    }
}
