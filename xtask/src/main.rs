//! `cargo xtask`: dispatches to the chapters' programs and computes nothing itself.

mod reproduce;
mod train;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Commands of this workspace.
#[derive(Parser)]
#[command(bin_name = "cargo xtask", version, about)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Reproduce tables and figures of the thesis
    Reproduce(reproduce::Args),
    /// Train a network that comes with the toolkit
    Train(train::Args),
}

#[expect(clippy::print_stderr, reason = "a program tells people what went wrong on stderr")]
fn main() -> ExitCode {
    let outcome = match Cli::parse().command {
        Command::Reproduce(args) => reproduce::run(&args),
        Command::Train(args) => train::run(&args),
    };
    match outcome {
        Ok(code) => code,
        Err(err) => {
            eprintln!("error: {err:#}");
            ExitCode::from(2)
        }
    }
}
