//! Recall@N of networks with several weights and projections.

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
use vpr_study::{Direction, Network, Runner, Sources, technique::Found};

use super::{Adapted, Encoder, Place, tuned::tuned_now};
use crate::{
    Result,
    net::{Finetuning, Material, Whitening, default_network, finetune, last, run_log, whiten},
};

/// For each rank, for each query that has a correct reference, whether one is among the best.
type Hits = Vec<Vec<bool>>;

pub(super) fn run(
    table: &mut Table,
    places: &[Place],
    (encoders, ranks): (&[Encoder], &[usize]),
    sources: &Sources<'_>,
) -> Result<()> {
    for place in places {
        let dataset = place.open(sources)?;
        let mut before: Vec<(&str, Hits)> = Vec::new();
        for encoder in encoders {
            let columns = ranks.iter().map(|rank| column(place, *rank, ranks.len()));
            let found = match &dataset {
                Err(why) => Err(why.clone()),
                Ok(dataset) => of_seeds(place, encoder, (dataset.as_ref(), ranks), sources)?,
            };
            let (Ok(dataset), Ok(runs)) = (&dataset, &found) else {
                let why = found.err().unwrap_or_default();
                columns.for_each(|it| table.push(Cell::absent(&encoder.name, it, &why)));
                continue;
            };
            let against = before.iter().find(|it| match &encoder.against {
                Some(name) => it.0 == name,
                None => true,
            });
            for (number, column) in columns.enumerate() {
                let of_rank: Vec<&[bool]> =
                    runs.iter().map(|hits| hits[number].as_slice()).collect();
                let cell = cell(encoder, column, &of_rank, dataset)?;
                table.push(match against {
                    Some((name, hits)) => {
                        cell.noted(difference((name, &hits[number]), &of_rank, &encoder.seeds)?)
                    }
                    None => cell,
                });
            }
            if let Some(first) = runs.first() {
                before.push((&encoder.name, first.clone()));
            }
        }
    }
    Ok(())
}

fn column(place: &Place, rank: usize, n_ranks: usize) -> String {
    if n_ranks == 1 { place.name.clone() } else { format!("{} R@{rank}", place.name) }
}

/// The mean over seeds, with the interval that one run with so many hits has.
fn cell(encoder: &Encoder, column: String, runs: &[&[bool]], dataset: &Dataset) -> Result<Cell> {
    let n_queries = runs.first().map_or(0, |hits| hits.len());
    let n_hits: usize = runs.iter().map(|hits| hits.iter().filter(|hit| **hit).count()).sum();
    let mean = (n_hits + runs.len() / 2) / runs.len().max(1);
    let interval = wilson_interval(mean, n_queries, Z_95)?;
    let value = match runs.len() {
        1 => interval.estimate,
        n => n_hits as f64 / (n * n_queries) as f64,
    };
    let cell = Cell::new(&encoder.name, column, value, dataset.provenance, n_queries);
    Ok(cell.within(interval.low, interval.high, "Wilson"))
}

/// What a reader must know of a cell beside that of another row.
fn difference((name, before): (&str, &[bool]), runs: &[&[bool]], seeds: &[u64]) -> Result<String> {
    let one = |after: &&[bool]| -> Result<(f64, Discordant)> {
        let counts = Discordant::count(after, before)?;
        let change = counts.first as f64 - counts.second as f64;
        Ok((100.0 * change / counts.n_queries as f64, counts))
    };
    let all: Vec<(f64, Discordant)> = runs.iter().map(one).collect::<Result<_>>()?;
    if let [(points, counts)] = all.as_slice() {
        let Discordant { first: gained, second: lost, .. } = counts;
        let p = counts.p_value(McNemar::MidP);
        return Ok(format!(
            "{points:+.1} points on {name}: {gained} queries gained, {lost} lost, McNemar mid-p {p:.2e}"
        ));
    }
    let mean = all.iter().map(|it| it.0).sum::<f64>() / all.len() as f64;
    let each = |(seed, (points, counts)): (&u64, &(f64, Discordant))| {
        format!("{seed}: {points:+.1} (p {:.2e})", counts.p_value(McNemar::MidP))
    };
    let each: Vec<String> = seeds.iter().zip(&all).map(each).collect();
    Ok(format!("{mean:+.1} points on {name}; by seed, with McNemar mid-p: {}", each.join(", ")))
}

