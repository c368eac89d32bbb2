//! Datasets as an encoder sees them: what was retrieved for every query, where, and whether rightly.

mod counterparts;

use std::{path::PathBuf, sync::Arc};

pub use counterparts::{COUNTERPARTS, Counterpart};
use ndarray::Array2;
use vpr_core::{GroundTruth, Judged, PlanarPosition, Poses, Provenance, Retrieval, retrieve};
use vpr_data::Dataset;
use vpr_nets::encode::Encoder;
use vpr_study::{
    Direction, Memo, Network, Runner, Sources, Technique,
    technique::Found,
    verification::{LocalMethod, Matches, Verified},
};

use crate::{
    EstimatorChoice, EstimatorSettings, Result, UncertaintyEstimator, Variances,
    net::{Learned, LearnedEncoder},
};

/// References ranked per query: enough for every estimator and sweep.
pub const RANKS: usize = 50;

/// Datasets as encoders see them, opened once: experiments of one process share them.
pub struct Corpora<'a> {
    sources: Sources<'a>,
    opened: Memo<(String, String), Arc<Collection>>,
}

/// One dataset, described by one encoder.
#[derive(Clone, Debug)]
pub struct Corpus {
    /// Name of the dataset, as tables print it.
    pub name: String,
    /// Name of the encoder, as tables print it.
    pub encoder: String,
    /// Where numbers about it come from.
    pub provenance: Provenance,
    /// The best references of every query.
    pub retrieval: Retrieval,
    /// Where the references were taken.
    pub poses: Poses,
    /// Where the queries were taken, if that is known.
    pub query_poses: Option<Poses>,
    /// Which references are correct.
    pub truth: GroundTruth,
    /// The best references, judged.
    pub judged: Judged,
    /// Images of queries and references, if they are at hand.
    pub images: Option<(Vec<PathBuf>, Vec<PathBuf>)>,
    /// Variances of the queries' descriptors, `n_queries × 1` or `n_queries × dimension`, if the
    /// encoder predicts them.
    pub variances: Option<Array2<f32>>,
    /// What a reader should know.
    pub note: Option<String>,
}

impl Corpus {
    /// Row label in tables.
    #[must_use]
    pub fn label(&self) -> String {
        format!("{} / {}", self.name, self.encoder)
    }

    /// The uncertainties of one estimator.
    ///
    /// # Errors
    ///
    /// What the estimator says of its settings or of a query.
    pub fn estimate(
        &self,
        choice: EstimatorChoice,
        settings: &EstimatorSettings,
    ) -> Result<Vec<f64>> {
        choice.prepare(settings, Some(&self.poses))?.estimate(&self.retrieval)
    }
}

impl Corpus {
    /// The uncertainties that its encoder predicts for the queries.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::Empty`] if it predicts none.
    pub fn variance(&self, learned: Learned) -> Result<Vec<f64>> {
        let variances = self.variances.as_ref().ok_or(vpr_core::Error::Empty("variances"))?;
        learned.estimator().estimate(&Variances::new(variances.view())?)
    }

    /// Inliers of every query with its best reference, from the store if they were counted before.
    ///
    /// # Errors
    ///
    /// An image that cannot be read, by its path.
    pub fn inlier_counts(&self, method: LocalMethod, sources: &Sources<'_>) -> Result<Verified> {
        let Some((queries, references)) = &self.images else {
            return Ok(Verified::NotAtHand("there are no images to verify".to_owned()));
        };
        let best = self.retrieval.best();
        let matches = Matches { queries, references, best: &best };
        Ok(sources.inlier_counts(&self.label(), matches, method)?)
    }
}

/// The corpora of one dataset, and why others could not be made.
#[derive(Clone, Debug, Default)]
pub struct Collection {
    /// Those that could be made.
    pub corpora: Vec<Arc<Corpus>>,
    /// Why others could not, one line each.
    pub missing: Vec<String>,
}

/// The encoder that stands for matches stored by the authors.
pub const PUBLISHED: &str = "published";

impl<'a> Corpora<'a> {
    /// Nothing is opened yet.
    #[must_use]
    pub fn new(sources: Sources<'a>) -> Self {
        Self { sources, opened: Memo::default() }
    }

