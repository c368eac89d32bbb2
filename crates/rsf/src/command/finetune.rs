//! `rsf finetune`: weights for a map, and whether they are better before a query is seen.

use std::path::PathBuf;

use anyhow::ensure;
use rsf::{
    MiningParams, Preset,
    net::{Finetuning, Parts, Whitening},
};
use vpr_nets::weights::Precision;
use vpr_report::cli::{Outcome, ReportArgs};

use super::{adaptation::Adaptation, map::MapArgs};

/// Map, settings and output.
#[derive(clap::Args)]
pub(crate) struct FinetuneArgs {
    #[command(flatten)]
    map: MapArgs,
    /// The network: `default`, `boq-default`, `salad-default`, or another whose weights are at hand or
    /// given
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
    /// Only fit another projection in closed form, beside the old one: seconds, and the trunk stays
    #[arg(long, conflicts_with_all = ["steps", "rate", "margin", "batch", "parts", "rank", "frozen"])]
    whitening: bool,
    /// Share of the old projection that --whitening keeps, from 0 to below 1
    #[arg(long, default_value_t = Whitening::default().prior, requires = "whitening")]
    prior: f64,
    /// How queries are made of references
    #[arg(long, value_enum, default_value_t, value_name = "NAME")]
    augmentations: Preset,
    /// Most steps [default: about five passes over the references]
    #[arg(long)]
    steps: Option<usize>,
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
    /// What of the network learns
    #[arg(long, value_enum, default_value_t, value_name = "NAME")]
    parts: Parts,
    /// Rank of the updates of `--parts low-rank`
    #[arg(long, default_value_t = Finetuning::default().rank, value_name = "N")]
    rank: usize,
    /// Parts of the network that stay besides, such as `trunk.stem`
    #[arg(long, value_name = "PART", num_args = 1.., value_delimiter = ',')]
    frozen: Vec<String>,
    /// Share of references that are held out to say when it is best
    #[arg(long, default_value_t = Finetuning::default().held_out)]
    held_out: f64,
    /// Decides what is held out, drawn and changed
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    report: ReportArgs,
}

pub(crate) fn run(args: &FinetuneArgs) -> anyhow::Result<Outcome> {
    let is_default = args.method == "default";
    ensure!(is_default || !args.whitening, "--whitening is for the default network alone");
    let mut settings = args.settings();
    settings.check()?;
    args.report.check()?;
    let (set, name) = args.map.open()?;
    settings.steps = args.steps.unwrap_or_else(|| settings.steps_for(set.len()));
    let adaptation = Adaptation {
        name: &name,
        set: &set,
        method: &args.method,
        roots: &args.map.data.folders(),
        weights: args.weights.as_deref(),
        output: &args.output,
        checkpoints: args.checkpoints.as_deref(),
        precision: if args.half { Precision::Half } else { Precision::Single },
        report: Some(&args.report),
    };
    if args.whitening {
        let Finetuning { augmentations, seed, .. } = settings;
        let prior = args.prior;
        adaptation.whiten(&Whitening { augmentations, seed, prior, ..Whitening::default() })?;
    } else {
        adaptation.finetune(&settings)?;
    }
    Ok(Outcome::Success)
}

impl FinetuneArgs {
    fn settings(&self) -> Finetuning {
        Finetuning {
            steps: self.steps.unwrap_or(self.round),
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
            parts: self.parts,
            rank: self.rank,
            frozen: self.frozen.clone(),
            seed: self.seed,
            ..Finetuning::default()
        }
    }
}
