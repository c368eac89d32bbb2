//! `default-encoder train`.

use std::{
    fs::{self, OpenOptions},
    io::Write,
    path::{Path, PathBuf},
};

use anyhow::Context;
use default_encoder::{
    batches::{Sizes, batch, variants},
    cities::{self, VISITS},
    pixels::Album,
};
use ndarray::{Axis, concatenate};
use vpr_nets::{
    model::default::{DefaultEncoder, DefaultEncoderConfig, INPUT},
    train::{Checkpoint, Descent, Optimizer, Report, Schedule, learned_whitening, seeded},
};
use vpr_report::cli::{self, Outcome};

use crate::validate::{self, BATCH};

/// Steps between two lines of the log.
const LOG_EVERY: usize = 25;
/// Steps between two validations.
const VALIDATE_EVERY: usize = 200;

/// What to train, on how much.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The weights to write; the log lands beside them
    #[arg(long, value_name = "FILE", default_value = "data/models/default-encoder.safetensors")]
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
    let albums = cities::open(args.cities, args.seed, &args.cache)?;
    let trial = validate::Trial::open(&args.cache)?;
    if args.render_only {
        return Ok(Outcome::Success);
    }
    let descent = Descent {
        steps: args.steps,
        schedule: Schedule::Cosine {
            rate: args.rate,
            last: 0.01 * args.rate,
            warmup: args.steps.div_ceil(20).min(200),
            steps: args.steps,
        },
        optimizer: Optimizer::AdamW { decay: 0.01 },
        save_every: 50,
    };
    let sizes = Sizes { input: INPUT, places: args.places, views: args.views };
    let device = vpr_nets::train::device();
    let fresh = seeded(DefaultEncoderConfig::new().init(&device), args.seed);
    let first = batch(&albums, sizes, args.seed, args.steps);
    let mut log = Log::open(args.output.with_extension("log.csv"), &args.checkpoints)?;
    let network = descent.run(
        fresh.centred(first.tensor(&device)),
        &Checkpoint::new(&args.checkpoints),
        |step| Ok(batch(&albums, sizes, args.seed, step)),
        |report, network| log.note(report, network, &trial),
    )?;
    let network = whitened(network, &albums, args.seed)?;
    log.end(&network, &trial)?;
    save(&network, args)?;
    cli::note(&format!("generated: {}", args.output.display()));
    Ok(Outcome::Success)
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
    let places: Vec<usize> = (0..features.nrows()).map(|image| image / VISITS).collect();
    let projection = learned_whitening(features.view(), &places, network.dimension())?;
    Ok(network.with_projection(&projection)?)
}

/// Writes the weights under a temporary name, then renames.
fn save(network: &DefaultEncoder, args: &Args) -> anyhow::Result<()> {
    let partial = args.output.with_extension("partial.safetensors");
    let facts = [
        ("trained_on", format!("{} generated street cities", args.cities)),
        ("seed", args.seed.to_string()),
        ("steps", args.steps.to_string()),
        ("input", format!("{} x {}, RGB in 0 to 1", INPUT.0, INPUT.1)),
        ("licence", "MIT OR Apache-2.0".to_owned()),
    ];
    let pairs: Vec<(&str, &str)> =
        facts.iter().map(|(key, value)| (*key, value.as_str())).collect();
    network.save(&partial, &pairs)?;
    fs::rename(&partial, &args.output).with_context(|| args.output.display().to_string())
}

/// The log: a line every [`LOG_EVERY`] steps, rewritten from the checkpoint on when resumed.
struct Log {
    path: PathBuf,
    sum: f64,
    n: usize,
}

impl Log {
    fn open(path: PathBuf, checkpoints: &Path) -> anyhow::Result<Self> {
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
        }
        if !checkpoints.exists() || !path.exists() {
            let head = "step,loss,learning_rate,recall_at_1_unseen_day,recall_at_1_unseen_night\n";
            fs::write(&path, head).with_context(|| path.display().to_string())?;
        }
        Ok(Self { path, sum: 0.0, n: 0 })
    }

    fn note(
        &mut self,
        report: &Report,
        network: &DefaultEncoder,
        trial: &validate::Trial,
    ) -> vpr_core::Result<()> {
        self.sum += report.loss;
        self.n += 1;
        if !report.step.is_multiple_of(LOG_EVERY) {
            return Ok(());
        }
        let recalls = if report.step.is_multiple_of(VALIDATE_EVERY) {
            trial.recalls(network)?.map(|recall| format!("{recall:.4}")).join(",")
        } else {
            ",".to_owned()
        };
        let loss = self.sum / self.n as f64;
        let line = format!("{},{loss:.4},{:.2e},{recalls}\n", report.step, report.rate);
        (self.sum, self.n) = (0.0, 0);
        self.write(&line)
    }

    /// The line of the finished network.
    fn end(&self, network: &DefaultEncoder, trial: &validate::Trial) -> vpr_core::Result<()> {
        let recalls = trial.recalls(network)?.map(|recall| format!("{recall:.4}")).join(",");
        self.write(&format!("whitened,,,{recalls}\n"))
    }

    fn write(&self, line: &str) -> vpr_core::Result<()> {
        cli::note(line.trim_end());
        OpenOptions::new()
            .append(true)
            .open(&self.path)
            .and_then(|mut file| file.write_all(line.as_bytes()))
            .map_err(vpr_core::Error::io(&self.path))
    }
}