/// What every seed finds; or why that cannot be said.
pub(super) fn of_seeds(
    place: &Place,
    encoder: &Encoder,
    (dataset, ranks): (&Dataset, &[usize]),
    sources: &Sources<'_>,
) -> Result<Result<Vec<Hits>, String>> {
    let seeds: Vec<Option<u64>> = match encoder.seeds.as_slice() {
        [] => vec![None],
        seeds => seeds.iter().copied().map(Some).collect(),
    };
    let mut runs = Vec::new();
    for seed in seeds {
        match runner(place, encoder, seed, sources)? {
            Err(why) => return Ok(Err(why)),
            Ok(runner) => runs.push(hits(&runner, (dataset, ranks), sources)?),
        }
    }
    Ok(Ok(runs))
}

fn hits(
    runner: &Runner,
    (dataset, ranks): (&Dataset, &[usize]),
    sources: &Sources<'_>,
) -> Result<Hits> {
    let scores = sources.scores(runner, dataset, Direction::AsReleased)?;
    let ranking = scores.ranking()?;
    let known = (0..dataset.truth.len()).filter(|&query| !dataset.truth.is_new_place(query));
    let is_hit = |query: usize, rank: usize| {
        let best = ranking.indices(query);
        best.iter().take(rank).any(|&reference| dataset.truth.is_correct(query, reference))
    };
    let of = |&rank: &usize| known.clone().map(|query| is_hit(query, rank)).collect();
    Ok(ranks.iter().map(of).collect())
}

/// The best reference of every query; or why that cannot be said.
fn best(
    place: &Place,
    encoder: &Encoder,
    dataset: &Dataset,
    sources: &Sources<'_>,
) -> Result<Result<Vec<usize>, String>> {
    let runner = match runner(place, encoder, None, sources)? {
        Err(why) => return Ok(Err(why)),
        Ok(runner) => runner,
    };
    let scores = sources.scores(&runner, dataset, Direction::AsReleased)?;
    let ranking = scores.ranking()?;
    let first = |query| ranking.indices(query).first().copied().unwrap_or(0);
    Ok(Ok((0..dataset.queries.len()).map(first).collect()))
}

/// [`best`] of the network before and after an adaptation.
pub(super) fn before_and_after(
    place: &Place,
    encoder: &Encoder,
    dataset: &Dataset,
    sources: &Sources<'_>,
) -> Result<Result<[Vec<usize>; 2], String>> {
    let before = best(place, &encoder.unadapted(), dataset, sources)?;
    let after = best(place, encoder, dataset, sources)?;
    Ok(before.and_then(|before| Ok([before, after?])))
}

/// The network with the weights or the projection of a row, as a technique.
fn runner(
    place: &Place,
    encoder: &Encoder,
    seed: Option<u64>,
    sources: &Sources<'_>,
) -> Result<Result<Runner, String>> {
    let is_default = encoder.method == "default";
    if !is_default && encoder.weights.is_none() && encoder.tuned.is_none() {
        return of_another(place, encoder, seed, sources);
    }
    if let Found::Absent(why) = sources.find(&encoder.method)? {
        return Ok(Err(why));
    }
    let path = match encoder.weights_for(place, seed) {
        None => adapted_now(place, encoder, seed, sources)?,
        Some(weights) => {
            let Some(path) = sources.locate(Path::new(&weights))? else {
                return Ok(Err(format!("{weights} is not at hand; `rsf train` makes it")));
            };
            Some(path)
        }
    };
    let network = by_name(&encoder.method, path.as_deref(), &sources.roots().roots)?;
    Ok(Ok(Runner {
        name: encoder.name.clone(),
        column: if is_default { "default network" } else { "network" },
        encoder: encoder.name.clone(),
        technique: Arc::new(Network::new(network.into())),
    }))
}

