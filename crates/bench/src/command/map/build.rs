//! `bench map build`: descriptors, poses and names become a map.

use std::path::PathBuf;

use vpr_core::{
    Error,
    knn::Metric,
    map::{About, Coordinates, GrowingMap, ImageSize, RowType, parse_metric},
};
use vpr_data::exchange::{self, Format};
use vpr_report::cli::{self, Outcome};

use super::format_of;

#[derive(clap::Args)]
pub(super) struct BuildArgs {
    /// File or folder with descriptors
    #[arg(long, value_name = "PATH")]
    descriptors: PathBuf,
    /// Its format, if its name does not say it
    #[arg(long, value_name = "FORMAT")]
    descriptors_format: Option<Format>,
    /// File or folder with poses, joined by name if both have names and by order otherwise
    #[arg(long, value_name = "PATH")]
    poses: Option<PathBuf>,
    /// Its format, if its name does not say it
    #[arg(long, value_name = "FORMAT")]
    poses_format: Option<Format>,
    /// How descriptors are stored: f32, f16 or int8
    #[arg(long, value_name = "TYPE", default_value_t)]
    row_type: RowType,
    /// Add a segment to the growing map in the folder OUT
    #[arg(long)]
    append: bool,
    /// Also build a graph beside the map, for `search --approximate`
    #[cfg(feature = "approximate")]
    #[arg(long)]
    approximate: bool,
    /// Name of the encoder
    #[arg(long)]
    encoder: Option<String>,
    /// Digest of the encoder's weights, as sha256:…
    #[arg(long)]
    weights_digest: Option<String>,
    /// Size of the images as the encoder saw them, such as 640x480
    #[arg(long, value_name = "SIZE")]
    image_size: Option<ImageSize>,
    /// How images were resized
    #[arg(long)]
    interpolation: Option<String>,
    /// The distance the descriptors were made for
    #[arg(long, value_parser = parse_metric)]
    metric: Option<Metric>,
    /// What positions mean: `local`, or `utm 32N`
    #[arg(long)]
    coordinates: Option<Coordinates>,
    /// The map to write: a file, or with --append a folder
    out: PathBuf,
}

pub(super) fn run(args: &BuildArgs) -> anyhow::Result<Outcome> {
    let read = |path: &PathBuf, format| anyhow::Ok(exchange::read(format_of(format, path)?, path)?);
    let mut parts = read(&args.descriptors, args.descriptors_format)?;
    if let Some(poses) = &args.poses {
        parts = parts.join(read(poses, args.poses_format)?).map_err(|err| err.in_file(poses))?;
    }
    let known = parts.about;
    parts.about = About {
        encoder: args.encoder.clone().or(known.encoder),
        weights_digest: args.weights_digest.clone().or(known.weights_digest),
        image_size: args.image_size.or(known.image_size),
        interpolation: args.interpolation.clone().or(known.interpolation),
        metric: args.metric.or(known.metric),
        coordinates: args.coordinates.or(known.coordinates),
    };
    let none = || Error::Empty("descriptors").in_file(&args.descriptors);
    let descriptors = parts.descriptors.as_ref().ok_or_else(none)?;
    let n_rows = descriptors.len();
    if args.append {
        let mut map = GrowingMap::open(&args.out, args.row_type, parts.about.clone())?;
        map.append(descriptors.view(), parts.poses.as_ref(), parts.names.as_ref())?;
        let (n, n_segments) = (map.len(), map.n_segments());
        cli::note(&format!("added {n_rows} references: {n} in {n_segments} segments"));
    } else {
        parts.write_map(&args.out, args.row_type)?;
        cli::note(&format!("wrote {n_rows} references"));
    }
    #[cfg(feature = "approximate")]
    if args.approximate {
        super::approximate::build(&args.out)?;
    }
    Ok(Outcome::Success)
}
