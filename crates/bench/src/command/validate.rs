//! `bench validate`: everything that is wrong with a dataset folder.

use std::path::{Path, PathBuf};

use vpr_core::{
    cli::{self, Outcome},
    dataset::{Severity, validate},
};
use vpr_vision::image;

/// Which folder to look at.
#[derive(clap::Args)]
pub(crate) struct ValidateArgs {
    /// Dataset folder: `query/`, `ref/`, `ground_truth_new.npy`, or `queries/`, `database/`
    folder: PathBuf,
    /// Decode every image whole, not only its header
    #[arg(long)]
    thorough: bool,
}

pub(crate) fn run(args: &ValidateArgs) -> anyhow::Result<Outcome> {
    if !args.folder.is_dir() {
        anyhow::bail!("{}: is not a folder", args.folder.display());
    }
    let probe = |path: &Path| {
        let size = if args.thorough {
            image::decode(path).map(|image| image.size())
        } else {
            image::probe(path)
        };
        let size = size.map_err(|err| without_path(&err))?;
        let length = |pixels: usize| u32::try_from(pixels).map_err(|err| err.to_string());
        Ok((length(size.width)?, length(size.height)?))
    };
    let problems = validate(&args.folder, &probe);
    for problem in &problems {
        cli::print(&format!("{problem}\n"))?;
    }
    let n_errors = problems.iter().filter(|it| it.severity == Severity::Error).count();
    cli::note(&format!("{n_errors} errors, {} warnings", problems.len() - n_errors));
    Ok(if n_errors == 0 { Outcome::Success } else { Outcome::Mismatch })
}

/// What is wrong, without the path that the problem names already.
fn without_path(err: &vpr_core::Error) -> String {
    match err {
        vpr_core::Error::Format { place, reason, .. } => format!("{place}: {reason}"),
        vpr_core::Error::Io { source, .. } => source.to_string(),
        err => err.to_string(),
    }
}
