//! `rsf gap`: how far a map is from the training domain, and whether tuning may pay.

use std::path::PathBuf;

use anyhow::bail;
use rsf::{
    MiningParams, Preset,
    net::{Material, Trial, default_network},
    study::{gap, references},
};
use vpr_report::cli::{self, Bar, Outcome};
use vpr_study::Sources;

use super::map::MapArgs;

/// References of the map that are looked up under augmentations, at most.
const TRIED: usize = 200;
/// Variants of each.
const VARIANTS: usize = 2;

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
}

pub(crate) fn run(args: &GapArgs) -> anyhow::Result<Outcome> {
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
    let step = map.len().div_ceil(TRIED).max(1);
    let rows: Vec<usize> = (0..map.len()).step_by(step).collect();
    for preset in [Preset::Viewpoint, Preset::Appearance, Preset::All] {
        let mining = MiningParams::default();
        let trial =
            Trial::new(&map, &rows, VARIANTS, &preset.augmentations(), (&mining, args.seed))?;
        let score = trial.score(&network, &of_map)?;
        let (key, recall, n) = (preset.key(), score.recall, score.n);
        cli::print(&format!("R@1 of its own references, {key} changed\t{recall:.3} of {n}\n"))?;
    }
    Ok(Outcome::Success)
}
