//! `bench match`: keypoints, matches and inliers of two images.

use std::path::PathBuf;

use anyhow::{Context, anyhow};
use clap::ValueEnum;
use serde::Serialize;
use vpr_data::DataRoots;
use vpr_report::cli::{self, DataArgs, Outcome};
use vpr_study::verification::LocalFeature;
use vpr_vision::{
    features::{Extractor, LocalFeatures},
    image,
    matching::{self, Match, MatchParams},
    ransac::{self, Inliers, RansacParams},
};

/// Which images, how they are described, matched and verified.
#[derive(clap::Args)]
pub(crate) struct MatchArgs {
    /// The query image
    a: PathBuf,
    /// The reference image
    b: PathBuf,
    /// Local features: sift, orb, or a network, whose weights lie in DIR/weights/ of `--data`:
    /// xfeat (xfeat.pt), disk (disk-depth-save.pth), superpoint (`superpoint_v6_from_tf.pth`), delf
    /// (delf.pth)
    #[arg(long, default_value_t = LocalFeature::Sift, value_name = "NAME")]
    method: LocalFeature,
    /// Weights of a network, .pt, .pth or .safetensors; by default DIR/weights/ of `--data`
    #[arg(long, value_name = "FILE")]
    weights: Option<PathBuf>,
    /// Keypoints per image, the strongest
    #[arg(long, default_value_t = 5000, value_name = "N")]
    features: usize,
    /// Lowe's ratio test; 0.6 for SIFT and ORB, none for networks
    #[arg(long, value_name = "R", conflicts_with = "mutual")]
    ratio: Option<f64>,
    /// Mutual nearest neighbours without a ratio test; the default for networks
    #[arg(long)]
    mutual: bool,
    /// What the inliers agree on
    #[arg(long, value_enum, default_value_t = Geometry::Homography)]
    geometry: Geometry,
    /// Inliers are nearer than this, in pixels; 5 for a homography, 3 for a fundamental matrix
    #[arg(long, value_name = "PX")]
    threshold: Option<f64>,
    /// Samples of RANSAC
    #[arg(long, default_value_t = 1000, value_name = "N")]
    iterations: u32,
    /// Seed of the samples
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Draw the matches: inliers green, others red
    #[arg(long, value_name = "PNG")]
    plot: Option<PathBuf>,
    /// What is printed: counts, all as JSON, or one line per match as CSV
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    data: DataArgs,
}

#[derive(Clone, Copy, ValueEnum)]
enum Geometry {
    /// A plane or a turning camera
    Homography,
    /// The epipolar geometry of two views
    Fundamental,
}

#[derive(Clone, Copy, ValueEnum)]
enum Format {
    Text,
    Json,
    Csv,
}

pub(crate) fn run(args: &MatchArgs) -> anyhow::Result<Outcome> {
    let method = extractor(args)?;
    let [a, b] = [&args.a, &args.b].map(|path| image::decode(path));
    let images = [a?, b?];
    let [a, b] = [(&images[0], &args.a), (&images[1], &args.b)]
        .map(|(image, path)| method.extract(image).with_context(|| path.display().to_string()));
    let features = [a?, b?];
    let matches = matching::match_features(&features[0], &features[1], &matching_params(args))?;
    let inliers = verify(args, &features, &matches)?;
    if let Some(path) = &args.plot {
        let [a, b] = &images;
        let picture =
            matching::draw([a, b], [&features[0], &features[1]], &matches, &inliers.mask)?;
        image::write_png(&picture, path)?;
    }
    let text = match args.format {
        Format::Text => format!(
            "keypoints  {} {}\nmatches    {}\ninliers    {}\n",
            features[0].len(),
            features[1].len(),
            matches.len(),
            inliers.count()
        ),
        Format::Json => json(args.method.name(), &features, &matches, &inliers)?,
        Format::Csv => csv(&features, &matches, &inliers),
    };
    cli::print(&text)?;
    Ok(Outcome::Success)
}

/// The features with their weights: those of `--weights`, or those of a data folder.
fn extractor(args: &MatchArgs) -> anyhow::Result<Box<dyn Extractor>> {
    let weights = match &args.weights {
        Some(path) if args.method.is_learned() => Some(path.clone()),
        Some(_) => None,
        None => {
            let roots = DataRoots::new([args.data.data.clone()]);
            let name = args.method.name();
            args.method.find_weights(&roots)?.map_err(|why| {
                let folder = args.data.data.display();
                anyhow!("{name}: {why} in {folder}; give --weights FILE")
            })?
        }
    };
    Ok(args.method.open(weights.as_deref(), args.features)?.extractor)
}

fn matching_params(args: &MatchArgs) -> MatchParams {
    let learned = args.method.is_learned();
    match args.ratio {
        Some(ratio) => MatchParams { ratio: Some(ratio), ..MatchParams::RATIO },
        None if args.mutual || learned => MatchParams::MUTUAL,
        None => MatchParams::RATIO,
    }
}

fn verify(
    args: &MatchArgs,
    features: &[LocalFeatures; 2],
    matches: &[Match],
) -> vpr_core::Result<Inliers> {
    let points = ransac::correspondences(&features[0], &features[1], matches);
    let (iterations, seed) = (args.iterations, args.seed);
    let params = |default: RansacParams| RansacParams {
        threshold: args.threshold.unwrap_or(default.threshold),
        iterations,
        seed,
        ..default
    };
    match args.geometry {
        Geometry::Homography => ransac::homography(&points, &params(RansacParams::HOMOGRAPHY)),
        Geometry::Fundamental => ransac::fundamental(&points, &params(RansacParams::EPIPOLAR)),
    }
}

/// One match as it is printed.
#[derive(Serialize)]
struct Line {
    a: [f32; 2],
    b: [f32; 2],
    distance: f32,
    inlier: bool,
}

fn lines(features: &[LocalFeatures; 2], matches: &[Match], inliers: &Inliers) -> Vec<Line> {
    let of = |(it, &inlier): (&Match, &bool)| Line {
        a: features[0].keypoints()[it.query],
        b: features[1].keypoints()[it.reference],
        distance: it.distance,
        inlier,
    };
    matches.iter().zip(&inliers.mask).map(of).collect()
}

fn json(
    method: &str,
    features: &[LocalFeatures; 2],
    matches: &[Match],
    inliers: &Inliers,
) -> anyhow::Result<String> {
    let value = serde_json::json!({
        "method": method,
        "keypoints": [features[0].len(), features[1].len()],
        "matches": matches.len(),
        "inliers": inliers.count(),
        "model": inliers.model,
        "pairs": lines(features, matches, inliers),
    });
    Ok(serde_json::to_string_pretty(&value)? + "\n")
}

fn csv(features: &[LocalFeatures; 2], matches: &[Match], inliers: &Inliers) -> String {
    use std::fmt::Write as _;
    let mut text = "a_x,a_y,b_x,b_y,distance,inlier\n".to_owned();
    for Line { a, b, distance, inlier } in lines(features, matches, inliers) {
        let _ = writeln!(text, "{},{},{},{},{distance},{inlier}", a[0], a[1], b[0], b[1]);
    }
    text
}
