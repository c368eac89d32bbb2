//! `rsf finetune`: weights for a map, and whether they are better before a query is seen.

use std::path::{Path, PathBuf};

use anyhow::ensure;
use rsf::{
    MiningParams, Preset,
    net::{
        Finetuning, Material, Outcome as Tuned, Score, Whitening, default_network, finetune,
        run_log, whiten,
    },
};
use vpr_nets::{
    train::Run,
    weights::{Precision, save},
};
use vpr_report::cli::{self, Outcome};

use super::map::MapArgs;

/// Map, settings and output.
#[derive(clap::Args)]
pub(crate) struct FinetuneArgs {
    #[command(flatten)]
    map: MapArgs,
    /// The network; `default` is the one that can be tuned here
    #[arg(long, default_value = "default", value_name = "NAME")]
    method: String,
    /// Weights to begin with, instead of those that every clone has
    #[arg(long, value_name = "FILE")]
    weights: Option<PathBuf>,
    /// The weights to write, for `--weights` of other programs; the log lands beside them
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Write half as many bits
    #[arg(long)]
    half: bool,
    /// Folder of checkpoints [default: target/rsf-<name of the output>]
    #[arg(long, value_name = "DIR")]
    checkpoints: Option<PathBuf>,
    /// Only fit another projection in closed form: seconds, and the trunk stays
    #[arg(long, conflicts_with_all = ["steps", "rate", "margin", "batch", "frozen"])]
    whitening: bool,
    /// How queries are made of references
    #[arg(long, value_enum, default_value_t, value_name = "NAME")]
    augmentations: Preset,
    /// Most steps
    #[arg(long, default_value_t = Finetuning::default().steps)]
    steps: usize,
    /// Steps between two minings and validations
    #[arg(long, default_value_t = Finetuning::default().round)]
    round: usize,
    /// Rounds without a gain on held-out references after which it ends
    #[arg(long, default_value_t = Finetuning::default().patience)]
    patience: usize,
    /// Triplets in a step
    #[arg(long, default_value_t = Finetuning::default().batch)]
    batch: usize,
    /// Learning rate
    #[arg(long, default_value_t = Finetuning::default().rate)]
    rate: f64,
    /// Margin of the triplet loss
    #[arg(long, default_value_t = Finetuning::default().margin)]
    margin: f64,
    /// A reference up to this far from another shows the same place, metres
    #[arg(long, default_value_t = MiningParams::default().positive_m, value_name = "M")]
    positive_m: f64,
    /// A reference from this far shows another place, metres
    #[arg(long, default_value_t = MiningParams::default().negative_m, value_name = "M")]
    negative_m: f64,
    /// Hard negatives are drawn from so many that look most alike
    #[arg(long, default_value_t = MiningParams::default().hardest, value_name = "N")]
    hardest: usize,
    /// Parts of the network that stay, such as `trunk.stem`
    #[arg(long, value_name = "PART", num_args = 1.., value_delimiter = ',')]
    frozen: Vec<String>,
    /// Share of references that are held out to say when it is best
    #[arg(long, default_value_t = Finetuning::default().held_out)]
    held_out: f64,
    /// Decides what is held out, drawn and changed
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

pub(crate) fn run(args: &FinetuneArgs) -> anyhow::Result<Outcome> {
    ensure!(args.method == "default", "`{}`: only `default` can be tuned here", args.method);
    let settings = args.settings();
    settings.check()?;
    let (set, name) = args.map.open()?;
    let material = Material::open(&set)?;
    let (network, digest) = default_network(args.weights.as_deref())?;
    let precision = if args.half { Precision::Half } else { Precision::Single };
    if args.whitening {
        let Finetuning { augmentations, seed, .. } = settings;
        let whitening = Whitening { augmentations, seed, ..Whitening::default() };
        let fitted = whiten(&whitening, network, &material)?;
        let facts = [
            ("whitened_from", digest),
            ("references", format!("{}, digest {}", material.len(), material.digest())),
            ("variants", format!("{}, {}", whitening.variants, augmentations.key())),
            ("seed", seed.to_string()),
            ("licence", "MIT OR Apache-2.0".to_owned()),
        ];
        save(&fitted, &args.output, &facts, precision)?;
        cli::note(&format!("{name}: whitened, {}", args.output.display()));
        return Ok(Outcome::Success);
    }
    let stem = args.output.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let folder = args.checkpoints.clone();
    let folder = folder.unwrap_or_else(|| Path::new("target").join(format!("rsf-{stem}")));
    let mut facts = settings.facts(&material, &digest);
    let mut run = Run::open(&folder, &facts, run_log(&args.output.with_extension("log.csv")))?;
    let tuned = finetune(&settings, network, (&set, &material), &mut run, &folder, show)?;
    facts.push(("best", format!("step {}, {}", tuned.best_step, told(tuned.best))));
    save(&tuned.network, &args.output, &facts, precision)?;
    cli::note(&verdict(&tuned));
    cli::note(&format!("{name}: {}", args.output.display()));
    Ok(Outcome::Success)
}

impl FinetuneArgs {
    fn settings(&self) -> Finetuning {
        Finetuning {
            steps: self.steps,
            round: self.round,
            patience: self.patience,
            batch: self.batch,
            rate: self.rate,
            margin: self.margin,
            mining: MiningParams {
                positive_m: self.positive_m,
                negative_m: self.negative_m,
                hardest: self.hardest,
            },
            augmentations: self.augmentations,
            held_out: self.held_out,
            frozen: self.frozen.clone(),
            seed: self.seed,
            ..Finetuning::default()
        }
    }
}

fn told(score: Score) -> String {
    format!("R@1 {:.3} of {} held-out variants, gap {:.4}", score.recall, score.n, score.gap)
}

/// Whether the map itself says that it was worth it.
fn verdict(tuned: &Tuned) -> String {
    let Tuned { best_step, best, before, .. } = tuned;
    if *best_step == 0 {
        return "no round was better on held-out references: the weights are those it began with"
            .to_owned();
    }
    format!("before: {}\nstep {best_step}: {}", told(*before), told(*best))
}

#[expect(clippy::unnecessary_wraps, reason = "what fine-tuning calls")]
fn show(step: usize, loss: f64, score: Score) -> vpr_core::Result<()> {
    // Before the first step there is no loss.
    let loss = if step == 0 { String::new() } else { format!("loss {loss:.4}, ") };
    cli::note(&format!("step {step}: {loss}{}", told(score)));
    Ok(())
}
