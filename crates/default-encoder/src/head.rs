//! `default-encoder head`: another head on the trunk, which stays as it is.

use std::path::PathBuf;

use ndarray::Array2;

use vpr_nets::{
    aggregate::{Boq, Salad},
    model::{
        Tunable as _,
        default::INPUT,
        headed::{Head, Headed, Maps},
    },
    train::{Album, Batches, Descent, Log, Report, Run, Sizes, variants},
    weights::Precision,
};
use vpr_report::cli::{self, Outcome};
use vpr_worlds::cities;

use crate::{
    train::{CITY, COLUMNS},
    validate::{BATCH, Trial},
};

/// Steps between two lines of the log.
const LOG_EVERY: usize = 25;
/// Steps between two checkpoints.
const SAVE_EVERY: usize = 50;
/// Steps between two validations.
const VALIDATE_EVERY: usize = 250;

#[derive(Clone, Copy, clap::ValueEnum)]
enum Name {
    /// Learned queries that attend to the map
    Boq,
    /// Clusters by optimal transport
    Salad,
}

/// Which head, on how much.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The head
    head: Name,
    /// The weights to write; the log lands beside them
    #[arg(long, value_name = "FILE")]
    output: PathBuf,
    /// Folder that keeps rendered worlds
    #[arg(long, env = "VPR_CACHE", value_name = "DIR", default_value = "data/worlds")]
    cache: PathBuf,
    /// Folder of checkpoints [default: target/, then the name of the output]
    #[arg(long, value_name = "DIR")]
    checkpoints: Option<PathBuf>,
    /// Decides cities, weights and batches
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of cities
    #[arg(long, default_value_t = 24)]
    cities: usize,
    /// Number of steps
    #[arg(long, default_value_t = 400)]
    steps: usize,
    /// Places in a step, a multiple of 4
    #[arg(long, default_value_t = 24)]
    places: usize,
    /// Images of each of them, up to 5
    #[arg(long, default_value_t = 3)]
    views: usize,
    /// Variants of every image; their maps are computed once
    #[arg(long, default_value_t = 1)]
    variants: usize,
    /// Highest learning rate
    #[arg(long, default_value_t = 2e-3)]
    rate: f64,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<Outcome> {
    match args.head {
        Name::Boq => train::<Boq>(args, "BoQ"),
        Name::Salad => train::<Salad>(args, "SALAD"),
    }
}

fn train<H: Head>(args: &Args, name: &str) -> anyhow::Result<Outcome> {
    let sizes = Sizes { input: INPUT, places: args.places, views: args.views };
    sizes.check(CITY)?;
    let cities = cities::open(args.cities, args.seed, &args.cache, &cli::Bar::default())?;
    let trial = Trial::open(&args.cache)?;
    let albums: Vec<Album> = cities
        .into_iter()
        .map(|bytes| Album::new(bytes, cities::SIZE))
        .collect::<vpr_core::Result<_>>()?;
    let batches = Batches::new(albums, CITY, sizes, args.seed)?;
    let stem = args.output.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let folder = args.checkpoints.clone().unwrap_or_else(|| PathBuf::from("target").join(stem));
    let facts = facts(args, name);
    let log = Log::new(&args.output.with_extension("log.csv"), &COLUMNS, LOG_EVERY);
    let mut run = Run::open(&folder, &facts, log)?;
    cli::resumes(&folder);
    let fresh = Headed::<H>::fresh(args.seed, &vpr_nets::train::device())?;
    let learned = Learned::new(&fresh, batches, args)?;
    let network = run.descend(
        &Descent::adam_w(args.steps, args.rate, SAVE_EVERY),
        fresh,
        |step| Ok(learned.batch(step)),
        |report, network| line(report, network, &trial, args.steps),
    )?;
    network.write(&args.output, &facts, Precision::Single)?;
    cli::note(&format!("generated: {}", args.output.display()));
    Ok(Outcome::Success)
}

/// What the trunk makes of variants of all images. It stays, so once is enough.
struct Learned {
    batches: Batches,
    /// For each variant, for each city, a row for each image.
    maps: Vec<Vec<Array2<f32>>>,
    size: [usize; 3],
}

impl Learned {
    fn new<H: Head>(network: &Headed<H>, batches: Batches, args: &Args) -> anyhow::Result<Self> {
        let (mut maps, mut size) = (Vec::new(), [0; 3]);
        for variant in 0..args.variants.max(1) as u64 {
            let mut cities = Vec::new();
            for (city, album) in (0_u64..).zip(batches.albums()) {
                let seed = args.seed ^ (city + 1).rotate_left(32) ^ (variant + 1).rotate_left(48);
                let (rows, of_map) = network.maps(&variants(album, INPUT, seed), INPUT, BATCH)?;
                size = of_map;
                cities.push(rows);
            }
            maps.push(cities);
        }
        Ok(Self { batches, maps, size })
    }

    fn batch(&self, step: usize) -> Maps {
        let chosen = self.batches.chosen(step);
        let variant = |seed: u64| usize::try_from(seed % self.maps.len() as u64).unwrap_or(0);
        let rows = chosen.iter().flat_map(|it| {
            let row = self.maps[variant(it.seed)][it.album].row(it.image);
            row.into_iter().copied()
        });
        Maps {
            values: rows.collect(),
            size: self.size,
            places: chosen.iter().map(|it| it.place).collect(),
        }
    }
}

/// Everything that two runs must share to be one.
fn facts(args: &Args, name: &str) -> Vec<(&'static str, String)> {
    vec![
        ("head", name.to_owned()),
        ("trunk", "that of the default network, as it is".to_owned()),
        ("trained_on", format!("{} generated street cities", args.cities)),
        ("seed", args.seed.to_string()),
        ("steps", args.steps.to_string()),
        ("batch", format!("{} places x {} images", args.places, args.views)),
        ("variants", args.variants.to_string()),
        ("rate", args.rate.to_string()),
        ("input", format!("{} x {}, RGB in 0 to 1", INPUT.0, INPUT.1)),
        ("licence", "MIT OR Apache-2.0".to_owned()),
    ]
}

/// A line of the log, also on the screen.
fn line<H: Head>(
    report: &Report,
    network: &Headed<H>,
    trial: &Trial,
    steps: usize,
) -> vpr_core::Result<Vec<String>> {
    let [day, night] = if report.step.is_multiple_of(VALIDATE_EVERY) || report.step == steps {
        trial.recalls(network)?.map(|recall| format!("{recall:.4}"))
    } else {
        [String::new(), String::new()]
    };
    let cells = vec![format!("{:.4}", report.loss), format!("{:.2e}", report.rate), day, night];
    cli::note(&format!("{},{}", report.step, cells.join(",")));
    Ok(cells)
}
