//! `cargo xtask`: dispatches to the chapters' programs and computes nothing itself.

mod reproduce;

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
}

#[expect(clippy::print_stderr, reason = "a program tells people what went wrong on stderr")]
fn main() -> ExitCode {
    let Cli { command: Command::Reproduce(args) } = Cli::parse();
    match reproduce::run(&args) {
        Ok(code) => code,
        Err(err) => {
            eprintln!("error: {err:#}");
            ExitCode::from(2)
        }
    }
}
