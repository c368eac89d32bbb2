//! `bench encode`: a folder of images becomes a map file.

use std::path::{Path, PathBuf};

use vpr_core::map::RowType;
use vpr_data::{
    exchange::{Format, Parts},
    layout::{folder::Listing, numbered::images_in_order},
};
use vpr_nets::encode::{Images, encode_to_map};
use vpr_report::cli::{self, DataArgs, Outcome};
use vpr_study::reading::PoseArgs;

use super::{
    encoder::EncoderArgs,
    named::{names_in, say},
};

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
    #[command(flatten)]
    reading: PoseArgs,
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
    cli::check_out(&args.out)?;
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

/// The images of the folder in the order of their numbers, or else of their paths.
fn images(args: &EncodeArgs) -> anyhow::Result<Images> {
    let folder = &args.images;
    let Listing { images: paths, notes } = images_in_order(folder)?;
    say(&notes);
    let names = names_in(folder, &paths);
    let parts = Parts { names: Some(names.clone()), ..Parts::default() };
    let n_utm = paths.iter().filter(|path| is_utm(path)).count();
    let parts = match &args.poses {
        Some(poses) => args.reading.join(parts, poses)?,
        None if n_utm == paths.len() => {
            let reading = PoseArgs { poses_format: Some(Format::UtmNames), ..args.reading };
            reading.join(parts, folder)?
        }
        None => {
            if n_utm > 0 {
                let n = paths.len();
                let note = format!("only {n_utm} of {n} images have a position in their names");
                say(&[format!("{}: {note}: the map gets none", folder.display())]);
            }
            parts
        }
    };
    let names = names.iter().map(str::to_owned).collect();
    Ok(Images { paths, names, poses: parts.poses, coordinates: parts.about.coordinates })
}

fn is_utm(path: &Path) -> bool {
    path.file_name().is_some_and(|it| it.to_string_lossy().starts_with('@'))
}
