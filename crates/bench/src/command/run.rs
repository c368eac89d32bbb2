//! `bench run`: one experiment file.

use std::{
    path::{Path, PathBuf},
    sync::Mutex,
};

use bench::{
    data::Data,
    study::{self, Context, Observer, Study},
};
use vpr_core::{
    cli::{self, DataArgs, Outcome, OutputArgs},
    experiment,
};

/// Which experiment, from which data.
#[derive(clap::Args)]
pub(crate) struct RunArgs {
    /// Experiment file, such as `experiments/table-3.5.toml`
    experiment: PathBuf,
    #[command(flatten)]
    data: DataArgs,
    #[command(flatten)]
    output: OutputArgs,
}

pub(crate) fn run(args: &RunArgs) -> anyhow::Result<Outcome> {
    let experiment = experiment::load::<Study>(&args.experiment)?;
    if experiment.chapter != env!("CARGO_PKG_NAME") {
        anyhow::bail!("{}: belongs to `{}`", args.experiment.display(), experiment.chapter);
    }
    if !args.data.data.is_dir() {
        anyhow::bail!("{}: the data folder does not exist", args.data.data.display());
    }
    let data = Data::new(&args.data.data, &workspace_data(&args.experiment));
    let bar = Bar::default();
    let context = Context {
        data: &data,
        observer: &bar,
        timings: args.output.timings,
        seed: experiment.seed,
    };
    let report = study::run(&experiment, context)?;
    cli::finish(&experiment, &report.table, report.figure.as_ref(), &args.output)
}

/// `data/` beside the folder of the experiment file: where the fixture lies.
fn workspace_data(experiment: &Path) -> PathBuf {
    let absolute = std::path::absolute(experiment).unwrap_or_else(|_| experiment.to_owned());
    absolute.ancestors().nth(2).unwrap_or(Path::new("")).join("data")
}

/// The progress bar of the work under way.
#[derive(Default)]
pub(crate) struct Bar(Mutex<Option<indicatif::ProgressBar>>);

impl Bar {
    fn with(&self, act: impl FnOnce(&mut Option<indicatif::ProgressBar>)) {
        // A poisoned lock means another thread panicked: progress no longer matters.
        if let Ok(mut bar) = self.0.lock() {
            act(&mut bar);
        }
    }
}

impl Observer for Bar {
    fn start(&self, what: &str, n: usize) {
        self.with(|bar| *bar = Some(cli::progress(what, n)));
    }

    fn step(&self) {
        self.with(|bar| bar.iter().for_each(|bar| bar.inc(1)));
    }

    fn end(&self) {
        self.with(|bar| bar.take().iter().for_each(indicatif::ProgressBar::finish_and_clear));
    }
}
