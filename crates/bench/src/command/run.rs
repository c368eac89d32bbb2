//! `bench run`: experiment files.

use std::path::{Path, PathBuf};

use bench::{
    data::Data,
    study::{self, Context, Study},
};
use vpr_core::{
    cli::{self, Bar, DataArgs, Outcome, OutputArgs},
    experiment::{self, Experiment},
};

/// Which experiments, from which data.
#[derive(clap::Args)]
pub(crate) struct RunArgs {
    /// Experiment files, such as `experiments/table-3.5.toml`; what they have in common is computed
    /// once
    #[arg(required = true, value_name = "FILE")]
    experiments: Vec<PathBuf>,
    #[command(flatten)]
    data: DataArgs,
    #[command(flatten)]
    output: OutputArgs,
}

pub(crate) fn run(args: &RunArgs) -> anyhow::Result<Outcome> {
    let experiments =
        args.experiments.iter().map(|path| load(path)).collect::<anyhow::Result<Vec<_>>>()?;
    if !args.data.data.is_dir() {
        anyhow::bail!("{}: the data folder does not exist", args.data.data.display());
    }
    let first = args.experiments.first().map_or(Path::new(""), PathBuf::as_path);
    let data = Data::new(&args.data.data, &workspace_data(first), &args.data.cache);
    let bar = Bar::default();
    let mut outcome = Outcome::Success;
    for experiment in &experiments {
        let (timings, seed) = (args.output.timings, experiment.seed);
        let report =
            study::run(experiment, Context { data: &data, observer: &bar, timings, seed })?;
        let figure = report.figure.as_ref();
        outcome = outcome.and(cli::finish(experiment, &report.table, figure, &args.output)?);
    }
    Ok(outcome)
}

fn load(path: &Path) -> anyhow::Result<Experiment<Study>> {
    let experiment = experiment::load::<Study>(path)?;
    if experiment.chapter != env!("CARGO_PKG_NAME") {
        anyhow::bail!("{}: belongs to `{}`", path.display(), experiment.chapter);
    }
    Ok(experiment)
}

/// `data/` beside the folder of the experiment file: where the fixture lies.
fn workspace_data(experiment: &Path) -> PathBuf {
    let absolute = std::path::absolute(experiment).unwrap_or_else(|_| experiment.to_owned());
    absolute.ancestors().nth(2).unwrap_or(Path::new("")).join("data")
}
