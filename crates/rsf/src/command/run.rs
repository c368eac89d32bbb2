//! `rsf run`: experiment files.

use std::path::PathBuf;

use rsf::study::{self, Study};
use vpr_report::cli::{self, Bar, Outcome, RunArgs};
use vpr_study::Sources;

/// The name by which experiment files call this program.
pub(crate) const CHAPTER: &str = "rsf";

pub(crate) fn run(args: &RunArgs) -> anyhow::Result<Outcome> {
    let experiments = args.open::<Study>(CHAPTER)?;
    let bar = Bar::default();
    let (folders, cache) = (args.folders(), args.cache());
    let sources = Sources::new(folders.iter().map(PathBuf::as_path), &cache, &bar);
    let without = sources.without_weights()?;
    let mut outcome = Outcome::Success;
    for experiment in &experiments {
        let report = study::run(experiment, &sources)?;
        outcome = outcome.and(cli::finish(experiment, &report, &args.output, &without)?);
    }
    Ok(outcome)
}
