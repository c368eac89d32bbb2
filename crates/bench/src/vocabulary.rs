//! Vocabularies of `DenseVLAD` and its like, trained on generated places.

use std::path::PathBuf;

use ndarray::{Array2, Axis, concatenate};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use vpr_core::{
    Descriptors, Error, Result,
    knn::{Pca, PcaParams},
    metrics::recall_at,
};
use vpr_data::Dataset;
use vpr_study::Sources;
use vpr_vision::{
    hog::similarities,
    image,
    vlad::{Local, Projection, VladEncoder, Vocabulary, VocabularyParams},
};

/// Places that vocabularies are trained on: recipes with other seeds than any page or test has.
const TRAINING: [&str; 11] = [
    "street",
    "street-night",
    "street-seasons",
    "street-grey",
    "rail",
    "campus",
    "campus-dusk",
    "corridor",
    "rooms",
    "living-room",
    "shop-facade",
];

/// Places that choose among projections.
const VALIDATION: [&str; 6] =
    ["street", "street-night", "rail", "campus-dusk", "corridor", "rooms"];

/// How a vocabulary is trained.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The local features.
    pub local: Local,
    /// Number of words.
    pub words: usize,
    /// Features drawn from every image for the words.
    pub features_per_image: usize,
    /// Projections that are tried beside none.
    pub components: Vec<usize>,
    /// Places of every generated world.
    pub places: usize,
    /// Decides worlds, features and first words.
    pub seed: u64,
}

/// What a projection gives on the places that choose.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// Components; `None` without a projection.
    pub components: Option<usize>,
    /// Whether they are whitened.
    pub whiten: bool,
    /// Recall@1 on each of the places.
    pub recalls: Vec<f64>,
}

impl Trial {
    /// Mean of the recalls: what decides.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.recalls.iter().sum::<f64>() / self.recalls.len() as f64
    }
}

/// An encoder with all that was tried.
#[derive(Debug)]
pub struct Trained {
    /// The encoder with the projection that was best; of equals the one tried first.
    pub encoder: VladEncoder,
    /// All trials.
    pub trials: Vec<Trial>,
    /// Names of the places that chose.
    pub places: Vec<String>,
}

/// Trains a vocabulary and chooses its projection, all on generated places.
///
/// # Errors
///
/// [`Error::Parameter`] for counts that do not fit; errors of rendering.
pub fn train(sources: &Sources<'_>, plan: &Plan) -> Result<Trained> {
    let mut images = Vec::new();
    for name in TRAINING {
        let dataset = world(sources, name, plan.seed + 1, plan.places)?;
        images.extend_from_slice(&dataset.queries);
        images.extend_from_slice(&dataset.references);
    }
    let params = VocabularyParams { clusters: plan.words, rounds: 25, seed: plan.seed };
    let fitted = Vocabulary::fit(&sampled(sources, plan, &images)?, &params)?;
    // As they are kept: in half precision.
    let unprojected = VladEncoder::new(plan.local.clone(), fitted, None)?;
    let unprojected = VladEncoder::read("vocabulary".as_ref(), &unprojected.to_bytes(&[])?)?;
    let rows = vlads(sources, &unprojected, &images, "training places")?;
    let mut judges = Vec::new();
    for name in VALIDATION {
        let dataset = world(sources, name, plan.seed + 2, plan.places)?;
        let queries = vlads(sources, &unprojected, &dataset.queries, name)?;
        let references = vlads(sources, &unprojected, &dataset.references, name)?;
        judges.push((dataset, queries, references));
    }
    let mut trials = Vec::new();
    let mut best: Option<(f64, Option<Projection>)> = None;
    let mut tried = vec![(None, false)];
    tried.extend(plan.components.iter().flat_map(|&n| [(Some(n), true), (Some(n), false)]));
    for (components, whiten) in tried {
        let projection = match components {
            None => None,
            Some(n_components) => {
                let params = PcaParams { n_components, whiten };
                Some(Projection::of(&Pca::fit(&rows, &params)?))
            }
        };
        let mut recalls = Vec::new();
        for (dataset, queries, references) in &judges {
            let scores = similarities(
                &projected(queries, projection.as_ref())?,
                &projected(references, projection.as_ref())?,
            )?;
            recalls.push(recall_at(1, &scores.ranked(1)?, &dataset.truth)?);
        }
        let trial = Trial { components, whiten, recalls };
        if best.as_ref().is_none_or(|(mean, _)| trial.mean() > *mean) {
            best = Some((trial.mean(), projection));
        }
        trials.push(trial);
    }
    let (_, projection) = best.ok_or(Error::Empty("projections to try"))?;
    let vocabulary = unprojected.vocabulary().clone();
    let encoder = VladEncoder::new(plan.local.clone(), vocabulary, projection)?;
    Ok(Trained { encoder, trials, places: VALIDATION.map(str::to_owned).to_vec() })
}

