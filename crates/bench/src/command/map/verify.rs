//! `bench map verify`: everything that is wrong with a file.

use std::path::PathBuf;

use vpr_data::exchange::{self, Format};
use vpr_report::cli::{self, Outcome};
use vpr_study::reading::FromArgs;

#[derive(clap::Args)]
pub(super) struct VerifyArgs {
    /// Map, or any file of another format
    path: PathBuf,
    #[command(flatten)]
    from: FromArgs,
}

pub(super) fn run(args: &VerifyArgs) -> anyhow::Result<Outcome> {
    let from = args.from.from.or_else(|| {
        // A map whose header is damaged no longer looks like one.
        let extension = args.path.extension().unwrap_or_default();
        (extension == "safetensors" && Format::guess(&args.path).is_err()).then_some(Format::Map)
    });
    let problems = exchange::problems(FromArgs { from }.format_of(&args.path)?, &args.path);
    for problem in &problems {
        cli::print(&format!("{problem}\n"))?;
    }
    match problems.len() {
        0 => cli::note("no problem"),
        1 => cli::note("1 problem"),
        n => cli::note(&format!("{n} problems")),
    }
    Ok(if problems.is_empty() { Outcome::Success } else { Outcome::Mismatch })
}
