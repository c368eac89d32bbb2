//! `copr`: maps that are denser than their images, on the command line.

mod command;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use vpr_report::cli;

/// Large tensors come and go; the system's allocator would give their pages back each time.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// CoPR, chapter 6: descriptors regressed at poses no camera visited.
#[derive(Parser)]
#[command(name = "copr", version, about, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    quiet: cli::Quiet,
}

#[derive(Subcommand)]
enum Command {
    /// Make a map denser without an image
    Densify(Box<command::densify::DensifyArgs>),
    /// Say where queries were taken, and how wrong that is if their poses are known
    Localize(command::localize::LocalizeArgs),
    /// Train the regression network H; a killed run goes on where it stopped
    Train(command::train::TrainArgs),
    /// Run experiment files and compare them with the numbers of the thesis
    Run(cli::RunArgs),
    #[command(flatten)]
    Shell(cli::Shell),
}

fn main() -> ExitCode {
    cli::main(|| {
        let Cli { command, quiet } = Cli::parse();
        quiet.heed();
        match command {
            Command::Densify(args) => command::densify::run(&args),
            Command::Localize(args) => command::localize::run(&args),
            Command::Train(args) => command::train::run(&args),
            Command::Run(args) => command::run::run(&args),
            Command::Shell(args) => args.run::<Cli>(),
        }
    })
}
