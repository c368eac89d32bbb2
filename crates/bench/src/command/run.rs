//! `bench run`: experiment files.

use std::path::PathBuf;

use bench::study::{self, Context, Study};
use vpr_report::cli::{self, Bar, Outcome, RunArgs};
use vpr_study::Sources;

/// The name by which experiment files call this program.
const CHAPTER: &str = "bench";

/// Experiment files, and where networks are timed.
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    run: RunArgs,
    /// With --timings: the device that networks are timed on besides, such as wgpu or cuda:1
    #[arg(long, requires = "timings")]
    device: Option<String>,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<Outcome> {
    let device = args.device.as_deref();
    let args = &args.run;
    let experiments = args.open::<Study>(CHAPTER)?;
    let bar = Bar::default();
    let (folders, cache) = (args.folders(), args.cache());
    let folders = folders.iter().map(PathBuf::as_path);
    let sources = Sources::new(folders, &cache, &bar);
    let without = sources.without_weights()?;
    let mut outcome = Outcome::Success;
    for experiment in &experiments {
        let (timings, seed) = (args.output.timings, experiment.seed);
        let context = Context { sources: &sources, timings, device, seed };
        let report = study::run(experiment, context)?;
        outcome = outcome.and(cli::finish(experiment, &report, &args.output, &without)?);
    }
    Ok(outcome)
}
