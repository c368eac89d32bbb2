//! The `default-encoder` program: trains the default network on generated streets and says how far
//! it carries.

mod head;
mod train;
mod validate;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use vpr_report::cli;

/// The small network that every clone has.
#[derive(Parser)]
#[command(name = "default-encoder", version, about, propagate_version = true)]
struct Args {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    quiet: cli::Quiet,
}

#[derive(Subcommand)]
enum Command {
    /// Train it on generated streets; a killed run goes on where it stopped
    Train(train::Args),
    /// Train another head on its trunk, which stays; a killed run goes on where it stopped
    Head(head::Args),
    /// Recall@1 on worlds it has not seen, and on real datasets at hand
    Validate(validate::Args),
    #[command(flatten)]
    Shell(cli::Shell),
}

fn main() -> ExitCode {
    cli::main(|| {
        let Args { command, quiet } = Args::parse();
        quiet.heed();
        match command {
            Command::Train(args) => train::run(&args),
            Command::Head(args) => head::run(&args),
            Command::Validate(args) => validate::run(&args),
            Command::Shell(args) => args.run::<Args>(),
        }
    })
}
