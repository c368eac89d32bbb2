//! `bench map`: reference maps on disk, in and out of other programs' formats.

#[cfg(feature = "approximate")]
mod approximate;
mod build;
mod convert;
mod info;
mod merge;
mod search;
mod verify;

use std::path::Path;

use clap::Subcommand;
use vpr_data::exchange::Format;
use vpr_report::cli::Outcome;

/// Work with reference maps on disk.
#[derive(clap::Args)]
pub(crate) struct MapArgs {
    #[command(subcommand)]
    command: MapCommand,
}

#[derive(Subcommand)]
enum MapCommand {
    /// Make a map of descriptors, poses and names, or add them to a growing one
    Build(Box<build::BuildArgs>),
    /// Say what a map is of
    Info(info::InfoArgs),
    /// Turn one format into another
    Convert(convert::ConvertArgs),
    /// Make one map file of several maps, or of the segments of a growing one
    Merge(merge::MergeArgs),
    /// List everything that is wrong with a file, not only the first thing
    Verify(verify::VerifyArgs),
    /// Find the nearest references of every query
    Search(search::SearchArgs),
}

pub(crate) fn run(args: &MapArgs) -> anyhow::Result<Outcome> {
    match &args.command {
        MapCommand::Build(args) => build::run(args),
        MapCommand::Info(args) => info::run(args),
        MapCommand::Convert(args) => convert::run(args),
        MapCommand::Merge(args) => merge::run(args),
        MapCommand::Verify(args) => verify::run(args),
        MapCommand::Search(args) => search::run(args),
    }
}

/// The format that was named, or the one that the extension of a new file shows.
fn format_to(named: Option<Format>, path: &Path) -> anyhow::Result<Format> {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    match (named, &*extension) {
        (Some(format), _) => Ok(format),
        (None, "safetensors") => Ok(Format::Map),
        (None, "npy") => Ok(Format::Npy),
        (None, "npz") => Ok(Format::Npz),
        (None, "h5" | "hdf5") => Ok(Format::HlocH5),
        (None, "csv") => Ok(Format::PoseCsv),
        (None, "tum") => Ok(Format::Tum),
        (None, "kitti") => Ok(Format::Kitti),
        (None, "txt" | "bin") if path.file_stem().is_some_and(|it| it == "images") => {
            Ok(Format::Colmap)
        }
        _ => anyhow::bail!("{}: its name does not say which format; give `--to`", path.display()),
    }
}
