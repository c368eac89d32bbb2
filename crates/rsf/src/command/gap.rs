//! `rsf gap`: how far a map is from the training domain, and whether tuning may pay.

use std::path::PathBuf;

use anyhow::bail;
use rsf::{
    Preset,
    net::{Material, default_network},
    study::{gap, references},
};
use vpr_report::cli::{self, Bar, Outcome, ReportArgs};
use vpr_study::Sources;

use super::{map::MapArgs, report};

/// A map, weights, and what they were trained on.
#[derive(clap::Args)]
pub(crate) struct GapArgs {
    #[command(flatten)]
    map: MapArgs,
    /// Weights of the default network, instead of those that every clone has
    #[arg(long, value_name = "FILE")]
    weights: Option<PathBuf>,
    /// Whose references stand for the training domain
    #[arg(
        long,
        default_value = "world/train-city?camera.width=160&camera.height=120&camera.focal=115.0",
        value_name = "NAME"
    )]
    training: String,
    /// Decides the augmentations
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    report: ReportArgs,
}

pub(crate) fn run(args: &GapArgs) -> anyhow::Result<Outcome> {
    args.report.check()?;
    let (set, name) = args.map.open()?;
    let bar = Bar::default();
    let (folders, cache) = (args.map.data.folders(), args.map.data.cache());
    let sources = Sources::new(folders.iter().map(PathBuf::as_path), &cache, &bar);
    let Some(domain) = references(&sources, &args.training)? else {
        bail!(sources.why_absent(&args.training, "images")?)
    };
    let (network, _) = default_network(args.weights.as_deref())?;
    let (map, domain) = (Material::open(&set)?, Material::open(&domain)?);
    let (of_map, of_domain) = (map.describe(&network)?, domain.describe(&network)?);
    let apart = gap(&of_map, &of_domain)?;
    cli::print(&format!("map\t{name}\nFréchet distance\t{:.4}\n", apart.frechet))?;
    cli::print(&format!("share of own neighbours\t{:.3}\n", apart.own_neighbours))?;
    let mut trials = Vec::new();
    for preset in [Preset::Viewpoint, Preset::Appearance, Preset::All] {
        let trial = report::trial(&map, preset, args.seed)?;
        let score = trial.score(&network, &of_map)?;
        let (key, recall, n) = (preset.key(), score.recall, score.n);
        cli::print(&format!("R@1 of its own references, {key} changed\t{recall:.3} of {n}\n"))?;
        trials.push((preset, trial));
    }
    let title = format!("Gap of {name}");
    report::write(&args.report, (&title, &set, &map), &trials, &[("default network", &network)])?;
    Ok(Outcome::Success)
}