/// A generated world under a seed of its own, its images no larger than those it is to serve.
fn world(sources: &Sources<'_>, name: &str, seed: u64, places: usize) -> Result<Dataset> {
    let id = format!(
        "world/{name}?seed={}&places={places}&camera.width=160&camera.height=120&camera.focal=115.0",
        70_000 + seed
    );
    let dataset = sources.images(&id)?.ok_or(Error::Empty("generated places"))?;
    Ok(Dataset::clone(&dataset))
}

/// Features drawn from images, those of zero length left out.
fn sampled(sources: &Sources<'_>, plan: &Plan, images: &[PathBuf]) -> Result<Descriptors> {
    let observer = sources.observer();
    observer.start("features", images.len());
    let drawn: Vec<Result<Array2<f32>>> = (images.par_iter().enumerate())
        .map(|(at, path)| {
            let sets = plan.local.describe(&image::decode(path)?)?;
            let mut random = ChaCha8Rng::seed_from_u64(plan.seed);
            random.set_stream(at as u64);
            let rows: Vec<_> = sets.iter().flat_map(|set| set.view().into_outer_iter()).collect();
            let mut values = Vec::new();
            for _ in 0..plan.features_per_image {
                let row = rows[random.random_range(0..rows.len())];
                if row.iter().any(|&it| it != 0.0) {
                    values.extend(row);
                }
            }
            observer.step();
            let dim = sets[0].dim();
            let shape = (values.len() / dim, dim);
            Ok(Array2::from_shape_vec(shape, values).expect("whole rows"))
        })
        .collect();
    observer.end();
    let drawn = drawn.into_iter().collect::<Result<Vec<_>>>()?;
    let views: Vec<_> = drawn.iter().map(|it| it.view()).collect();
    let all = concatenate(Axis(0), &views).map_err(|_| Error::Empty("images to train on"))?;
    Descriptors::new(all)
}

fn vlads(
    sources: &Sources<'_>,
    encoder: &VladEncoder,
    images: &[PathBuf],
    what: &str,
) -> Result<Descriptors> {
    let observer = sources.observer();
    observer.start(what, images.len());
    let rows: Vec<Result<Vec<f32>>> = images
        .par_iter()
        .map(|path| {
            let row = encoder.vlad(&image::decode(path)?);
            observer.step();
            row
        })
        .collect();
    observer.end();
    let values = rows.into_iter().collect::<Result<Vec<_>>>()?.concat();
    let dim = values.len() / images.len().max(1);
    Descriptors::new(Array2::from_shape_vec((images.len(), dim), values).expect("whole rows"))
}

fn projected(rows: &Descriptors, projection: Option<&Projection>) -> Result<Descriptors> {
    let Some(projection) = projection else { return Ok(rows.clone()) };
    let values: Vec<Vec<f32>> = (rows.as_slice().par_chunks_exact(rows.dim()))
        .map(|row| projection.apply(row))
        .collect::<Result<_>>()?;
    let shape = (rows.len(), projection.n_components());
    Descriptors::new(Array2::from_shape_vec(shape, values.concat()).expect("whole rows"))
}
