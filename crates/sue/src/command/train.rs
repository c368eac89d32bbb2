//! `sue train`: networks that say how sure they are, on generated street cities.

use std::{
    fs::{self, OpenOptions},
    io::Write as _,
    path::{Path, PathBuf},
};

use anyhow::{Context as _, bail};
use clap::ValueEnum;
use default_encoder::{
    batches::{Sizes, batch},
    cities::{self, VISITS},
};
use sue::net::{self, Learned, Lesson, Training};
use vpr_core::Error;
use vpr_nets::{
    loss::{LogVariance, SelfTeaching},
    model::default::{DefaultEncoderConfig, INPUT},
    train::{Checkpoint, Report},
};
use vpr_report::cli::{self, Outcome};

/// First line of a log.
const HEAD: &str = "step,loss,rate\n";

/// What to train, on how much.
#[derive(clap::Args)]
pub(crate) struct TrainArgs {
    /// Which network
    learned: Learned,
    /// Weights of the default network: where BTL starts, STUN's teacher
    #[arg(long, value_name = "FILE", default_value = "data/models/default-encoder.safetensors")]
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
        if self.places == 0 || !self.places.is_multiple_of(4) {
            bail!("--places {}: must be a multiple of 4", self.places);
        }
        if !(2..=VISITS).contains(&self.views) {
            bail!("--views {}: must be 2 to {VISITS}", self.views);
        }
        if self.cities == 0 || self.steps == 0 {
            bail!("--cities and --steps must be at least 1");
        }
        Ok(())
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

    /// Everything that two runs must share to be one.
    fn facts(&self) -> Vec<(&'static str, String)> {
        let mut facts = vec![
            ("network", format!("{} on the default network", self.learned.name())),
            ("trained_on", format!("{} generated street cities", self.cities)),
            ("seed", self.seed.to_string()),
            ("steps", self.steps.to_string()),
            ("batch", format!("{} places x {} images", self.places, self.views)),
            ("rate", self.rate().to_string()),
            ("input", format!("{} x {}, RGB in 0 to 1", INPUT.0, INPUT.1)),
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
    let config = DefaultEncoderConfig::new();
    if !args.from.is_file() {
        bail!(
            "{}: no such file; `cargo xtask train default-encoder` makes it",
            args.from.display()
        );
    }
    let encoder = net::default_network(&config, &args.from)?;
    let albums = cities::open(args.cities, args.seed, &args.cache)?;
    if args.render_only {
        return Ok(Outcome::Success);
    }
    claim(&checkpoints, &args.facts())?;
    let training = Training { config, steps: args.steps, rate: args.rate(), seed: args.seed };
    let sizes = Sizes { input: INPUT, places: args.places, views: args.views };
    let batch = |step| Ok(batch(&albums, sizes, args.seed, step));
    let mut log = Log::open(output.with_extension("log.csv"))?;
    let observe = |report: &Report| log.note(report);
    let checkpoint = Checkpoint::new(&checkpoints);
    match args.learned {
        Learned::Btl => {
            let network = training.btl(encoder, &checkpoint, batch, observe)?;
            net::save(&network, &output, &args.facts())?;
        }
        Learned::Stun => {
            let pair = training.stun(&encoder, args.lesson(), &checkpoint, batch, observe)?;
            net::save(pair.student(), &output, &args.facts())?;
        }
    }
    cli::note(&format!("generated: {}", output.display()));
    Ok(Outcome::Success)
}

/// Makes the folder this run's, or refuses one of a run with other settings.
fn claim(checkpoints: &Path, facts: &[(&str, String)]) -> anyhow::Result<()> {
    let path = checkpoints.join("run.txt");
    let lines: Vec<String> = facts.iter().map(|(key, value)| format!("{key}: {value}")).collect();
    let text = lines.join("\n") + "\n";
    match fs::read_to_string(&path) {
        Ok(found) if found == text => Ok(()),
        Ok(_) => bail!("{}: checkpoints of a run with other settings", checkpoints.display()),
        Err(_) => {
            fs::create_dir_all(checkpoints).with_context(|| checkpoints.display().to_string())?;
            fs::write(&path, text).with_context(|| path.display().to_string())
        }
    }
}

/// A line per step; a resumed run takes back the lines that it will write again.
struct Log {
    path: PathBuf,
    begun: bool,
    last: usize,
}

impl Log {
    /// Steps between two lines on the screen.
    const SHOWN: usize = 25;

    fn open(path: PathBuf) -> anyhow::Result<Self> {
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
        }
        Ok(Self { path, begun: false, last: 0 })
    }

    fn note(&mut self, report: &Report) -> vpr_core::Result<()> {
        if !self.begun {
            let kept = kept(&fs::read_to_string(&self.path).unwrap_or_default(), report.step);
            fs::write(&self.path, kept).map_err(Error::io(&self.path))?;
            self.begun = true;
        }
        let line = format!("{},{:.5},{:.3e}\n", report.step, report.loss, report.rate);
        if report.step >= self.last + Self::SHOWN {
            cli::note(line.trim_end());
            self.last = report.step;
        }
        OpenOptions::new()
            .append(true)
            .open(&self.path)
            .and_then(|mut file| file.write_all(line.as_bytes()))
            .map_err(Error::io(&self.path))
    }
}

/// The head and the whole lines of steps before `step`.
fn kept(log: &str, step: usize) -> String {
    let is_before = |line: &&str| {
        let number = line.split(',').next().and_then(|it| it.parse::<usize>().ok());
        line.ends_with('\n') && number.is_some_and(|it| it < step)
    };
    let lines: String = log.split_inclusive('\n').filter(is_before).collect();
    HEAD.to_owned() + &lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resumed_log_goes_on_where_the_checkpoint_was() {
        let log = "step,loss,rate\n1,0.5,1e-3\n2,0.4,1e-3\n3,0.3,1e-3\n4,0.2";
        assert_eq!(kept(log, 3), "step,loss,rate\n1,0.5,1e-3\n2,0.4,1e-3\n");
        assert_eq!(kept(log, 1), HEAD);
        assert_eq!(kept("", 1), HEAD);
    }

    #[test]
    fn a_folder_of_another_run_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let facts = |seed: &str| vec![("seed", seed.to_owned())];
        claim(folder.path(), &facts("1")).unwrap();
        claim(folder.path(), &facts("1")).unwrap();
        assert!(claim(folder.path(), &facts("2")).is_err());
    }
}
