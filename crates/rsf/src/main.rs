//! `rsf`: an encoder that has read its map, on the command line.

mod command;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use vpr_report::cli;

/// Large tensors come and go; the system's allocator would give their pages back each time.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// RSF, chapter 4: fine-tuning on the references of a map, before any query is seen.
#[derive(Parser)]
#[command(name = "rsf", version, about, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    quiet: cli::Quiet,
}

#[derive(Subcommand)]
enum Command {
    /// Adapt the default network to a map; a killed run goes on where it stopped
    Finetune(Box<command::finetune::FinetuneArgs>),
    /// Say how far a map is from what the network was trained on, and whether tuning may pay
    Gap(Box<command::gap::GapArgs>),
    /// Draw what fine-tuning makes of an image
    Augment(command::augment::AugmentArgs),
    /// Make the weights that experiment files name
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
            Command::Finetune(args) => command::finetune::run(&args),
            Command::Gap(args) => command::gap::run(&args),
            Command::Augment(args) => command::augment::run(&args),
            Command::Train(args) => command::train::run(&args),
            Command::Run(args) => command::run::run(&args),
            Command::Shell(args) => args.run::<Cli>(),
        }
    })
}
