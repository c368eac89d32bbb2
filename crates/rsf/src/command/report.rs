//! The report of `rsf gap` and `rsf finetune`: references under augmentations, looked up among all
//! references. No query is in it, for none is known.

use std::path::PathBuf;

use rsf::{
    MiningParams, Preset, ReferenceSet,
    net::{Material, Trial},
};
use vpr_core::{GroundTruth, retrieve};
use vpr_nets::model::Tunable;
use vpr_report::{
    cli::{self, ReportArgs},
    report::{Dataset, Match, Report, Run, Side},
};
use vpr_study::thumbnails;

/// Matches per variant that a report keeps.
const RANKS: usize = 20;
/// References that are looked up, at most.
const TRIED: usize = 200;
/// Variants of each.
const VARIANTS: usize = 2;

/// Some references of a map under augmentations.
pub(super) fn trial(material: &Material, preset: Preset, seed: u64) -> rsf::Result<Trial> {
    let step = material.len().div_ceil(TRIED).max(1);
    let rows: Vec<usize> = (0..material.len()).step_by(step).collect();
    let mining = MiningParams::default();
    Trial::new(material, &rows, VARIANTS, &preset.augmentations(), (&mining, seed))
}

/// Writes the report that the flags ask for: what each network finds of each trial.
pub(super) fn write<N: Tunable>(
    args: &ReportArgs,
    (title, set, material): (&str, &ReferenceSet, &Material),
    trials: &[(Preset, Trial)],
    networks: &[(&str, &N)],
) -> anyhow::Result<()> {
    if args.path.is_none() {
        return Ok(());
    }
    let names = |paths: &[PathBuf]| -> Vec<String> {
        let name = |it: &PathBuf| it.file_name().unwrap_or_default().to_string_lossy().into_owned();
        paths.iter().map(name).collect()
    };
    let references = names(set.images());
    let truths: Vec<GroundTruth> = trials
        .iter()
        .map(|(_, trial)| GroundTruth::from_lists(trial.correct().to_vec(), material.len()))
        .collect::<Result<_, _>>()?;
    let shown = thumbnails(&[], set.images());
    // Variants are not files: only what they are looked up among has pictures.
    let pictures = |asked: &[(Side, usize)], longest: u32| {
        let one = |&(side, index): &(Side, usize)| match side {
            Side::Query => Err("drawn for this trial, not kept".to_owned()),
            Side::Reference => {
                let mut one = shown(&[(side, index)], longest);
                one.pop().unwrap_or_else(|| Err("no picture".to_owned()))
            }
        };
        asked.iter().map(one).collect()
    };
    let mut runs = Vec::new();
    for (dataset, (_, trial)) in trials.iter().enumerate() {
        for &(name, network) in networks {
            runs.push(run(name, dataset, (trial, material), network)?);
        }
    }
    let datasets = trials.iter().zip(&truths).map(|((preset, trial), truth)| {
        let variant = |(number, of): (usize, &usize)| {
            format!("{}, variant {}", references[*of], number % VARIANTS + 1)
        };
        Dataset {
            name: format!("references, {} changed", preset.key()),
            queries: trial.of().iter().enumerate().map(variant).collect(),
            references: references.clone(),
            poses: None,
            truth: Some(truth),
            thumbnails: Some(&pictures),
            similarities: None,
        }
    });
    args.write(&Report {
        title: title.to_owned(),
        facts: vec![
            ("command".to_owned(), cli::command_line()),
            ("program".to_owned(), format!("rsf {}", env!("CARGO_PKG_VERSION"))),
            ("queries".to_owned(), "none: what is looked up are changed references".to_owned()),
        ],
        datasets: datasets.collect(),
        runs,
        budget: args.budget(),
    })
}

/// What a network finds of a trial.
fn run<N: Tunable>(
    name: &str,
    dataset: usize,
    (trial, material): (&Trial, &Material),
    network: &N,
) -> anyhow::Result<Run> {
    let found = retrieve(&trial.describe(network)?, &material.describe(network)?, RANKS)?;
    let matches = |query: usize| {
        let ranked = found.indices(query).into_iter().zip(found.distances(query));
        let one = |(&reference, &distance)| Match {
            reference,
            distance: f64::from(distance),
            inliers: None,
        };
        ranked.map(one).collect()
    };
    let matches = (0..found.len()).map(matches).collect();
    Ok(Run { name: name.to_owned(), dataset, matches, ..Run::default() })
}
