//! Datasets as an encoder sees them: what was retrieved for every query, where, and whether rightly.

mod counterparts;
mod encoded;
mod inliers;
mod keys;
mod published;

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

pub use counterparts::{COUNTERPARTS, Counterpart};
pub use inliers::{LocalMethod, Verified, Verifier, inlier_counts};
use ndarray::Array2;
use vpr_core::{
    GroundTruth, Observer, PlanarPosition, Poses, Retrieval, Similarities,
    dataset::{DataRoots, Dataset, DatasetEntry, Manifest},
    table::Provenance,
};

use crate::{
    EstimatorChoice, EstimatorSettings, Result, UncertaintyEstimator, Variances, evaluate::Judged,
    net::Learned,
};

/// References ranked per query: enough for every estimator and sweep.
pub const RANKS: usize = 50;

/// Where data, weights and caches lie.
#[derive(Clone, Copy)]
pub struct Sources<'a> {
    /// Folders of datasets and weights, the first that has one wins.
    pub roots: &'a DataRoots,
    /// Folder that keeps rendered places, descriptors and inlier counts.
    pub cache: &'a Path,
    /// Told about progress.
    pub observer: &'a dyn Observer,
    /// What was opened before.
    pub known: &'a Known,
}

/// Datasets opened so far: experiments of one process share them.
#[derive(Debug, Default)]
pub struct Known(Mutex<BTreeMap<(String, Vec<String>), Opened>>);

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
}

/// All corpora of one dataset: one per encoder, or the error that an encoder is not at hand.
#[derive(Clone, Debug)]
pub struct Opened {
    /// Those that could be made.
    pub corpora: Vec<Corpus>,
    /// Why others could not, one line each.
    pub missing: Vec<String>,
}

/// The encoder that stands for matches stored by the authors.
pub const PUBLISHED: &str = "published";

/// Opens a dataset as each of these encoders sees it.
///
/// `id` is one of the manifest's, `world/…`, or the name of a [`Counterpart`]. Encoders are `hog`,
/// `cohog`, `btl`, `stun`, [`PUBLISHED`] for stored score matrices, or a name that
/// `vpr_nets::encode` knows.
///
/// # Errors
///
/// Data that is there but malformed; data or weights that are not there are in
/// [`Opened::missing`].
pub fn open(id: &str, encoders: &[String], sources: &Sources<'_>) -> Result<Opened> {
    let key = (id.to_owned(), encoders.to_vec());
    // Entries are inserted whole, so a thread that panicked left nothing half done.
    let known = || sources.known.0.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(opened) = known().get(&key) {
        return Ok(opened.clone());
    }
    let opened = open_anew(id, encoders, sources)?;
    known().insert(key, opened.clone());
    Ok(opened)
}

fn open_anew(id: &str, encoders: &[String], sources: &Sources<'_>) -> Result<Opened> {
    let counterpart = COUNTERPARTS.iter().find(|it| it.name == id);
    let real_id = counterpart.map_or(id, |it| it.world);
    let mut opened = Opened { corpora: Vec::new(), missing: Vec::new() };
    if encoders.iter().any(|it| it == PUBLISHED) {
        let entry = Manifest::builtin();
        let entry = entry.find(real_id)?;
        opened.corpora.extend(published::open(entry, sources)?);
        if opened.corpora.is_empty() {
            opened.missing.push(absent(entry, "stored matches"));
        }
    }
    let encoders: Vec<&String> = encoders.iter().filter(|it| *it != PUBLISHED).collect();
    if encoders.is_empty() {
        return Ok(opened);
    }
    let dataset = vpr_worlds::open_named(real_id, sources.roots, sources.cache, sources.observer)?;
    let Some(mut dataset) = dataset else {
        let manifest = Manifest::builtin();
        opened.missing.push(absent(manifest.find(real_id)?, "images"));
        return Ok(opened);
    };
    if let Some(counterpart) = counterpart {
        counterpart.name.clone_into(&mut dataset.name);
    }
    for encoder in encoders {
        match encoded::describe(encoder, &dataset, sources)? {
            encoded::Described::As { encoder, retrieval, variances } => {
                let corpus = corpus_of(&dataset, encoder, retrieval)?;
                opened.corpora.push(Corpus { variances, ..corpus });
            }
            encoded::Described::NotAtHand(why) => opened.missing.push(why),
        }
    }
    Ok(opened)
}

fn absent(entry: &DatasetEntry, what: &str) -> String {
    format!("{}: no {what} at hand; origin: {}", entry.name, entry.origin)
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

/// Distances of unit descriptors with these cosines, `√(2 − 2 s)`, and the references in their
/// order.
fn retrieval_of(similarities: &Similarities) -> Result<Retrieval> {
    let ranking = similarities.ranked(RANKS)?;
    let shape = (ranking.len(), ranking.k());
    let indices = Array2::from_shape_fn(shape, |(query, rank)| ranking.indices(query)[rank]);
    let distances = Array2::from_shape_fn(shape, |(query, rank)| {
        let similarity = similarities.view()[(query, indices[(query, rank)])];
        distance(similarity)
    });
    Ok(Retrieval::new(indices, distances)?)
}

#[expect(clippy::cast_possible_truncation, reason = "distances are f32")]
fn distance(cosine: f64) -> f32 {
    (2.0 - 2.0 * cosine).max(0.0).sqrt() as f32
}
