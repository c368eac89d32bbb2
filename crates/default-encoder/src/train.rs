//! `default-encoder train`.

use std::path::PathBuf;

use ndarray::{Axis, concatenate};
use vpr_nets::{
    model::default::{DefaultEncoder, DefaultEncoderConfig, INPUT},
    train::{
        Album, Arrangement, Batches, Descent, Log, Report, Run, Sizes, learned_whitening, seeded,
        variants,
    },
};
use vpr_report::cli::{self, Outcome};
use vpr_worlds::cities::{self, AVENUES, PLACES, VISITS};

use crate::validate::{self, BATCH};

/// Steps between two lines of the log.
const LOG_EVERY: usize = 25;
/// Steps between two checkpoints, a multiple of those between two lines.
const SAVE_EVERY: usize = 50;
/// Columns of the log after the step.
pub(crate) const COLUMNS: [&str; 4] =
    ["loss", "learning_rate", "recall_at_1_unseen_day", "recall_at_1_unseen_night"];
/// How the images of a city lie.
pub(crate) const CITY: Arrangement =
    Arrangement { places: PLACES, visits: VISITS, avenues: AVENUES };
/// Steps between two validations.
const VALIDATE_EVERY: usize = 200;

/// What to train, on how much.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The weights to write; the log lands beside them
    #[arg(
        long,
        value_name = "FILE",
        default_value = "crates/vpr-nets/models/default-encoder.safetensors"
    )]
    output: PathBuf,
    /// Folder that keeps rendered worlds
    #[arg(long, env = "VPR_CACHE", value_name = "DIR", default_value = "data/worlds")]
    cache: PathBuf,
    /// Folder of checkpoints
    #[arg(long, value_name = "DIR", default_value = "target/default-encoder")]
    checkpoints: PathBuf,
    /// Decides cities, weights and batches
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of cities
    #[arg(long, default_value_t = 40)]
    cities: usize,
    /// Number of steps
    #[arg(long, default_value_t = 3000)]
    steps: usize,
    /// Places in a step, a multiple of 4
    #[arg(long, default_value_t = 24)]
    places: usize,
    /// Images of each of them, up to 5
    #[arg(long, default_value_t = 3)]
    views: usize,
    /// Highest learning rate
    #[arg(long, default_value_t = 2e-3)]
    rate: f64,
    /// Render the cities and stop
    #[arg(long)]
    render_only: bool,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<Outcome> {
    let sizes = Sizes { input: INPUT, places: args.places, views: args.views };
    sizes.check(CITY)?;
    let cities = cities::open(args.cities, args.seed, &args.cache, &cli::Bar::default())?;
    let trial = validate::Trial::open(&args.cache)?;
    if args.render_only {
        return Ok(Outcome::Success);
    }
    let albums: Vec<Album> = cities
        .into_iter()
        .map(|bytes| Album::new(bytes, cities::SIZE))
        .collect::<vpr_core::Result<_>>()?;
    let batches = Batches::new(albums, CITY, sizes, args.seed)?;
    let log = Log::new(&args.output.with_extension("log.csv"), &COLUMNS, LOG_EVERY);
    let facts = facts(args);
    let mut run = Run::open(&args.checkpoints, &facts, log)?;
    cli::resumes(&args.checkpoints);
    let device = vpr_nets::train::device();
    let fresh = seeded(DefaultEncoderConfig::new().init(&device), args.seed);
    let first = batches.get(args.steps);
    let network = run.descend(
        &Descent::adam_w(args.steps, args.rate, SAVE_EVERY),
        fresh.centred(first.tensor(&device)),
        |step| Ok(batches.get(step)),
        |report, network| line(report, network, &trial),
    )?;
    let network = whitened(network, batches.albums(), args.seed)?;
    let [day, night] = recalls(&network, &trial)?;
    run.append("whitened", &[String::new(), String::new(), day, night])?;
    network.save(&args.output, &facts)?;
    cli::note(&format!("generated: {}", args.output.display()));
    Ok(Outcome::Success)
}

/// Everything that two runs must share to be one.
fn facts(args: &Args) -> Vec<(&'static str, String)> {
    vec![
        ("trained_on", format!("{} generated street cities", args.cities)),
        ("seed", args.seed.to_string()),
        ("steps", args.steps.to_string()),
        ("batch", format!("{} places x {} images", args.places, args.views)),
        ("rate", args.rate.to_string()),
        ("input", format!("{} x {}, RGB in 0 to 1", INPUT.0, INPUT.1)),
        ("licence", "MIT OR Apache-2.0".to_owned()),
    ]
}

/// A line of the log, also on the screen.
fn line(
    report: &Report,
    network: &DefaultEncoder,
    trial: &validate::Trial,
) -> vpr_core::Result<Vec<String>> {
    let [day, night] = if report.step.is_multiple_of(VALIDATE_EVERY) {
        recalls(network, trial)?
    } else {
        [String::new(), String::new()]
    };
    let cells = vec![format!("{:.4}", report.loss), format!("{:.2e}", report.rate), day, night];
    cli::note(&format!("{},{}", report.step, cells.join(",")));
    Ok(cells)
}

fn recalls(network: &DefaultEncoder, trial: &validate::Trial) -> vpr_core::Result<[String; 2]> {
    Ok(trial.recalls(network)?.map(|recall| format!("{recall:.4}")))
}

/// The network with a projection fitted in closed form: what differs between visits to a place
/// counts little, what differs between places much. One variant of every image is used.
fn whitened(
    network: DefaultEncoder,
    albums: &[Album],
    seed: u64,
) -> anyhow::Result<DefaultEncoder> {
    let mut parts = Vec::new();
    for (city, album) in (0_u64..).zip(albums) {
        let images = variants(album, INPUT, seed ^ (city + 1).rotate_left(32));
        parts.push(network.pooled(&images, INPUT, BATCH)?);
    }
    let views: Vec<_> = parts.iter().map(|part| part.view()).collect();
    let features = concatenate(Axis(0), &views)?;
    let places: Vec<usize> = (0..features.nrows()).map(|image| CITY.place(image)).collect();
    let projection = learned_whitening(features.view(), &places, network.dimension())?;
    Ok(network.with_projection(&projection)?)
}
