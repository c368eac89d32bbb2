//! `default-encoder validate`: recall@1 where the network has never been.

use std::path::{Path, PathBuf};

use anyhow::Context;
use ndarray::Array2;
use rayon::prelude::*;
use vpr_core::{
    Descriptors, GroundTruth,
    metrics::{
        bootstrap::{Z_95, wilson_interval},
        recall_at,
    },
    retrieve,
};
use vpr_data::{DataRoots, Dataset, Datasets};
use vpr_nets::{
    model::{
        Tunable,
        default::{DefaultEncoder, DefaultEncoderConfig, INPUT},
    },
    train::planes,
};
use vpr_report::cli::{self, Outcome};
use vpr_vision::{
    hog::{Hog, HogParams},
    image,
};
use vpr_worlds::{World, Worlds, recipe_with};

/// Images that go through the network at a time.
pub(crate) const BATCH: usize = 32;

/// Which weights, on what.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The weights
    #[arg(
        long,
        value_name = "FILE",
        default_value = "crates/vpr-nets/models/default-encoder.safetensors"
    )]
    weights: PathBuf,
    /// Folder that keeps rendered worlds
    #[arg(long, env = "VPR_CACHE", value_name = "DIR", default_value = "data/worlds")]
    cache: PathBuf,
    /// Folder of real datasets
    #[arg(long, env = "VPR_DATA", value_name = "DIR", default_value = "data")]
    data: PathBuf,
}

/// The same camera, tolerance and change of viewpoint for every family: 1 m to the left, 5°, both
/// with some jitter. The next place is correct, the one after it is not.
const ALIKE: &str = "places=200&camera.width=160&camera.height=120&camera.focal=115.0&\
                     layout=\"vpr-bench\"&tolerance={frames=1}&\
                     queries.offset.lateral_m=-1.0&queries.offset.yaw_deg=5.0&\
                     queries.offset.jitter=0.2";
/// Winter as the recipe of `rail` has it.
const WINTER: &str = "queries.condition.snow=0.9&queries.condition.bare=1.0&\
                      queries.condition.cloud=0.8&queries.condition.sun_elevation_deg=12.0&\
                      queries.condition.falling=0.1&queries.condition.visibility_m=1200.0";
/// Summer as the recipe of `street` has it.
const SUMMER: &str = "queries.condition.snow=0.0&queries.condition.bare=0.0&\
                      queries.condition.cloud=0.25&queries.condition.sun_elevation_deg=42.0&\
                      queries.condition.falling=0.0&queries.condition.visibility_m=2500.0";

/// Worlds it is judged on: recipe, settings, what they test. None of their seeds is in training.
const WORLDS: [(&str, &str, &str); 15] = [
    ("street", "", "unseen city"),
    ("street", "queries.offset.lateral_m=-2.0", "unseen city, 2 m to the left"),
    ("street", "queries.offset.lateral_m=-4.0", "unseen city, 4 m to the left"),
    ("street", "queries.condition.darkness=0.5", "unseen city, darkness 0.5"),
    ("street", "queries.condition.darkness=0.8", "unseen city, darkness 0.8"),
    ("street", "queries.condition.snow=0.5", "unseen city, snow 0.5"),
    ("street", "queries.condition.snow=1.0", "unseen city, snow 1.0"),
    ("street", "queries.condition.occlusion=0.2", "unseen city, 0.2 of the width hidden"),
    ("street", "queries.condition.occlusion=0.4", "unseen city, 0.4 of the width hidden"),
    ("street", WINTER, "unseen city, summer to winter"),
    ("rail", SUMMER, "another family, viewpoint only"),
    ("rail", "", "another family, summer to winter"),
    ("campus", "references.offset.lateral_m=0.0", "another family, day to night"),
    ("archive", "", "another family, old prints"),
    ("corridor", "", "another family, indoors"),
];
/// Real datasets, where they are at hand.
const REAL: [&str; 5] =
    ["corridor", "gardens-point-thumbs", "essex3in1-thumbs", "redkitchen", "nordland-64x32"];

