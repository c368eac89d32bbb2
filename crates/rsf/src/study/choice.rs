//! How much of the old projection is kept, and which ridge: every pair on places that no table has.

use std::path::PathBuf;

use ndarray::Array2;
use rayon::prelude::*;
use vpr_core::{Descriptors, Provenance, retrieve};
use vpr_nets::{
    encode::registry::Method,
    model::default::{DefaultEncoder, INPUT},
    train::Affine,
};
use vpr_report::table::{Cell, Table};
use vpr_study::Sources;

use super::Place;
use crate::{
    Result,
    net::{Material, Whitening, default_network, pooled_features, projected, projection},
};

/// Images that are described at a time.
const BATCH: usize = 32;
/// Column of the mean over places.
const MEAN: &str = "mean";
/// Row of the projection that the network has.
const BEFORE: &str = "old projection";
/// Row of the pair with the highest mean.
const CHOSEN: &str = "chosen";

/// A place as far as projections see it.
struct Seen {
    /// What the projection is fitted on, and which reference each row shows.
    features: Array2<f32>,
    places: Vec<usize>,
    references: Array2<f32>,
    queries: Array2<f32>,
}

pub(super) fn run(
    table: &mut Table,
    places: &[Place],
    (priors, ridges): (&[f64], &[f64]),
    sources: &Sources<'_>,
) -> Result<()> {
    let (network, _) = default_network(None)?;
    let before = projection(&network)?;
    let pairs: Vec<Whitening> = ridges
        .iter()
        .flat_map(|&ridge| {
            priors.iter().map(move |&prior| Whitening { prior, ridge, ..Whitening::default() })
        })
        .collect();
    let (mut recalls, mut old) = (vec![Vec::new(); pairs.len()], Vec::new());
    let mut origin = Provenance::Generated;
    for place in places {
        let dataset = match place.open(sources)? {
            Ok(dataset) => dataset,
            Err(why) => {
                for row in pairs.iter().map(row).chain([BEFORE.to_owned()]) {
                    table.push(Cell::absent(row, &place.name, &why));
                }
                continue;
            }
        };
        let Some(set) = place.references(sources)? else { continue };
        let material = Material::open(&set)?;
        let (features, of) = pooled_features(&Whitening::default(), &network, &material)?;
        origin = dataset.provenance;
        let seen = Seen {
            features,
            places: of,
            references: pooled(&network, &dataset.references)?,
            queries: pooled(&network, &dataset.queries)?,
        };
        let n = dataset.truth.n_known();
        let recall = |found: Vec<usize>| {
            let known = (0..found.len()).filter(|&query| !dataset.truth.is_new_place(query));
            let hits = known.filter(|&it| dataset.truth.is_correct(it, found[it])).count();
            hits as f64 / n.max(1) as f64
        };
        let of_old = recall(seen.best(&before)?);
        old.push(of_old);
        table.push(Cell::new(BEFORE, &place.name, of_old, origin, n));
        let found: Vec<Result<Vec<usize>>> =
            pairs.par_iter().map(|pair| seen.best(&seen.fitted(pair, &before)?)).collect();
        for ((pair, found), recalls) in pairs.iter().zip(found).zip(&mut recalls) {
            let recall = recall(found?);
            recalls.push(recall);
            table.push(Cell::new(row(pair), &place.name, recall, origin, n));
        }
    }
    if old.len() == places.len() {
        chosen(table, &pairs, (&recalls, &old), origin);
    }
    Ok(())
}

/// Means over places, and the pair with the highest.
fn chosen(
    table: &mut Table,
    pairs: &[Whitening],
    (recalls, old): (&[Vec<f64>], &[f64]),
    origin: Provenance,
) {
    let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len().max(1) as f64;
    table.push(Cell::new(BEFORE, MEAN, mean(old), origin, old.len()));
    let means: Vec<f64> = recalls.iter().map(|it| mean(it)).collect();
    for (pair, mean) in pairs.iter().zip(&means) {
        table.push(Cell::new(row(pair), MEAN, *mean, origin, old.len()));
    }
    // Ties stay with the earlier pair.
    let first = |best: usize, it: usize| if means[it] > means[best] { it } else { best };
    if let Some(best) = (0..means.len()).reduce(first) {
        let pair = pairs[best];
        for (column, value) in [("prior", pair.prior), ("ridge", pair.ridge)] {
            table.push(Cell::new(CHOSEN, column, value, origin, pairs.len()));
        }
    }
}

fn row(pair: &Whitening) -> String {
    format!("prior {}, ridge {}", pair.prior, pair.ridge)
}

impl Seen {
    fn fitted(&self, settings: &Whitening, before: &Affine) -> Result<Affine> {
        settings.fit(self.features.view(), &self.places, before)
    }

    /// The best reference of every query under a projection.
    fn best(&self, fitted: &Affine) -> Result<Vec<usize>> {
        let rows = |features: &Array2<f32>| -> Result<Descriptors> {
            Ok(Descriptors::new(projected(fitted, features.view()))?.normalized())
        };
        let found = retrieve(&rows(&self.queries)?, &rows(&self.references)?, 1)?;
        let first = |query| found.indices(query).first().copied().unwrap_or(0);
        Ok((0..found.len()).map(first).collect())
    }
}

/// What the trunk makes of image files.
fn pooled(network: &DefaultEncoder, images: &[PathBuf]) -> Result<Array2<f32>> {
    let preprocessing = Method::find("default", None)?.preprocessing();
    let input = |path: &PathBuf| -> Result<Vec<f32>> {
        Ok(preprocessing.apply(&vpr_vision::image::decode(path)?)?.0)
    };
    let inputs: Vec<Result<Vec<f32>>> = images.par_iter().map(input).collect();
    let inputs = inputs.into_iter().collect::<Result<Vec<_>>>()?.concat();
    Ok(network.pooled(&inputs, INPUT, BATCH)?)
}
