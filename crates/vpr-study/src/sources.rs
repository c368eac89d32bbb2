//! What a study draws on: datasets by name, techniques by name, and what was computed before.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, OnceLock},
};

use vpr_core::{Observer, Provenance, Result};
use vpr_data::{
    AtHand, DataRoots, Dataset, DatasetEntry, Datasets, layout::vpr_bench::GroundTruthFile,
};
use vpr_worlds::Worlds;

use crate::{
    Direction, Features, Runner, Scores, Store, Stored, Technique,
    memo::Memo,
    technique::{self, Found},
    verification::LocalMethod,
};

/// Datasets, weights, caches, and whoever is told about progress.
///
/// Studies that run in one process share what they opened and computed; descriptors of networks
/// and inlier counts are also kept on disk, see [`Store`].
pub struct Sources<'a> {
    datasets: Datasets,
    store: Store,
    observer: &'a dyn Observer,
    opened: Memo<String, Option<Arc<Dataset>>>,
    scores: Memo<String, Arc<Scores>>,
    pub(crate) stored: Memo<(String, Technique), Option<Arc<Stored>>>,
    runners: OnceLock<Vec<Runner>>,
    #[cfg(feature = "networks")]
    found: Memo<String, Arc<Found>>,
}

impl<'a> Sources<'a> {
    /// Datasets and weights in `folders`, the first that has one wins; what is rendered, unpacked
    /// or takes long is kept in `cache`.
    pub fn new<'f>(
        folders: impl IntoIterator<Item = &'f Path>,
        cache: &Path,
        observer: &'a dyn Observer,
    ) -> Self {
        let roots = DataRoots::new(folders.into_iter().map(Path::to_owned));
        Self {
            datasets: Datasets::new(roots, cache, Worlds),
            store: Store::new(cache),
            observer,
            opened: Memo::default(),
            scores: Memo::default(),
            stored: Memo::default(),
            runners: OnceLock::new(),
            #[cfg(feature = "networks")]
            found: Memo::default(),
        }
    }

    /// All datasets the manifest knows.
    pub fn entries(&self) -> impl Iterator<Item = &DatasetEntry> {
        self.datasets.entries()
    }

    /// The manifest's entry, or that of a generated world, `world/<name>`.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::Unknown`] with the names there are.
    pub fn entry(&self, id: &str) -> Result<DatasetEntry> {
        self.datasets.entry(id)
    }

    /// The folders that datasets and weights are looked for in.
    #[must_use]
    pub fn roots(&self) -> &DataRoots {
        self.datasets.roots()
    }

    /// The folder that keeps what is rendered or takes long.
    #[must_use]
    pub fn cache(&self) -> &Path {
        self.datasets.cache()
    }

    /// What is kept on disk.
    #[must_use]
    pub fn store(&self) -> &Store {
        &self.store
    }

    /// Whoever is told about progress.
    #[must_use]
    pub fn observer(&self) -> &'a dyn Observer {
        self.observer
    }

    /// Where a path relative to a data folder lies, if it is at hand.
    ///
    /// # Errors
    ///
    /// As [`DataRoots::locate`].
    pub fn locate(&self, path: &Path) -> Result<Option<PathBuf>> {
        self.roots().locate(path)
    }

    /// What of a dataset of the manifest is at hand.
    ///
    /// # Errors
    ///
    /// As [`Datasets::at_hand`].
    pub fn at_hand(&self, entry: &DatasetEntry) -> Result<AtHand> {
        self.datasets.at_hand(entry)
    }

    /// The published ground truth of a dataset, if at hand.
    ///
    /// # Errors
    ///
    /// If the file is there but cannot be read.
    pub fn ground_truth(&self, id: &str) -> Result<Option<GroundTruthFile>> {
        self.datasets.ground_truth(id)
    }

    /// The images of a dataset with their truth, if at hand; a generated world always is.
    ///
    /// # Errors
    ///
    /// As [`Datasets::open`].
    pub fn images(&self, id: &str) -> Result<Option<Arc<Dataset>>> {
        let open = || Ok(self.datasets.open(id, self.observer)?.map(Arc::new));
        self.opened.get_or(id.to_owned(), open)
    }

    /// Where numbers from the images of a dataset come from.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::Unknown`].
    pub fn provenance(&self, id: &str) -> Result<Provenance> {
        Ok(self.entry(id)?.provenance)
    }

    /// One line that says what is missing and where to get it.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::Unknown`].
    pub fn why_absent(&self, id: &str, what: &str) -> Result<String> {
        self.datasets.why_absent(id, what)
    }

    /// The techniques that have a column and whose weights are at hand, see
    /// [`technique::runners`]; opened once.
    ///
    /// # Errors
    ///
    /// If weights are there but are not those of the network.
    pub fn runners(&self) -> Result<&[Runner]> {
        if let Some(runners) = self.runners.get() {
            return Ok(runners);
        }
        let runners = technique::runners(self.roots())?;
        Ok(self.runners.get_or_init(|| runners))
    }

    /// A technique by name, or what of it is not at hand; opened once.
    ///
    /// # Errors
    ///
    /// As [`technique::find`].
    pub fn find(&self, name: &str) -> Result<Found> {
        #[cfg(feature = "networks")]
        {
            let find = || technique::find(name, self.roots()).map(Arc::new);
            self.found.get_or(name.to_owned(), find).map(Arc::unwrap_or_clone)
        }
        #[cfg(not(feature = "networks"))]
        technique::find(name, self.roots())
    }

    /// A technique by name, `None` if its weights are not at hand.
    ///
    /// # Errors
    ///
    /// As [`technique::find`].
    pub fn runner(&self, name: &str) -> Result<Option<Runner>> {
        Ok(match self.find(name)? {
            Found::Runs(runner) => Some(runner),
            Found::Absent(_) => None,
        })
    }

    /// How rows and columns call what needs weights that are not at hand: no cell that names one can
    /// be computed.
    ///
    /// # Errors
    ///
    /// Weights that are there but are not those of the network; a folder that cannot be searched.
    pub fn without_weights(&self) -> Result<Vec<&'static str>> {
        let mut names = technique::without_weights(|name| self.find(name))?;
        for method in LocalMethod::ALL {
            if method.features().find_weights(self.roots())?.is_err() {
                names.push(method.name());
            }
        }
        Ok(names)
    }

    /// What a technique finds on the images of a dataset, by way of [`Store::key`] of both lists:
    /// computed once per process.
    ///
    /// # Errors
    ///
    /// The first image that cannot be read or decoded, by its path.
    pub fn scores(
        &self,
        runner: &Runner,
        dataset: &Dataset,
        direction: Direction,
    ) -> Result<Arc<Scores>> {
        let [queries, references] = direction.sides(dataset);
        let key = Store::key(&runner.technique.key(), [queries, references])?;
        self.scores.get_or(key, || {
            let what = format!("{} on {}", runner.column, dataset.name);
            let queries = self.features(runner, queries, &what)?;
            let references = self.features(runner, references, &what)?;
            let matched = queries.match_with(&references)?;
            let note = (matched.n_fallbacks > 0).then(|| {
                let n = matched.n_fallbacks;
                format!(
                    "in {n} queries no region passes the entropy threshold: all are used (VB-12)"
                )
            });
            Ok(Arc::new(Scores::new(matched.similarities, note)))
        })
    }

    /// What a technique makes of images, from the store if it is kept there; `what` is what
    /// progress is told about.
    ///
    /// # Errors
    ///
    /// The first image that cannot be read or decoded, by its path.
    pub fn features(&self, runner: &Runner, images: &[PathBuf], what: &str) -> Result<Features> {
        let encode = || {
            self.observer.start(what, images.len());
            let features = runner.technique.encode(images, &|| self.observer.step());
            self.observer.end();
            features
        };
        let Some(about) = runner.technique.about() else { return encode() };
        let key = Store::key(&format!("descriptors 2 {}", runner.technique.key()), [images])?;
        let rows = self.store.descriptors(&key, &about, || {
            let none = vpr_core::Error::Empty("vectors of a technique whose vectors are kept");
            encode()?.into_descriptors().ok_or(none)
        })?;
        Ok(runner.technique.kept(rows))
    }
}
