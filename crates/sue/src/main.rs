//! `sue`: how far to trust a match, on the command line.

mod command;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use vpr_report::cli;

/// Large tensors come and go; the system's allocator would give their pages back each time.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// SUE, chapter 5: uncertainty of the best match in visual place recognition.
#[derive(Parser)]
#[command(name = "sue", version, about, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    quiet: cli::Quiet,
}

#[derive(Subcommand)]
enum Command {
    /// Say how uncertain the best match of every query is
    Estimate(Box<command::estimate::EstimateArgs>),
    /// Say how well estimators tell correct from wrong matches
    Evaluate(Box<command::evaluate::EvaluateArgs>),
    /// Choose a threshold that keeps a promise, from queries whose correct references are known
    Calibrate(Box<command::calibrate::CalibrateArgs>),
    /// Train a network that says how sure it is; a killed run goes on where it stopped
    Train(command::train::TrainArgs),
    /// Run an experiment file and compare it with the numbers of the thesis
    Run(cli::RunArgs),
    #[command(flatten)]
    Shell(cli::Shell),
}

fn main() -> ExitCode {
    cli::main(|| {
        let Cli { command, quiet } = Cli::parse();
        quiet.heed();
        match command {
            Command::Estimate(args) => command::estimate::run(&args),
            Command::Evaluate(args) => command::evaluate::run(&args),
            Command::Calibrate(args) => command::calibrate::run(&args),
            Command::Train(args) => command::train::run(&args),
            Command::Run(args) => command::run::run(&args),
            Command::Shell(args) => args.run::<Cli>(),
        }
    })
}
