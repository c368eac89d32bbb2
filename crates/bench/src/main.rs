//! `bench`: VPR-Bench on the command line.

mod command;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use vpr_report::cli;

/// Large tensors come and go; the system's allocator would give their pages back each time.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// VPR-Bench, chapter 3: techniques, datasets, metrics, invariance and cost of place recognition.
#[derive(Parser)]
#[command(name = "bench", version, about, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    quiet: cli::Quiet,
}

#[derive(Subcommand)]
enum Command {
    /// Say what may be wrong with a ground truth, and what its radius decides
    Audit(Box<command::audit::AuditArgs>),
    /// Run an experiment file and compare it with the numbers of the thesis
    Run(command::run::Args),
    /// Say how many queries find a correct reference, from two folders or two descriptor files
    Evaluate(Box<command::evaluate::EvaluateArgs>),
    /// Say which of several methods differ on the same queries, and how many queries that takes
    Compare(Box<command::compare::CompareArgs>),
    #[cfg(feature = "networks")]
    /// Describe the images of a folder with a network, and write their map
    Encode(Box<command::encode::EncodeArgs>),
    /// List what there is
    List(command::list::ListArgs),
    /// Make, convert, check and search reference maps on disk
    Map(command::map::MapArgs),
    /// Match two images by local features: keypoints, matches, inliers, a picture
    Match(Box<command::match_images::MatchArgs>),
    #[cfg(feature = "networks")]
    /// Say which networks there are and where their weights are from
    Methods(command::methods::MethodsArgs),
    /// Train a vocabulary on generated places
    Train(command::train::TrainArgs),
    /// Say everything that is wrong with a dataset folder
    Validate(command::validate::ValidateArgs),
    #[command(flatten)]
    Shell(cli::Shell),
}

fn main() -> ExitCode {
    cli::main(|| {
        let Cli { command, quiet } = Cli::parse();
        quiet.heed();
        match command {
            Command::Audit(args) => command::audit::run(&args),
            Command::Run(args) => command::run::run(&args),
            Command::Evaluate(args) => command::evaluate::run(&args),
            Command::Compare(args) => command::compare::run(&args),
            #[cfg(feature = "networks")]
            Command::Encode(args) => command::encode::run(&args),
            Command::List(args) => command::list::run(&args),
            Command::Map(args) => command::map::run(&args),
            Command::Match(args) => command::match_images::run(&args),
            #[cfg(feature = "networks")]
            Command::Methods(args) => command::methods::run(&args),
            Command::Train(args) => command::train::run(&args),
            Command::Validate(args) => command::validate::run(&args),
            Command::Shell(args) => args.run::<Cli>(),
        }
    })
}
