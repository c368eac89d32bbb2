//! `copr train`: networks of the chapter.

mod encoder;
mod regressor;

use clap::Subcommand;
use vpr_nets::train::Report;
use vpr_report::cli::{self, Outcome};

/// What to train.
#[derive(clap::Args)]
pub(crate) struct TrainArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// The default network under one of the three losses of the chapter
    Encoder(encoder::EncoderArgs),
    /// H: from one anchor and a relative pose to a descriptor
    Regressor(Box<regressor::RegressorArgs>),
}

pub(crate) fn run(args: &TrainArgs) -> anyhow::Result<Outcome> {
    match &args.what {
        What::Encoder(args) => args.run(),
        What::Regressor(args) => args.run(),
    }
}

/// Every validation on the screen, as in the log.
#[expect(clippy::unnecessary_wraps, reason = "what training calls")]
fn show(report: &Report, validation: f64) -> vpr_core::Result<()> {
    let Report { step, loss, rate } = report;
    cli::note(&format!("{step}: loss {loss:.5}, validation {validation:.5}, rate {rate:.2e}"));
    Ok(())
}
