//! Recall@N of the default network with several weights.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use vpr_core::{
    map::BlockDigest,
    metrics::{
        Discordant, McNemar,
        bootstrap::{Z_95, wilson_interval},
    },
};
use vpr_data::Dataset;
use vpr_nets::{
    encode::by_name,
    train::Run,
    weights::{Precision, save},
};
use vpr_report::table::{Cell, Table};
use vpr_study::{Direction, Network, Runner, Sources};

use super::{Encoder, Place, references};
use crate::{
    Result,
    net::{Material, default_network, finetune, last, run_log},
};

pub(super) fn run(
    table: &mut Table,
    places: &[Place],
    (encoders, ranks): (&[Encoder], &[usize]),
    sources: &Sources<'_>,
) -> Result<()> {
    for place in places {
        let dataset = sources.images(&place.dataset)?;
        let mut baseline: Option<Vec<Vec<bool>>> = None;
        for encoder in encoders {
            let columns = ranks.iter().map(|rank| column(place, *rank, ranks.len()));
            let found = match &dataset {
                None => Err(sources.why_absent(&place.dataset, "images")?),
                Some(dataset) => hits(place, encoder, (dataset.as_ref(), ranks), sources)?,
            };
            let (Some(dataset), Ok(found)) = (&dataset, &found) else {
                let why = found.err().unwrap_or_default();
                columns.for_each(|it| table.push(Cell::absent(&encoder.name, it, &why)));
                continue;
            };
            for (number, (column, hits)) in columns.zip(found).enumerate() {
                let n_hits = hits.iter().filter(|hit| **hit).count();
                let interval = wilson_interval(n_hits, hits.len(), Z_95)?;
                let cell = Cell::new(
                    &encoder.name,
                    column,
                    interval.estimate,
                    dataset.provenance,
                    hits.len(),
                );
                let cell = cell.within(interval.low, interval.high, "Wilson");
                table.push(match &baseline {
                    Some(before) => cell.noted(difference(&before[number], hits, encoders)?),
                    None => cell,
                });
            }
            if baseline.is_none() {
                baseline = Some(found.clone());
            }
        }
    }
    Ok(())
}

fn column(place: &Place, rank: usize, n_ranks: usize) -> String {
    if n_ranks == 1 { place.name.clone() } else { format!("{} R@{rank}", place.name) }
}

/// What a reader must know of a cell beside that of the first encoder.
fn difference(before: &[bool], after: &[bool], encoders: &[Encoder]) -> Result<String> {
    let counts = Discordant::count(after, before)?;
    let Discordant { n_queries, first: gained, second: lost } = counts;
    let points = 100.0 * (gained as f64 - lost as f64) / n_queries as f64;
    let p = counts.p_value(McNemar::MidP);
    let name = encoders.first().map_or("", |it| it.name.as_str());
    Ok(format!(
        "{points:+.1} points on {name}: {gained} queries gained, {lost} lost, McNemar mid-p {p:.2e}"
    ))
}

/// For each rank, for each query that has a correct reference, whether one is among the best; or why
/// that cannot be said.
fn hits(
    place: &Place,
    encoder: &Encoder,
    (dataset, ranks): (&Dataset, &[usize]),
    sources: &Sources<'_>,
) -> Result<Result<Vec<Vec<bool>>, String>> {
    let runner = match adapted(place, encoder, sources)? {
        Ok(runner) => runner,
        Err(why) => return Ok(Err(why)),
    };
    let scores = sources.scores(&runner, dataset, Direction::AsReleased)?;
    let ranking = scores.ranking()?;
    let known = (0..dataset.truth.len()).filter(|&query| !dataset.truth.is_new_place(query));
    let is_hit = |query: usize, rank: usize| {
        let best = ranking.indices(query);
        best.iter().take(rank).any(|&reference| dataset.truth.is_correct(query, reference))
    };
    let of = |&rank: &usize| known.clone().map(|query| is_hit(query, rank)).collect();
    Ok(Ok(ranks.iter().map(of).collect()))
}

/// The default network with the weights of a row, as a technique.
fn adapted(
    place: &Place,
    encoder: &Encoder,
    sources: &Sources<'_>,
) -> Result<Result<Runner, String>> {
    let path = match encoder.weights_for(place) {
        None => tuned_now(place, encoder, sources)?,
        Some(weights) => {
            let Some(path) = sources.locate(Path::new(&weights))? else {
                return Ok(Err(format!("{weights} is not at hand; `rsf train` makes it")));
            };
            Some(path)
        }
    };
    let network = by_name("default", path.as_deref(), &sources.roots().roots)?;
    Ok(Ok(Runner {
        name: encoder.name.clone(),
        column: "default network",
        encoder: encoder.name.clone(),
        technique: Arc::new(Network::new(network.into())),
    }))
}

/// Weights after the last step of a row that is tuned while the table is made, in the cache; `None`
/// for one that is not.
fn tuned_now(place: &Place, encoder: &Encoder, sources: &Sources<'_>) -> Result<Option<PathBuf>> {
    let Some(settings) = &encoder.tuned else { return Ok(None) };
    let Some(set) = references(sources, &place.dataset)? else { return Ok(None) };
    let material = Material::open(&set)?;
    let (network, digest) = default_network(None)?;
    let facts = settings.facts(&material, &digest);
    let name = format!("rsf-{}", BlockDigest::of(format!("{facts:?}").as_bytes()).to_hex());
    let folder = sources.cache().join(name);
    let mut run = Run::open(&folder, &facts, run_log(&folder.join("log.csv")))?;
    finetune(settings, network, (&set, &material), &mut run, &folder, |_, _, _| Ok(()))?;
    let path = folder.join("last.safetensors");
    save(&last(settings, &folder)?, &path, &facts, Precision::Single)?;
    Ok(Some(path))
}
