//! `copr train encoder`: the default network's trunk under one of the three losses of thesis §6.2.3.

use std::path::{Path, PathBuf};

use anyhow::{bail, ensure};
use copr::{
    net::{EncoderLoss, EncoderTraining, Views, default_network, train_encoder},
    study::{Context, Paths, Study, encoder_weights},
};
use vpr_core::{Error, Pose};
use vpr_nets::train::Run;
use vpr_report::{
    cli::{self, Bar, DataArgs, Outcome},
    experiment,
};
use vpr_study::Sources;

use super::{super::run::CHAPTER, show};

/// Rooms, settings and output.
#[derive(clap::Args)]
pub(crate) struct EncoderArgs {
    /// What it is trained to do
    #[arg(long, value_enum, value_name = "NAME")]
    loss: EncoderLoss,
    /// The generated rooms of this experiment: queries for training and references for validation, as
    /// the thesis has it (C-10)
    #[arg(long, value_name = "FILE")]
    experiment: PathBuf,
    #[command(flatten)]
    data: DataArgs,
    /// The weights to write; the log lands beside them [default:
    /// data/models/copr-encoder-<LOSS>.safetensors]
    #[arg(long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Folder of checkpoints [default: target/copr-encoder-<LOSS>]
    #[arg(long, value_name = "DIR")]
    checkpoints: Option<PathBuf>,
    /// Number of steps
    #[arg(long, value_name = "N", default_value_t = EncoderTraining::new(EncoderLoss::Distance).steps)]
    steps: usize,
    /// Pairs in a step
    #[arg(long, value_name = "N", default_value_t = EncoderTraining::new(EncoderLoss::Distance).batch)]
    batch: usize,
    /// Highest learning rate
    #[arg(long, default_value_t = EncoderTraining::new(EncoderLoss::Distance).rate)]
    rate: f64,
    /// Steps between two validations
    #[arg(
        long,
        value_name = "N",
        default_value_t = EncoderTraining::new(EncoderLoss::Distance).validated_every
    )]
    validated_every: usize,
    /// Changed versions of every training image, as in the training of the network
    #[arg(long, value_name = "N", default_value_t = 3)]
    variants: usize,
    /// Decides pairs and changes
    #[arg(long, default_value_t = EncoderTraining::new(EncoderLoss::Distance).seed)]
    seed: u64,
    /// Only say how many images there are
    #[arg(long)]
    dry_run: bool,
}

/// Images and poses of a room.
type Seen = (Vec<PathBuf>, Vec<Pose>);

impl EncoderArgs {
    pub(super) fn run(&self) -> anyhow::Result<Outcome> {
        let (training, validation, rooms) = self.rooms()?;
        if self.dry_run {
            let count = |rooms: &[Seen]| rooms.iter().map(|it| it.0.len()).sum::<usize>();
            let (n, n_validation) = (count(&training), count(&validation));
            cli::print(&format!(
                "rooms: {}\ntraining images: {n}\nvalidation images: {n_validation}\n",
                training.len()
            ))?;
            return Ok(Outcome::Success);
        }
        let (network, digest) = default_network()?;
        let training = Views::open(&training, &network, (self.variants, self.seed))?;
        let validation = Views::open(&validation, &network, (0, self.seed))?;
        let settings = EncoderTraining {
            loss: self.loss,
            steps: self.steps,
            batch: self.batch,
            rate: self.rate,
            validated_every: self.validated_every,
            seed: self.seed,
        };
        let name = Path::new("data").join(encoder_weights(self.loss));
        let output = self.output.clone().unwrap_or(name);
        let folder = Path::new("target").join(format!("copr-encoder-{}", self.loss.name()));
        let folder = self.checkpoints.clone().unwrap_or(folder);
        let both = (&training, &validation);
        let facts = settings.facts(both, &digest, &rooms);
        let mut run = Run::open(&folder, &facts, settings.log(&output.with_extension("log.csv")))?;
        cli::resumes(&folder);
        train_encoder(&settings, network, both, &mut run, &folder, (&output, &facts), show)?;
        cli::note(&format!("generated: {}", output.display()));
        Ok(Outcome::Success)
    }

    /// Queries to learn from, references to validate on, and what the rooms are called.
    fn rooms(&self) -> anyhow::Result<(Vec<Seen>, Vec<Seen>, String)> {
        let experiment = experiment::load::<Study>(&self.experiment)?;
        let path = self.experiment.display();
        ensure!(experiment.chapter == CHAPTER, "{path}: belongs to `{}`", experiment.chapter);
        let Some((scenes, rooms)) = experiment.study.rooms() else {
            bail!("{path}: has no generated rooms")
        };
        let bar = Bar::default();
        let (folders, cache) = (self.data.folders(), self.data.cache());
        let sources = Sources::new(folders.iter().map(PathBuf::as_path), &cache, &bar);
        let bare = Sources::new([], &cache, &bar);
        let seed = experiment.seed;
        let context = Context { sources: &sources, bare: &bare, seed, timings: false };
        let (mut training, mut validation): (Vec<Seen>, Vec<Seen>) = (Vec::new(), Vec::new());
        for scene in scenes {
            let dataset = match rooms.images(scene, Paths::Own, context)? {
                Ok(dataset) => dataset,
                Err(why) => bail!("{why}"),
            };
            let none = || Error::Empty("poses of a generated room");
            let (queries, references) = dataset.poses.as_ref().ok_or_else(none)?;
            training.push((dataset.queries.clone(), queries.six_dof()?.to_vec()));
            validation.push((dataset.references.clone(), references.six_dof()?.to_vec()));
        }
        let names: Vec<String> = scenes.iter().map(|scene| rooms.world(scene)).collect();
        Ok((training, validation, names.join(" ")))
    }
}
