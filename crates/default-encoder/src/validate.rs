//! `default-encoder validate`: recall@1 where the network has never been.

use std::path::{Path, PathBuf};

use anyhow::Context;
use vpr_core::{
    GroundTruth,
    cli::{self, Outcome},
    dataset::{DataRoots, Dataset},
    metrics::{bootstrap::wilson_interval, recall_at},
    retrieve,
};
use vpr_nets::model::default::{DefaultEncoder, DefaultEncoderConfig, INPUT};
use vpr_worlds::{World, open_named, recipe_with};

use crate::pixels::planes;

/// Images that go through the network at a time.
const BATCH: usize = 32;

/// Which weights, on what.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The weights
    #[arg(long, value_name = "FILE", default_value = "data/models/default-encoder.safetensors")]
    weights: PathBuf,
    /// Folder that keeps rendered worlds
    #[arg(long, env = "VPR_CACHE", value_name = "DIR", default_value = "data/worlds")]
    cache: PathBuf,
    /// Folder of real datasets
    #[arg(long, env = "VPR_DATA", value_name = "DIR", default_value = "data")]
    data: PathBuf,
}

/// The same change of viewpoint for every family, and no other change.
const SHIFTED: &str = "queries.offset.lateral_m=-1.5&queries.offset.yaw_deg=8.0&\
                       queries.offset.jitter=0.5";
/// Winter, for families whose recipe has none.
const WINTER: &str = "queries.condition.snow=0.9&queries.condition.bare=1.0&\
                      queries.condition.cloud=0.8&queries.condition.sun_elevation_deg=12.0&\
                      queries.condition.falling=0.1&queries.condition.visibility_m=1200.0";
/// Summer, for families whose recipe has winter.
const SUMMER: &str = "queries.condition.snow=0.0&queries.condition.bare=0.0&\
                      queries.condition.cloud=0.25&queries.condition.sun_elevation_deg=42.0&\
                      queries.condition.falling=0.0&queries.condition.visibility_m=2500.0";

/// Worlds it is judged on: name, settings, what they test. None of their seeds is in training.
const WORLDS: [(&str, &[&str], &str); 11] = [
    ("street", &[], "unseen city"),
    ("street-night", &[], "unseen city by night"),
    ("street-snow", &[], "unseen city in snow"),
    ("campus", &[], "another family"),
    ("archive", &[], "old prints"),
    ("rail", &[], "another family, summer and winter"),
    ("corridor", &[], "another family"),
    ("street", &[SHIFTED], "gap: viewpoint only"),
    ("rail", &[SHIFTED, SUMMER], "gap: viewpoint only"),
    ("street", &[SHIFTED, WINTER], "gap: viewpoint and winter"),
    ("rail", &[SHIFTED], "gap: viewpoint and winter"),
];
/// Real datasets, where they are at hand.
const REAL: [&str; 5] =
    ["corridor", "gardens-point-thumbs", "essex3in1-thumbs", "redkitchen", "nordland-64x32"];

pub(crate) fn run(args: &Args) -> anyhow::Result<Outcome> {
    let network = DefaultEncoderConfig::new().init(&vpr_nets::device()).load(&args.weights)?;
    let roots = DataRoots::new([args.data.clone()]);
    let bar = cli::Bar::default();
    cli::print("dataset\tprovenance\tqueries\trecall@1\tlow\thigh\tnote\n")?;
    for (name, settings, note) in WORLDS {
        let mut id = format!("world/{name}");
        if !settings.is_empty() {
            id = format!("{id}?{}", settings.join("&"));
        }
        let world = open_named(&id, &roots, &args.cache, &bar)?;
        let world = world.with_context(|| format!("world/{name} cannot be rendered"))?;
        row(&format!("world/{name}\tgenerated"), note, &network, &world)?;
    }
    for id in REAL {
        match open_named(id, &roots, &args.cache, &bar)? {
            Some(dataset) => row(&format!("{id}\tmeasured"), &dataset.name, &network, &dataset)?,
            None => cli::print(&format!("{id}\tabsent\t\t\t\t\t\n"))?,
        }
    }
    Ok(Outcome::Success)
}

fn row(label: &str, note: &str, network: &DefaultEncoder, dataset: &Dataset) -> anyhow::Result<()> {
    let queries = network.describe(&planes(&dataset.queries, INPUT)?, INPUT, BATCH)?;
    let references = network.describe(&planes(&dataset.references, INPUT)?, INPUT, BATCH)?;
    let retrieval = retrieve(&queries, &references, 1)?;
    let recall = recall_at(1, &retrieval, &dataset.truth)?;
    let n = dataset.truth.n_known();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share of a count is a count"
    )]
    let interval = wilson_interval((recall * n as f64).round() as usize, n, 1.96)?;
    let (low, high) = (interval.low, interval.high);
    cli::print(&format!("{label}\t{n}\t{recall:.3}\t{low:.3}\t{high:.3}\t{note}\n"))
}

/// Two small unseen cities, one by day and one by night, that a training run is watched on.
pub(crate) struct Trial {
    parts: Vec<(Vec<f32>, Vec<f32>, GroundTruth)>,
}

impl Trial {
    pub(crate) fn open(cache: &Path) -> anyhow::Result<Self> {
        let small = [
            ("places", "120"),
            ("camera.width", "160"),
            ("camera.height", "120"),
            ("camera.focal", "115.0"),
        ];
        let mut parts = Vec::new();
        for (name, seed) in [("street", "9001"), ("street-night", "9002")] {
            let mut settings = small.to_vec();
            settings.push(("seed", seed));
            settings.extend([
                ("queries.offset.lateral_m", "-1.5"),
                ("queries.offset.yaw_deg", "8.0"),
                ("queries.offset.jitter", "0.5"),
            ]);
            let world = World::open(&recipe_with(name, &settings)?, cache, &|| {})?;
            let queries = planes(&world.dataset.queries, INPUT)?;
            let references = planes(&world.dataset.references, INPUT)?;
            parts.push((queries, references, world.dataset.truth));
        }
        Ok(Self { parts })
    }

    /// Recall@1 by day and by night.
    pub(crate) fn recalls(&self, network: &DefaultEncoder) -> vpr_core::Result<[f64; 2]> {
        let mut recalls = [0.0; 2];
        for (recall, (queries, references, truth)) in recalls.iter_mut().zip(&self.parts) {
            let queries = network.describe(queries, INPUT, BATCH)?;
            let references = network.describe(references, INPUT, BATCH)?;
            *recall = recall_at(1, &retrieve(&queries, &references, 1)?, truth)?;
        }
        Ok(recalls)
    }
}