/// A network that is not the default one, under its own descriptors or a projection of them.
fn of_another(
    place: &Place,
    encoder: &Encoder,
    seed: Option<u64>,
    sources: &Sources<'_>,
) -> Result<Result<Runner, String>> {
    let runner = match sources.find(&encoder.method)? {
        Found::Absent(why) => return Ok(Err(why)),
        Found::Runs(runner) => runner,
    };
    let Some(whitening) = encoder.whitening(seed) else { return Ok(Ok(runner)) };
    let Some(set) = encoder.learned_from(place).references(sources)? else {
        return Ok(Err(format!("{}: no images at hand", place.name)));
    };
    let network = by_name(&encoder.method, None, &sources.roots().roots)?;
    let technique = Arc::new(Adapted::fit(network.into(), &whitening, &set)?);
    Ok(Ok(Runner { name: encoder.name.clone(), technique, ..runner }))
}

/// Weights of a row that is adapted while the table is made, in the cache; `None` for one that is
/// not.
pub(super) fn adapted_now(
    place: &Place,
    encoder: &Encoder,
    seed: Option<u64>,
    sources: &Sources<'_>,
) -> Result<Option<PathBuf>> {
    if encoder.tuned.is_none() && encoder.whitened.is_none() {
        return Ok(None);
    }
    let Some(set) = encoder.learned_from(place).references(sources)? else { return Ok(None) };
    let set = if encoder.without_poses { set.without_poses() } else { set };
    let settings = encoder
        .finetuning(seed)
        .map(|it| Finetuning { mining: it.mining.scaled(encoder.learned_from(place).scale), ..it });
    if encoder.method != "default" {
        return match settings {
            None => Ok(None),
            Some(settings) => Ok(Some(tuned_now(&encoder.method, &settings, &set, sources)?)),
        };
    }
    let material = Material::open(&set)?;
    let start = match &encoder.from {
        None => None,
        // What it begins with is adapted first.
        Some(whitening) => Some(whitened_now(&whitening.seeded(seed), &material, sources)?),
    };
    if let Some(whitening) = encoder.whitening(seed) {
        return Ok(Some(whitened_now(&whitening, &material, sources)?));
    }
    let Some(settings) = settings else { return Ok(None) };
    let (network, digest) = default_network(start.as_deref())?;
    let facts = settings.facts(&material, &digest);
    let folder = kept("rsf", &facts, sources);
    let path = folder.join("adapted.safetensors");
    if path.is_file() {
        return Ok(Some(path));
    }
    let mut run = Run::open(&folder, &facts, run_log(&folder.join("log.csv")))?;
    let tuned =
        finetune(&settings, network, (&set, &material), &mut run, &folder, |_, _, _| Ok(()))?;
    // A rate of zero is judged by what took the steps, not by what was kept.
    let network = if is_idle(&settings) { last(&settings, &folder)? } else { tuned.network };
    save(&network, &path, &facts, Precision::Single)?;
    Ok(Some(path))
}

fn is_idle(settings: &Finetuning) -> bool {
    settings.rate == 0.0
}

fn whitened_now(
    whitening: &Whitening,
    material: &Material,
    sources: &Sources<'_>,
) -> Result<PathBuf> {
    let (network, digest) = default_network(None)?;
    let facts = whitening.facts(material, &digest);
    let path = kept("rsf-projection", &facts, sources).with_extension("safetensors");
    if !path.is_file() {
        save(&whiten(whitening, network, material)?, &path, &facts, Precision::Single)?;
    }
    Ok(path)
}

/// Where an adaptation with these facts is kept.
fn kept(kind: &str, facts: &[(&str, String)], sources: &Sources<'_>) -> PathBuf {
    let digest = BlockDigest::of(format!("{facts:?}").as_bytes()).to_hex();
    sources.cache().join(format!("{kind}-{digest}"))
}
