//! `bench validate`: everything that is wrong with a dataset folder.

use std::path::{Path, PathBuf};

use anyhow::Context;
use vpr_data::{Severity, validate_with};
use vpr_report::cli::{self, Bar, DataArgs, Outcome};
use vpr_study::{Sources, TruthArgs};
use vpr_vision::image;

/// Which folder to look at.
#[derive(clap::Args)]
pub(crate) struct ValidateArgs {
    /// Dataset folder: `query/`, `ref/`, `ground_truth_new.npy`, or `queries/`, `database/`, or
    /// `seq-01/`; or the name of a generated one, such as `world/street`
    folder: PathBuf,
    #[command(flatten)]
    data: DataArgs,
    #[command(flatten)]
    truth: TruthArgs,
    /// Decode every image whole, not only its header
    #[arg(long)]
    thorough: bool,
}

pub(crate) fn run(args: &ValidateArgs) -> anyhow::Result<Outcome> {
    let folder = folder(args)?;
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
    let problems = validate_with(&folder, &probe, args.truth.source().as_ref());
    for problem in &problems {
        cli::print(&format!("{problem}\n"))?;
    }
    let n_errors = problems.iter().filter(|it| it.severity == Severity::Error).count();
    let counted = |n: usize, what: &str| format!("{n} {what}{}", if n == 1 { "" } else { "s" });
    let warnings = counted(problems.len() - n_errors, "warning");
    cli::note(&format!("{}, {warnings}", counted(n_errors, "error")));
    Ok(if n_errors == 0 { Outcome::Success } else { Outcome::Mismatch })
}

/// The folder itself, or that of the generated world of this name, rendered if need be.
fn folder(args: &ValidateArgs) -> anyhow::Result<PathBuf> {
    if args.folder.is_dir() {
        return Ok(args.folder.clone());
    }
    let name = args.folder.to_str().filter(|name| vpr_worlds::is_world(name));
    let Some(name) = name else {
        anyhow::bail!("{}: is not a folder", args.folder.display());
    };
    let bar = Bar::default();
    let (folders, cache) = (args.data.folders(), args.data.cache());
    let sources = Sources::new(folders.iter().map(PathBuf::as_path), &cache, &bar);
    let dataset = sources.images(name)?.context("a world has images")?;
    let image = dataset.queries.first().context("a world has queries")?;
    Ok(image.ancestors().nth(2).unwrap_or(image).to_owned())
}

/// What is wrong, without the path that the problem names already.
fn without_path(err: &vpr_core::Error) -> String {
    match err {
        vpr_core::Error::Format { place, reason, .. } => format!("{place}: {reason}"),
        vpr_core::Error::Io { source, .. } => source.to_string(),
        err => err.to_string(),
    }
}
