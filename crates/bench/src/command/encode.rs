//! `bench encode`: a folder of images becomes a map file.

use std::path::{Path, PathBuf};

use vpr_core::map::RowType;
use vpr_data::{
    exchange::{self, Format, Parts},
    layout::numbered::images_in_order,
};
use vpr_nets::encode::{Images, encode_to_map};
use vpr_report::cli::{self, DataArgs, Outcome};

use super::encoder::EncoderArgs;

/// Describes the images of a folder and writes their map. Interrupted, it goes on where it stopped.
#[derive(clap::Args)]
pub(crate) struct EncodeArgs {
    /// Folder of the images; positions are taken from `@utm_east@utm_north@…` names
    images: PathBuf,
    /// The network: a name of `bench methods`
    #[arg(long, value_name = "NAME")]
    method: String,
    #[command(flatten)]
    encoder: EncoderArgs,
    #[command(flatten)]
    data: DataArgs,
    /// File or folder with the poses of the images, by their names
    #[arg(long, value_name = "PATH")]
    poses: Option<PathBuf>,
    /// Its format, if its name does not say it
    #[arg(long, value_name = "FORMAT", requires = "poses")]
    poses_format: Option<Format>,
    /// How descriptors are stored: f32, f16 or int8
    #[arg(long, value_name = "TYPE", default_value_t)]
    row_type: RowType,
    /// Leave out images that cannot be read, and list them, instead of stopping at the first
    #[arg(long, alias = "skip_bad")]
    skip_bad: bool,
    /// Threads; all processors by default
    #[arg(long, alias = "num_workers", value_name = "N")]
    threads: Option<usize>,
    /// The map to write
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
}

pub(crate) fn run(args: &EncodeArgs) -> anyhow::Result<Outcome> {
    check_place(&args.out)?;
    let images = images(args)?;
    let encoder = args.encoder.open(&args.method, &args.data.folders())?;
    let options = args.encoder.options(args.threads, args.skip_bad);
    let bar = cli::progress(encoder.name(), images.paths.len());
    let written =
        encode_to_map(&*encoder, &images, &options, args.row_type, &args.out, &mut |done| {
            bar.set_position(done as u64);
        })?;
    bar.finish_and_clear();
    for (name, reason) in &written.skipped {
        let reason =
            reason.as_ref().map_or("skipped by an earlier run".to_owned(), ToString::to_string);
        cli::note(&format!("skipped `{name}`: {reason}"));
    }
    let earlier = match written.n_resumed {
        0 => String::new(),
        n => format!(", {n} of them by an earlier run"),
    };
    let (n_rows, n_skipped) = (written.n_rows, written.skipped.len());
    cli::note(&format!(
        "wrote {n_rows} references of {} dimensions{earlier}; {n_skipped} images skipped",
        encoder.dimension()
    ));
    Ok(Outcome::Success)
}

/// A map is written where none is, into a folder that is there: known before the work.
fn check_place(out: &Path) -> anyhow::Result<()> {
    if out.exists() {
        anyhow::bail!("{}: exists; delete it or choose another `--out`", out.display());
    }
    let folder = out.parent().filter(|folder| !folder.as_os_str().is_empty());
    match folder {
        Some(folder) if !folder.is_dir() => {
            anyhow::bail!("{}: the folder does not exist", folder.display())
        }
        _ => Ok(()),
    }
}

/// The images of the folder in the order of their numbers, or else of their paths.
fn images(args: &EncodeArgs) -> anyhow::Result<Images> {
    let folder = &args.images;
    let paths = images_in_order(folder)?;
    let name =
        |path: &PathBuf| path.strip_prefix(folder).unwrap_or(path).to_string_lossy().into_owned();
    let names: Vec<String> = paths.iter().map(name).collect();
    let poses = match &args.poses {
        Some(poses) => {
            let format = args.poses_format.map_or_else(|| Format::guess(poses), Ok)?;
            Some((exchange::read(format, poses)?, poses.as_path()))
        }
        None if is_utm(&paths) => {
            Some((exchange::read(Format::UtmNames, folder)?, folder.as_path()))
        }
        None => None,
    };
    let mut parts = Parts { names: Some(names.iter().collect()), ..Parts::default() };
    if let Some((poses, place)) = poses {
        parts = parts.join(poses).map_err(|err| err.in_file(place))?;
    }
    Ok(Images { paths, names, poses: parts.poses, coordinates: parts.about.coordinates })
}

fn is_utm(paths: &[PathBuf]) -> bool {
    let name =
        |path: &Path| path.file_name().is_some_and(|it| it.to_string_lossy().starts_with('@'));
    paths.iter().all(|path| name(path))
}
