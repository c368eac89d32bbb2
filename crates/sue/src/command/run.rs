//! `sue run`: experiment files.

use std::path::PathBuf;

use sue::{
    corpus::Corpora,
    study::{self, Context, Study},
};
use vpr_report::cli::{self, Bar, Outcome, RunArgs};
use vpr_study::Sources;

/// The name by which experiment files call this program.
const CHAPTER: &str = "sue";

pub(crate) fn run(args: &RunArgs) -> anyhow::Result<Outcome> {
    let experiments = args.open::<Study>(CHAPTER)?;
    let bar = Bar::default();
    let (folders, cache) = (args.folders(), args.cache());
    let folders = folders.iter().map(PathBuf::as_path);
    let corpora = Corpora::new(Sources::new(folders, &cache, &bar));
    let without = corpora.sources().without_weights()?;
    let mut outcome = Outcome::Success;
    for experiment in &experiments {
        let context =
            Context { corpora: &corpora, timings: args.output.timings, seed: experiment.seed };
        let report = study::run(experiment, context)?;
        outcome = outcome.and(cli::finish(experiment, &report, &args.output, &without)?);
    }
    Ok(outcome)
}