    /// Where data, weights and caches lie.
    #[must_use]
    pub fn sources(&self) -> &Sources<'a> {
        &self.sources
    }

    /// Opens a dataset as each of these encoders sees it.
    ///
    /// `id` is one of the manifest's, `world/…`, or the name of a [`Counterpart`]. Encoders are
    /// [`PUBLISHED`] for stored score matrices, `btl`, `stun`, or the name of a technique, see
    /// [`vpr_study::technique`].
    ///
    /// # Errors
    ///
    /// Data that is there but malformed; data or weights that are not there are in
    /// [`Collection::missing`].
    pub fn open(&self, id: &str, encoders: &[String]) -> Result<Collection> {
        let mut all = Collection::default();
        // Stored matches come first, wherever they are listed.
        let (stored, others): (Vec<&String>, _) = encoders.iter().partition(|it| *it == PUBLISHED);
        for encoder in stored.into_iter().chain(others) {
            let key = (id.to_owned(), encoder.clone());
            let one = self.opened.get_or(key, || self.open_one(id, encoder).map(Arc::new))?;
            all.corpora.extend(one.corpora.iter().cloned());
            for why in &one.missing {
                // A dataset that is not at hand is missing once, however many encoders ask for it.
                if !all.missing.contains(why) {
                    all.missing.push(why.clone());
                }
            }
        }
        Ok(all)
    }

    fn open_one(&self, id: &str, encoder: &str) -> Result<Collection> {
        let counterpart = COUNTERPARTS.iter().find(|it| it.name == id);
        let real_id = counterpart.map_or(id, |it| it.world);
        if encoder == PUBLISHED {
            return self.published(real_id);
        }
        let Some(dataset) = self.sources.images(real_id)? else {
            return Ok(missing(self.sources.why_absent(real_id, "images")?));
        };
        let name = counterpart.map_or(dataset.name.as_str(), |it| it.name);
        let corpus = match Learned::named(encoder) {
            Some(learned) => self.with_variances(learned, &dataset)?,
            None => self.described(encoder, &dataset)?,
        };
        Ok(match corpus {
            Ok(corpus) => {
                let corpus = Corpus { name: name.to_owned(), ..corpus };
                Collection { corpora: vec![Arc::new(corpus)], missing: Vec::new() }
            }
            Err(why) => missing(why),
        })
    }

    /// One corpus per technique with stored matches; scores are cosines, so distances are those of
    /// unit descriptors.
    fn published(&self, id: &str) -> Result<Collection> {
        let mut corpora = Vec::new();
        for technique in Technique::ALL {
            let Some(stored) = self.sources.stored(id, technique)? else { continue };
            let retrieval = stored.scores.retrieval(RANKS)?;
            corpora.push(Arc::new(Corpus {
                name: self.sources.entry(id)?.name,
                encoder: format!("{}, stored scores", technique.name()),
                provenance: stored.provenance,
                judged: Judged::new(&retrieval.best(), &stored.truth)?,
                retrieval,
                poses: frames(stored.truth.n_references()),
                query_poses: None,
                truth: (*stored.truth).clone(),
                images: None,
                variances: None,
                note: Some("frame indices stand for positions".to_owned()),
            }));
        }
        if corpora.is_empty() {
            return Ok(missing(self.sources.why_absent(id, "stored matches")?));
        }
        Ok(Collection { corpora, missing: Vec::new() })
    }

    /// A technique of the registry; `Err` inside is why it is not at hand.
    fn described(&self, encoder: &str, dataset: &Dataset) -> Result<Result<Corpus, String>> {
        let runner = match self.sources.find(encoder)? {
            Found::Runs(runner) => runner,
            Found::Absent(why) => return Ok(Err(why)),
        };
        let scores = self.sources.scores(&runner, dataset, Direction::AsReleased)?;
        corpus_of(dataset, runner.encoder, scores.retrieval(RANKS)?).map(Ok)
    }

    /// A network that predicts variances with its descriptors.
    fn with_variances(
        &self,
        learned: Learned,
        dataset: &Dataset,
    ) -> Result<Result<Corpus, String>> {
        let (name, file) = (learned.name(), learned.weights());
        let Some(path) = self.sources.locate(&file)? else {
            let (key, file) = (learned.key(), file.display());
            return Ok(Err(format!(
                "{name}: its weights, {file}, are not at hand; `sue train {key}` makes them"
            )));
        };
        let encoder = Arc::new(LearnedEncoder::open(learned, &path)?);
        let runner = Runner {
            name: learned.key().to_owned(),
            column: name,
            encoder: name.to_owned(),
            technique: Arc::new(Network::new(Arc::clone(&encoder) as Arc<dyn Encoder>)),
        };
        let of = |images: &[PathBuf]| {
            let what = format!("{name} on {}", dataset.name);
            let rows = self.sources.features(&runner, images, &what)?.into_descriptors();
            encoder.split(&rows.ok_or(vpr_core::Error::Empty("descriptors of a network"))?)
        };
        let (queries, references) = (of(&dataset.queries)?, of(&dataset.references)?);
        let retrieval = retrieve(&queries.descriptors, &references.descriptors, RANKS)?;
        let corpus = corpus_of(dataset, name.to_owned(), retrieval)?;
        Ok(Ok(Corpus { variances: Some(queries.variances), ..corpus }))
    }
}

fn missing(why: String) -> Collection {
    Collection { corpora: Vec::new(), missing: vec![why] }
}

fn corpus_of(dataset: &Dataset, encoder: String, retrieval: Retrieval) -> Result<Corpus> {
    let (query_poses, poses) = match &dataset.poses {
        Some((queries, references)) => (Some(queries.clone()), references.clone()),
        None => (None, frames(dataset.references.len())),
    };
    let note = dataset.poses.is_none().then(|| "frame indices stand for positions".to_owned());
    Ok(Corpus {
        name: dataset.name.clone(),
        encoder,
        provenance: dataset.provenance,
        judged: Judged::new(&retrieval.best(), &dataset.truth)?,
        retrieval,
        poses,
        query_poses,
        truth: dataset.truth.clone(),
        images: Some((dataset.queries.clone(), dataset.references.clone())),
        variances: None,
        note,
    })
}

/// Frame indices as positions on a line.
fn frames(n: usize) -> Poses {
    Poses::Planar((0..n).map(|frame| PlanarPosition::new(frame as f64, 0.0)).collect())
}
