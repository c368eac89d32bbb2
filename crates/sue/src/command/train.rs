//! `sue train`: networks that say how sure they are, on generated street cities.

use std::path::PathBuf;

use anyhow::bail;
use clap::ValueEnum;
use sue::net::{self, Learned, Lesson, Training};
use vpr_nets::{
    loss::{LogVariance, SelfTeaching},
    model::default::{DefaultEncoderConfig, INPUT},
    train::{Album, Arrangement, Batches, Report, Run, Sizes},
    weights::{Precision, Weights, save},
};
use vpr_report::cli::{self, Outcome};
use vpr_worlds::cities::{self, AVENUES, PLACES, VISITS};

/// How the images of a city lie.
const CITY: Arrangement = Arrangement { places: PLACES, visits: VISITS, avenues: AVENUES };
/// Steps between two lines on the screen.
const SHOWN: usize = 25;

/// What to train, on how much.
#[derive(clap::Args)]
pub(crate) struct TrainArgs {
    /// Which network
    learned: Learned,
    /// Weights of the default network: where BTL starts, STUN's teacher
    #[arg(
        long,
        value_name = "FILE",
        default_value = "crates/vpr-nets/models/default-encoder.safetensors"
    )]
    from: PathBuf,
    /// The weights to write; the log lands beside them [default:
    /// data/models/<NETWORK>-default.safetensors]
    #[arg(long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Folder that keeps rendered worlds
    #[arg(long, env = "VPR_CACHE", value_name = "DIR", default_value = "data/worlds")]
    cache: PathBuf,
    /// Folder of checkpoints [default: target/sue-<NETWORK>]
    #[arg(long, value_name = "DIR")]
    checkpoints: Option<PathBuf>,
    /// Decides cities, weights and batches
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of cities
    #[arg(long, default_value_t = 12)]
    cities: usize,
    /// Number of steps
    #[arg(long, default_value_t = 600)]
    steps: usize,
    /// Places in a step, a multiple of 4
    #[arg(long, default_value_t = 16)]
    places: usize,
    /// Images of each of them, 2 to 5
    #[arg(long, default_value_t = 3)]
    views: usize,
    /// Highest learning rate [default: 3e-4 for BTL, 2e-3 for STUN]
    #[arg(long)]
    rate: Option<f64>,
    /// How STUN's variance head is read in training
    #[arg(long, value_enum, default_value_t = Reading::Sigmoid)]
    log_variance: Reading,
    /// STUN's loss
    #[arg(long, value_enum, default_value_t = Teaching::Published)]
    self_teaching: Teaching,
    /// Render the cities and stop
    #[arg(long)]
    render_only: bool,
}

/// How the variance head is read in training.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Reading {
    /// As in use
    Sigmoid,
    /// Clamped, as the released code trains but does not evaluate
    Shifted,
}

/// STUN's loss.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Teaching {
    /// As released: a distance over a variance
    Published,
    /// The Gaussian likelihood of the paper
    Corrected,
}

impl TrainArgs {
    fn check(&self) -> anyhow::Result<()> {
        self.sizes().check(CITY)?;
        // A place that is seen once has no pair.
        if !(2..=VISITS).contains(&self.views) {
            bail!("--views {}: must be 2 to {VISITS}", self.views);
        }
        if self.cities == 0 || self.steps == 0 {
            bail!("--cities and --steps must be at least 1");
        }
        Ok(())
    }

    fn sizes(&self) -> Sizes {
        Sizes { input: INPUT, places: self.places, views: self.views }
    }

    fn rate(&self) -> f64 {
        self.rate.unwrap_or(match self.learned {
            Learned::Btl => 3e-4,
            Learned::Stun => 2e-3,
        })
    }

    fn lesson(&self) -> Lesson {
        Lesson {
            loss: match self.self_teaching {
                Teaching::Published => SelfTeaching::Published,
                Teaching::Corrected => SelfTeaching::Corrected,
            },
            log_variance: match self.log_variance {
                Reading::Sigmoid => LogVariance::Sigmoid,
                Reading::Shifted => LogVariance::Shifted,
            },
        }
    }

    /// Everything that two runs must share to be one; `digest` is that of the weights in `from`.
    fn facts(&self, digest: &str) -> Vec<(&'static str, String)> {
        let mut facts = vec![
            ("network", format!("{} on the default network", self.learned.name())),
            ("trained_on", format!("{} generated street cities", self.cities)),
            ("seed", self.seed.to_string()),
            ("steps", self.steps.to_string()),
            ("batch", format!("{} places x {} images", self.places, self.views)),
            ("rate", self.rate().to_string()),
            ("input", format!("{} x {}, RGB in 0 to 1", INPUT.0, INPUT.1)),
            ("from", format!("sha256 {digest}")),
            ("licence", "MIT OR Apache-2.0".to_owned()),
        ];
        if self.learned == Learned::Stun {
            let Lesson { loss, log_variance } = self.lesson();
            facts.push(("loss", format!("{loss:?}, {log_variance:?}")));
        }
        facts
    }
}

pub(crate) fn run(args: &TrainArgs) -> anyhow::Result<Outcome> {
    args.check()?;
    let name = args.learned.key();
    let or_default = |given: &Option<PathBuf>, default: String| {
        given.clone().unwrap_or_else(|| PathBuf::from(default))
    };
    let output = or_default(&args.output, format!("data/models/{name}-default.safetensors"));
    let checkpoints = or_default(&args.checkpoints, format!("target/sue-{name}"));
    args.output.iter().try_for_each(|path| cli::check_out(path))?;
    let config = DefaultEncoderConfig::new();
    if !args.from.is_file() {
        bail!(
            "{}: no such file; `cargo xtask train default-encoder` makes it",
            args.from.display()
        );
    }
    let encoder = net::default_network(&config, &args.from)?;
    let facts = args.facts(Weights::open(&args.from)?.digest());
    let cities = cities::open(args.cities, args.seed, &args.cache, &cli::Bar::default())?;
    if args.render_only {
        return Ok(Outcome::Success);
    }
    let albums: Vec<Album> = cities
        .into_iter()
        .map(|bytes| Album::new(bytes, cities::SIZE))
        .collect::<vpr_core::Result<_>>()?;
    let batches = Batches::new(albums, CITY, args.sizes(), args.seed)?;
    let batch = |step| Ok(batches.get(step));
    let log = Training::log(&output.with_extension("log.csv"));
    let mut run = Run::open(&checkpoints, &facts, log)?;
    cli::resumes(&checkpoints);
    let training = Training { config, steps: args.steps, rate: args.rate(), seed: args.seed };
    match args.learned {
        Learned::Btl => {
            let network = training.btl(encoder, &mut run, batch, show)?;
            save(&network, &output, &facts, Precision::Half)?;
        }
        Learned::Stun => {
            let pair = training.stun(&encoder, args.lesson(), &mut run, batch, show)?;
            save(pair.student(), &output, &facts, Precision::Half)?;
        }
    }
    cli::note(&format!("generated: {}", output.display()));
    Ok(Outcome::Success)
}

/// Some steps on the screen; all of them are in the log.
#[expect(clippy::unnecessary_wraps, reason = "what training calls")]
fn show(report: &Report) -> vpr_core::Result<()> {
    if report.step % SHOWN == 1 {
        cli::note(&format!("{},{:.5},{:.3e}", report.step, report.loss, report.rate));
    }
    Ok(())
}
