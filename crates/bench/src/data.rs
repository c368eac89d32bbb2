//! The data at hand: which datasets lie in the data folders and what is stored for them.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use vpr_core::{
    BestMatches, GroundTruth, Observer, Result, Similarities,
    dataset::{
        DataRoots, Dataset, DatasetEntry, Manifest,
        layout::vpr_bench::{GroundTruthFile, PublishedMatches},
    },
    metrics::Timing,
    table::Provenance,
};

use crate::technique::{Network, Technique, networks};

/// The manifest, the folders it is resolved in, and what was computed from them so far.
///
/// Experiments that run in one process share opened datasets and score matrices; nothing of that
/// outlives the process.
#[derive(Debug)]
pub struct Data {
    manifest: Manifest,
    roots: DataRoots,
    cache: PathBuf,
    datasets: Mutex<BTreeMap<String, Option<Arc<Dataset>>>>,
    scores: Mutex<BTreeMap<ScoreKey, Arc<Scores>>>,
    networks: Mutex<Option<Vec<(&'static str, Network)>>>,
}

/// Which scores: first query, technique with its settings, and whether the sides are exchanged.
pub(crate) type ScoreKey = (String, String, bool);

/// What a technique found on a dataset.
#[derive(Clone, Debug)]
pub(crate) struct Scores {
    /// Similarity of every query with every reference.
    pub(crate) similarities: Similarities,
    /// What is to be said of them.
    pub(crate) note: Option<String>,
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
    /// The built-in manifest over `data` (what the user names) and the workspace's own `data`;
    /// generated worlds are kept in `cache`.
    #[must_use]
    pub fn new(data: &Path, workspace_data: &Path, cache: &Path) -> Self {
        Self {
            manifest: Manifest::builtin(),
            roots: DataRoots::new([data.to_owned(), workspace_data.to_owned()]),
            cache: cache.to_owned(),
            datasets: Mutex::default(),
            scores: Mutex::default(),
            networks: Mutex::default(),
        }
    }

    /// All datasets the manifest knows.
    pub fn entries(&self) -> impl Iterator<Item = &DatasetEntry> {
        self.manifest.datasets.iter()
    }

    /// The manifest's entry, or that of a generated world, `world/<name>`.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::Unknown`] with the names there are.
    pub fn entry(&self, id: &str) -> Result<DatasetEntry> {
        if vpr_worlds::is_world(id) {
            return vpr_worlds::entry(id);
        }
        self.manifest.find(id).cloned()
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
        if vpr_worlds::is_world(id) {
            return Ok(None);
        }
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

    /// The images of a dataset with their truth, if at hand; a generated world always is.
    ///
    /// # Errors
    ///
    /// As [`vpr_worlds::open_named`].
    pub fn images(&self, id: &str, observer: &dyn Observer) -> Result<Option<Arc<Dataset>>> {
        if let Some(dataset) = lock(&self.datasets).get(id) {
            return Ok(dataset.clone());
        }
        let dataset = vpr_worlds::open_named(id, &self.roots, &self.cache, observer)?.map(Arc::new);
        lock(&self.datasets).insert(id.to_owned(), dataset.clone());
        Ok(dataset)
    }

    /// The networks whose weights are at hand, each with the name of its column; opened once.
    ///
    /// # Errors
    ///
    /// If weights are there but are not those of the network.
    pub fn networks(&self) -> Result<Vec<(&'static str, Network)>> {
        let mut opened = lock(&self.networks);
        if let Some(opened) = &*opened {
            return Ok(opened.clone());
        }
        Ok(opened.insert(networks(&self.roots.roots)?).clone())
    }

    /// Scores that an experiment of this process has computed already, or those `compute` gives.
    pub(crate) fn scores(
        &self,
        key: ScoreKey,
        compute: impl FnOnce() -> Result<Scores>,
    ) -> Result<Arc<Scores>> {
        if let Some(scores) = lock(&self.scores).get(&key) {
            return Ok(Arc::clone(scores));
        }
        let scores = Arc::new(compute()?);
        lock(&self.scores).insert(key, Arc::clone(&scores));
        Ok(scores)
    }

    /// Where numbers from the images of a dataset come from.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::Unknown`].
    pub fn provenance(&self, id: &str) -> Result<Provenance> {
        Ok(self.entry(id)?.provenance())
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

/// What a thread that panicked left behind is whole: entries are inserted at once.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
