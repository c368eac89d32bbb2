//! One network is adapted to one map, and its weights are written.

use std::path::Path;

use rsf::{
    ReferenceSet,
    net::{
        Finetuning, Material, Outcome, Score, Whitening, default_network, finetune, run_log, whiten,
    },
};
use vpr_nets::{
    train::Run,
    weights::{Precision, save},
};
use vpr_report::cli;

/// Which map, from which weights, into which file.
pub(crate) struct Adaptation<'a> {
    /// What the map is called.
    pub(crate) name: &'a str,
    /// The map.
    pub(crate) set: &'a ReferenceSet,
    /// Weights to begin with, instead of those that every clone has.
    pub(crate) weights: Option<&'a Path>,
    /// The weights to write; the log lands beside them.
    pub(crate) output: &'a Path,
    /// Folder of checkpoints, instead of one in `target`.
    pub(crate) checkpoints: Option<&'a Path>,
    /// Bits of a number.
    pub(crate) precision: Precision,
}

impl Adaptation<'_> {
    /// Another projection in closed form.
    pub(crate) fn whiten(&self, whitening: &Whitening) -> anyhow::Result<()> {
        let material = Material::open(self.set)?;
        let (network, digest) = default_network(self.weights)?;
        let fitted = whiten(whitening, network, &material)?;
        let facts = [
            ("whitened_from", digest),
            ("references", format!("{}, digest {}", material.len(), material.digest())),
            ("variants", format!("{}, {}", whitening.variants, whitening.augmentations.key())),
            ("seed", whitening.seed.to_string()),
            ("licence", "MIT OR Apache-2.0".to_owned()),
        ];
        save(&fitted, self.output, &facts, self.precision)?;
        cli::note(&format!("{}: whitened, {}", self.name, self.output.display()));
        Ok(())
    }

    /// Steps under the triplet loss; goes on where a killed run stopped.
    pub(crate) fn finetune(&self, settings: &Finetuning) -> anyhow::Result<()> {
        let material = Material::open(self.set)?;
        let (network, digest) = default_network(self.weights)?;
        let stem = self.output.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let usual = Path::new("target").join(format!("rsf-{stem}"));
        let folder = self.checkpoints.unwrap_or(&usual);
        let mut facts = settings.facts(&material, &digest);
        let log = run_log(&self.output.with_extension("log.csv"));
        let mut run = Run::open(folder, &facts, log)?;
        let tuned = finetune(settings, network, (self.set, &material), &mut run, folder, show)?;
        facts.push(("best", format!("{}, {}", place(&tuned), told(tuned.best))));
        save(&tuned.network, self.output, &facts, self.precision)?;
        cli::note(&verdict(&tuned));
        cli::note(&format!("{}: {}", self.name, self.output.display()));
        Ok(())
    }
}

/// Which network it was.
fn place(tuned: &Outcome) -> String {
    format!("step {}, {} of the way", tuned.best_step, tuned.share)
}

fn told(score: Score) -> String {
    format!("R@1 {:.3} of {} held-out variants, gap {:.4}", score.recall, score.n, score.gap)
}

/// Whether the map itself says that it was worth it.
fn verdict(tuned: &Outcome) -> String {
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
