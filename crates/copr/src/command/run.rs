//! `copr run`: experiment files.

use std::path::PathBuf;

use copr::study::{self, Context, Study};
use vpr_report::cli::{self, Bar, Outcome, RunArgs};
use vpr_study::Sources;

/// The name by which experiment files call this program.
pub(super) const CHAPTER: &str = "copr";

pub(crate) fn run(args: &RunArgs) -> anyhow::Result<Outcome> {
    let experiments = args.open::<Study>(CHAPTER)?;
    let bar = Bar::default();
    let (folders, cache) = (args.folders(), args.cache());
    let sources = Sources::new(folders.iter().map(PathBuf::as_path), &cache, &bar);
    let bare = Sources::new([], &cache, &bar);
    let without = sources.without_weights()?;
    let mut outcome = Outcome::Success;
    for experiment in &experiments {
        let (seed, timings) = (experiment.seed, args.output.timings);
        let context = Context { sources: &sources, bare: &bare, seed, timings };
        let report = study::run(experiment, context)?;
        outcome = outcome.and(cli::finish(experiment, &report, &args.output, &without)?);
    }
    Ok(outcome)
}
