//! Images described here.

use std::path::{Path, PathBuf};

use ndarray::Array2;
use rayon::prelude::*;
use vpr_core::{
    Descriptors, Retrieval,
    dataset::Dataset,
    map::{About, OpenMap, Opening, RowType, door::Parts},
    retrieve,
};
use vpr_nets::encode::{self, Encoder, Options, registry::Method};
use vpr_vision::{
    cohog::{self, CoHog, CoHogParams},
    hog::{Hog, HogParams},
    image,
};

use super::{RANKS, Sources, keys::key, retrieval_of};
use crate::{
    Result,
    net::{Learned, LearnedEncoder},
};

/// What became of a dataset under one encoder.
pub(super) enum Described {
    /// It was described.
    As {
        /// The encoder's name in tables.
        encoder: String,
        /// What it retrieves.
        retrieval: Retrieval,
        /// Variances of the queries' descriptors, one row each.
        variances: Option<Array2<f32>>,
    },
    /// The encoder is not at hand, and why.
    NotAtHand(String),
}

pub(super) fn describe(
    encoder: &str,
    dataset: &Dataset,
    sources: &Sources<'_>,
) -> Result<Described> {
    let (queries, references) = (&dataset.queries, &dataset.references);
    let named = |name: &str, retrieval| Described::As {
        encoder: name.to_owned(),
        retrieval,
        variances: None,
    };
    match encoder {
        "hog" => {
            let hog = Hog::new(HogParams::RELEASED)?;
            let of = |images: &[PathBuf]| {
                let n = images.len();
                sources.observer.start(&format!("HOG on {}", dataset.name), n);
                let rows = each(images, sources, |path| hog.describe(&image::decode(path)?));
                sources.observer.end();
                let rows = rows?;
                let shape = (images.len(), HogParams::RELEASED.dim());
                let rows = Array2::from_shape_fn(shape, |(row, column)| rows[row][column]);
                Ok::<_, crate::Error>(Descriptors::new(rows)?.normalized())
            };
            Ok(named("HOG", retrieve(&of(queries)?, &of(references)?, RANKS)?))
        }
        "cohog" => {
            let cohog = CoHog::new(CoHogParams::default())?;
            let of = |images: &[PathBuf]| {
                sources.observer.start(&format!("CoHOG on {}", dataset.name), images.len());
                let found = each(images, sources, |path| cohog.describe(&image::decode(path)?));
                sources.observer.end();
                found
            };
            let similarities = cohog::similarities(&of(queries)?, &of(references)?)?;
            Ok(named("CoHOG", retrieval_of(&similarities)?))
        }
        name => match Learned::named(name) {
            Some(learned) => with_variances(learned, dataset, sources),
            None => network(name, dataset, sources),
        },
    }
}

/// Applies `describe` to every image in parallel and keeps the order.
fn each<T: Send>(
    images: &[PathBuf],
    sources: &Sources<'_>,
    describe: impl Fn(&Path) -> vpr_core::Result<T> + Sync,
) -> vpr_core::Result<Vec<T>> {
    let described: Vec<vpr_core::Result<T>> = images
        .par_iter()
        .map(|path| {
            let features = describe(path);
            sources.observer.step();
            features
        })
        .collect();
    described.into_iter().collect()
}

/// A network by name: its descriptors are kept in the cache, since they take long.
fn network(name: &str, dataset: &Dataset, sources: &Sources<'_>) -> Result<Described> {
    let method = Method::find(name, None)?;
    let dimension = method.dimension(None)?;
    if method.locate(dimension, &sources.roots.roots).is_none() {
        let why =
            format!("{name}: its weights are not at hand; origin: {}", method.origin(dimension));
        return Ok(Described::NotAtHand(why));
    }
    let encoder = encode::by_name(name, None, &sources.roots.roots)?;
    let of =
        |images: &[PathBuf]| rows(&*encoder, images, dataset, sources, Descriptors::normalized);
    let (queries, references) = (of(&dataset.queries)?, of(&dataset.references)?);
    let retrieval = retrieve(&queries, &references, RANKS)?;
    Ok(Described::As { encoder: name.to_owned(), retrieval, variances: None })
}

/// A network that predicts variances with its descriptors.
fn with_variances(learned: Learned, dataset: &Dataset, sources: &Sources<'_>) -> Result<Described> {
    let file = learned.weights();
    let Ok(path) = sources.roots.find(&file) else {
        let (name, key) = (learned.name(), learned.key());
        let why = format!(
            "{name}: its weights, {}, are not at hand; `sue train {key}` makes them",
            file.display()
        );
        return Ok(Described::NotAtHand(why));
    };
    let encoder = LearnedEncoder::open(learned, &path)?;
    let of = |images: &[PathBuf]| {
        // Descriptors have length one; the variances behind them stay as they are.
        encoder.split(&rows(&encoder, images, dataset, sources, |rows| rows)?)
    };
    let (queries, references) = (of(&dataset.queries)?, of(&dataset.references)?);
    let retrieval = retrieve(&queries.descriptors, &references.descriptors, RANKS)?;
    let variances = Some(queries.variances);
    Ok(Described::As { encoder: learned.name().to_owned(), retrieval, variances })
}

/// What a network gives for every image, finished; from the cache if it is there.
fn rows(
    encoder: &dyn Encoder,
    images: &[PathBuf],
    dataset: &Dataset,
    sources: &Sources<'_>,
    finish: impl FnOnce(Descriptors) -> Descriptors,
) -> Result<Descriptors> {
    let name = encoder.name();
    let digest = encoder.weights_digest().unwrap_or_default();
    let method = format!("descriptors 1 {name} {digest} {:?}", encoder.preprocessing());
    let file = format!("{}.safetensors", key(&method, &images.iter().collect::<Vec<_>>())?);
    let path = sources.cache.join("descriptors").join(file);
    let about = About {
        encoder: Some(name.to_owned()),
        weights_digest: encoder.weights_digest().map(str::to_owned),
        ..About::default()
    };
    cached(&path, &about, || {
        sources.observer.start(&format!("{name} on {}", dataset.name), images.len());
        let mut n_done = 0;
        let mut done = |upto: usize| {
            (n_done..upto).for_each(|_| sources.observer.step());
            n_done = upto;
        };
        let rows = encode::encode_files(encoder, images, &Options::default(), &mut done);
        sources.observer.end();
        Ok(finish(rows?))
    })
}

/// Descriptors from the cache, or made and kept there.
fn cached(
    path: &Path,
    about: &About,
    make: impl FnOnce() -> Result<Descriptors>,
) -> Result<Descriptors> {
    if let Ok(descriptors) =
        OpenMap::open(path, Opening::default()).and_then(|map| map.descriptors())
    {
        return Ok(descriptors);
    }
    let descriptors = make()?;
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(vpr_core::Error::io(folder))?;
    }
    let parts =
        Parts { descriptors: Some(descriptors.clone()), about: about.clone(), ..Parts::default() };
    parts.write_map(path, RowType::F32)?;
    Ok(descriptors)
}