pub(crate) fn run(args: &Args) -> anyhow::Result<Outcome> {
    let network = DefaultEncoderConfig::new().init(&vpr_nets::device()).load(&args.weights)?;
    let roots = DataRoots::new([args.data.clone()]);
    let datasets = Datasets::new(roots, &args.cache, Worlds);
    let bar = cli::Bar::default();
    cli::print("dataset\tprovenance\tqueries\tdefault\tlow\thigh\thog\tlow\thigh\tnote\n")?;
    for (name, settings, note) in WORLDS {
        let id = format!("world/{name}?{ALIKE}&{settings}");
        let world = datasets.open(id.trim_end_matches('&'), &bar)?;
        let world = world.with_context(|| format!("world/{name} cannot be rendered"))?;
        row(&format!("world/{name}\tgenerated"), note, &network, &world)?;
    }
    for id in REAL {
        match datasets.open(id, &bar)? {
            Some(dataset) => row(&format!("{id}\tmeasured"), &dataset.name, &network, &dataset)?,
            None => cli::note(&format!("{id} is not at hand")),
        }
    }
    Ok(Outcome::Success)
}

fn row(label: &str, note: &str, network: &DefaultEncoder, dataset: &Dataset) -> anyhow::Result<()> {
    let (queries, references) = (&dataset.queries, &dataset.references);
    let learned = |paths: &[PathBuf]| -> anyhow::Result<Descriptors> {
        Ok(network.describe(&planes(paths, INPUT)?, INPUT, BATCH)?)
    };
    let of_network = found(&learned(queries)?, &learned(references)?, dataset)?;
    let of_hog = found(&hog(queries)?, &hog(references)?, dataset)?;
    let n = dataset.truth.n_known();
    cli::print(&format!("{label}\t{n}\t{of_network}\t{of_hog}\t{note}\n"))?;
    Ok(())
}

fn hog(paths: &[PathBuf]) -> anyhow::Result<Descriptors> {
    let params = HogParams::default();
    let hog = Hog::new(params)?;
    let rows: Vec<Vec<f32>> = paths
        .par_iter()
        .map(|path| hog.describe(&image::decode(path)?))
        .collect::<vpr_core::Result<_>>()?;
    let rows = Array2::from_shape_vec((paths.len(), params.dim()), rows.concat())?;
    Ok(Descriptors::new(rows)?)
}

/// Recall@1 and its Wilson interval, three columns.
fn found(
    queries: &Descriptors,
    references: &Descriptors,
    dataset: &Dataset,
) -> anyhow::Result<String> {
    let recall = recall_at(1, &retrieve(queries, references, 1)?, &dataset.truth)?;
    let n = dataset.truth.n_known();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share of a count is a count"
    )]
    let interval = wilson_interval((recall * n as f64).round() as usize, n, Z_95)?;
    Ok(format!("{recall:.3}\t{:.3}\t{:.3}", interval.low, interval.high))
}

/// Two small unseen cities, one by day and one by night, that a training run is watched on.
pub(crate) struct Trial {
    parts: Vec<(Vec<f32>, Vec<f32>, GroundTruth)>,
}

impl Trial {
    pub(crate) fn open(cache: &Path) -> anyhow::Result<Self> {
        let small = [
            ("places", "100"),
            ("camera.width", "160"),
            ("camera.height", "120"),
            ("camera.focal", "115.0"),
        ];
        let mut parts = Vec::new();
        for (name, seed) in [("street", "9001"), ("street-night", "9002")] {
            let mut settings = small.to_vec();
            settings.push(("seed", seed));
            settings.extend([
                ("queries.offset.lateral_m", "-1.0"),
                ("queries.offset.yaw_deg", "5.0"),
                ("queries.offset.jitter", "0.2"),
                ("tolerance", "{ radius_m = 7.0 }"),
            ]);
            let world = World::open(&recipe_with(name, &settings)?, cache, &|| {})?;
            let queries = planes(&world.dataset.queries, INPUT)?;
            let references = planes(&world.dataset.references, INPUT)?;
            parts.push((queries, references, world.dataset.truth));
        }
        Ok(Self { parts })
    }

    /// Recall@1 by day and by night.
    pub(crate) fn recalls(&self, network: &impl Tunable) -> vpr_core::Result<[f64; 2]> {
        let mut recalls = [0.0; 2];
        for (recall, (queries, references, truth)) in recalls.iter_mut().zip(&self.parts) {
            let queries = network.rows(queries, INPUT, BATCH)?;
            let references = network.rows(references, INPUT, BATCH)?;
            *recall = recall_at(1, &retrieve(&queries, &references, 1)?, truth)?;
        }
        Ok(recalls)
    }
}
