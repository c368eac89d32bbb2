//! One network is adapted to one map, and its weights are written.

use std::path::{Path, PathBuf};

use rsf::{
    Preset, ReferenceSet,
    net::{
        Finetuning, Material, Outcome, Score, Whitening, default_network, finetune, run_log, whiten,
    },
};
use vpr_nets::{
    encode::{Start, Task, tune},
    model::Tunable,
    train::{Run, device},
    weights::{Precision, save},
};
use vpr_report::cli::{self, ReportArgs};

use super::report;

/// Which map, from which weights, into which file.
pub(crate) struct Adaptation<'a> {
    /// What the map is called.
    pub(crate) name: &'a str,
    /// The map.
    pub(crate) set: &'a ReferenceSet,
    /// The network.
    pub(crate) method: &'a str,
    /// Data folders, which weights are looked for in.
    pub(crate) roots: &'a [PathBuf],
    /// Weights to begin with, instead of those that every clone has.
    pub(crate) weights: Option<&'a Path>,
    /// The weights to write; the log lands beside them.
    pub(crate) output: &'a Path,
    /// Folder of checkpoints, instead of one in `target`.
    pub(crate) checkpoints: Option<&'a Path>,
    /// Bits of a number.
    pub(crate) precision: Precision,
    /// A report of references under augmentations, before and after.
    pub(crate) report: Option<&'a ReportArgs>,
}

impl Adaptation<'_> {
    /// Another projection in closed form.
    pub(crate) fn whiten(&self, whitening: &Whitening) -> anyhow::Result<()> {
        let material = Material::open(self.set)?;
        let (network, digest) = default_network(self.weights)?;
        let fitted = whiten(whitening, network.clone(), &material)?;
        let facts = whitening.facts(&material, &digest);
        save(&fitted, self.output, &facts, self.precision)?;
        cli::note(&format!("{}: whitened, {}", self.name, self.output.display()));
        self.show(&material, (&network, &fitted), whitening.seed)
    }

    /// Steps under the triplet loss; goes on where a killed run stopped.
    pub(crate) fn finetune(&self, settings: &Finetuning) -> anyhow::Result<()> {
        let steps = Steps { adaptation: self, settings };
        tune(self.method, self.weights, self.roots, &device(), steps)?
    }

    fn take_steps<N: Tunable>(
        &self,
        settings: &Finetuning,
        network: N,
        start: Start,
    ) -> anyhow::Result<()> {
        let Start { preprocessing, size, digest } = start;
        let material = Material::open_for(self.set, preprocessing, size)?;
        let stem = self.output.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let usual = Path::new("target").join(format!("rsf-{stem}"));
        let folder = self.checkpoints.unwrap_or(&usual);
        let mut facts = settings.facts(&material, &digest);
        let log = run_log(&self.output.with_extension("log.csv"));
        let mut run = Run::open(folder, &facts, log)?;
        let tuned =
            finetune(settings, network.clone(), (self.set, &material), &mut run, folder, show)?;
        facts.push(("best", format!("{}, {}", place(&tuned), told(tuned.best))));
        tuned.network.write(self.output, &facts, self.precision)?;
        cli::note(&verdict(&tuned));
        cli::note(&format!("{}: {}", self.name, self.output.display()));
        self.show(&material, (&network, &tuned.network), settings.seed)
    }

    /// What it did to references that are changed, as a line for people and as a report.
    fn show<N: Tunable>(
        &self,
        material: &Material,
        (before, after): (&N, &N),
        seed: u64,
    ) -> anyhow::Result<()> {
        let Some(args) = self.report else { return Ok(()) };
        let trial = report::trial(material, Preset::All, seed)?;
        let recall = |network: &N| -> rsf::Result<f64> {
            Ok(trial.score(network, &material.describe(network)?)?.recall)
        };
        let (of_before, of_after) = (recall(before)?, recall(after)?);
        let n = trial.of().len();
        cli::note(&format!(
            "R@1 of {n} changed references among all: before {of_before:.3}, after {of_after:.3}"
        ));
        let networks = [("before", before), ("after", after)];
        let title = format!("Adapted to {}", self.name);
        let trials = [(Preset::All, trial)];
        report::write(args, (&title, self.set, material), &trials, &networks)
    }
}

/// Fine-tuning of whichever network.
struct Steps<'a> {
    adaptation: &'a Adaptation<'a>,
    settings: &'a Finetuning,
}

impl Task for Steps<'_> {
    type Output = anyhow::Result<()>;

    fn with<N: Tunable>(self, network: N, start: Start) -> Self::Output {
        self.adaptation.take_steps(self.settings, network, start)
    }
}

/// Which network it was.
fn place<N>(tuned: &Outcome<N>) -> String {
    format!("step {}, {} of the way", tuned.best_step, tuned.share)
}

fn told(score: Score) -> String {
    format!("R@1 {:.3} of {} held-out variants, gap {:.4}", score.recall, score.n, score.gap)
}

/// Whether the map itself says that it was worth it.
fn verdict<N>(tuned: &Outcome<N>) -> String {
    let Outcome { best_step, best, before, .. } = tuned;
    if *best_step == 0 {
        return "no round was better on held-out references: the weights are those it began with"
            .to_owned();
    }
    format!("before: {}\n{}: {}", told(*before), place(tuned), told(*best))
}

#[expect(clippy::unnecessary_wraps, reason = "what fine-tuning calls")]
fn show(step: usize, loss: f64, score: Score) -> vpr_core::Result<()> {
    // Before the first step there is no loss.
    let loss = if step == 0 { String::new() } else { format!("loss {loss:.4}, ") };
    cli::note(&format!("step {step}: {loss}{}", told(score)));
    Ok(())
}
