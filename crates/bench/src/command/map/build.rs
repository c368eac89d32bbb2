//! `bench map build`: descriptors, poses and names become a map.

use std::path::PathBuf;

use vpr_core::{
    Error,
    knn::Metric,
    map::{About, Coordinates, GrowingMap, ImageSize, RowType, parse_metric},
};
use vpr_data::exchange::Beside;
use vpr_report::cli::{self, Outcome};
use vpr_study::reading::ReadingArgs;

#[derive(clap::Args)]
pub(super) struct BuildArgs {
    /// File or folder with descriptors
    #[arg(long, value_name = "PATH")]
    descriptors: PathBuf,
    /// File or folder with poses, joined by name if both have names and by order otherwise; what
    /// lies beside the descriptors is not looked at then
    #[arg(long, value_name = "PATH")]
    poses: Option<PathBuf>,
    #[command(flatten)]
    reading: ReadingArgs,
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
    if !args.append {
        cli::check_out(&args.out)?;
    }
    let poses = args.poses.as_deref();
    let mut parts = args.reading.read_both(&args.descriptors, poses, Beside::Used)?;
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
