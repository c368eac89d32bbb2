//! `bench run`: experiment files.

use bench::{
    data::Data,
    study::{self, Context, Study},
};
use vpr_core::cli::{self, Bar, Outcome, RunArgs};

pub(crate) fn run(args: &RunArgs) -> anyhow::Result<Outcome> {
    let experiments = args.open::<Study>(env!("CARGO_PKG_NAME"))?;
    let data = Data::new(&args.data.data, &args.workspace_data(), &args.data.cache);
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
