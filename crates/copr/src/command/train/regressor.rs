//! `copr train regressor`: the regression network H on descriptors of a frozen encoder.

use std::{
    ops::Range,
    path::{Path, PathBuf},
    slice,
    str::FromStr,
};

use anyhow::{bail, ensure};
use clap::ValueEnum;
use copr::{
    net::{Pairs, Training, train, train_pose},
    sequences,
    study::{Context, Paths, Place, Side, Study},
};
use vpr_core::{
    Definition, Map, Poses,
    map::{OpenMap, Opening},
};
use vpr_nets::train::Run;
use vpr_report::{
    cli::{self, Bar, DataArgs, Outcome},
    experiment,
};
use vpr_study::Sources;

use super::{super::run::CHAPTER, show};

/// Pairs, settings and output.
#[derive(clap::Args)]
pub(crate) struct RegressorArgs {
    /// Map whose images H learns from: each anchor with the images that follow it
    #[arg(long, value_name = "PATH", requires = "validation", conflicts_with = "experiment")]
    training: Option<PathBuf>,
    /// Map whose pairs say when H was best
    #[arg(long, value_name = "PATH", requires = "training")]
    validation: Option<PathBuf>,
    /// Instead of maps: the generated rooms of this experiment, queries for training and references
    /// for validation, as the thesis has it (C-10)
    #[arg(long, value_name = "FILE", required_unless_present = "training")]
    experiment: Option<PathBuf>,
    /// The experiment's place whose H it is: it learns from the other places of its kind that the
    /// experiment names, never from the place itself
    #[arg(long, requires = "experiment", value_name = "KEY")]
    place: Option<String>,
    /// Which of the experiment's encoders
    #[arg(long, default_value = "default", value_name = "NAME")]
    encoder: String,
    /// What it gives: a descriptor, from an anchor's and a pose, or the pose between two descriptors,
    /// as released (one linear map) or with an activation
    #[arg(long, value_enum, default_value_t = Gives::Descriptor, value_name = "WHAT")]
    gives: Gives,
    /// Learn from the sequences that the experiment leaves out of its maps and validate on those that
    /// it keeps: no query is seen
    #[arg(long, requires = "experiment", conflicts_with = "place")]
    held_out: bool,
    /// Learn nothing from these rooms of the experiment, by their keys
    #[arg(
        long,
        requires = "experiment",
        conflicts_with = "place",
        value_name = "KEY",
        value_delimiter = ','
    )]
    without: Vec<String>,
    #[command(flatten)]
    data: DataArgs,
    /// Every so many-th image of a sequence is an anchor [default: 50, or what the experiment says]
    #[arg(long, value_name = "K")]
    every: Option<usize>,
    /// Learn from every two images of a sequence so many metres and degrees apart or less, in both
    /// orders, instead of from each anchor and the images that follow it
    #[arg(long, value_name = "M,DEG", conflicts_with = "every")]
    near: Option<Limits>,
    /// Take at most so many of the training pairs and so many of those for validation, evenly
    #[arg(long, value_name = "N", default_value_t = usize::MAX, hide_default_value = true)]
    at_most: usize,
    /// Whether H is told of translations in the axes of the world, as released, or of the anchor
    #[arg(long, value_enum, default_value_t = Relative::Corrected, value_name = "NAME")]
    definition: Relative,
    /// The weights to write; the log lands beside them [default: data/models/copr-<PLACE or
    /// ENCODER>.safetensors, before the dot -pose and -held-out if so]
    #[arg(long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Folder of checkpoints [default: target/copr-<name of the output>]
    #[arg(long, value_name = "DIR")]
    checkpoints: Option<PathBuf>,
    /// Number of steps
    #[arg(long, default_value_t = Training::default().steps)]
    steps: usize,
    /// Pairs in a step
    #[arg(long, default_value_t = Training::default().batch)]
    batch: usize,
    /// Learning rate of the first step
    #[arg(long, default_value_t = Training::default().rate)]
    rate: f64,
    /// Steps after which the rate is halved
    #[arg(long, default_value_t = Training::default().halved_every)]
    halved_every: usize,
    /// Steps between two validations
    #[arg(long, default_value_t = Training::default().validated_every)]
    validated_every: usize,
    /// Hidden layers
    #[arg(long, default_value_t = Training::default().hidden_layers)]
    layers: usize,
    /// Decides first weights and the order of pairs
    #[arg(long, default_value_t = Training::default().seed)]
    seed: u64,
    /// Only say how many pairs there are
    #[arg(long)]
    dry_run: bool,
}

/// What a network gives.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Gives {
    /// H
    Descriptor,
    /// The pose of the second image seen from the first
    Pose,
    /// The same by one linear map
    PosePublished,
}

impl Gives {
    fn name(self) -> &'static str {
        match self {
            Self::Descriptor => "descriptor",
            Self::Pose => "pose",
            Self::PosePublished => "pose-published",
        }
    }
}

/// See [`Definition`].
#[derive(Clone, Copy, ValueEnum)]
enum Relative {
    /// In the axes of the world
    Published,
    /// In the axes of the anchor
    Corrected,
}

/// `0.8,30`
#[derive(Clone, Copy)]
struct Limits(f64, f64);

impl FromStr for Limits {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text.split_once(',').map(|(m, deg)| (m.trim().parse(), deg.trim().parse()));
        match parsed {
            Some((Ok(m), Ok(deg))) => Ok(Self(m, deg)),
            _ => Err(format!("`{text}` is not metres and degrees as in 0.8,30")),
        }
    }
}

/// Pairs to learn from, pairs to validate on, and whose descriptors they are.
struct Material {
    training: Pairs,
    validation: Pairs,
    encoder: String,
}

impl RegressorArgs {
    pub(super) fn run(&self) -> anyhow::Result<Outcome> {
        let Material { training, validation, encoder } = match (&self.training, &self.validation) {
            (Some(training), Some(validation)) => self.of_maps(training, validation)?,
            _ => self.of_rooms()?,
        };
        let settings = self.settings();
        if self.dry_run {
            let (n, n_validation, dim) = (training.len(), validation.len(), training.dim());
            cli::print(&format!(
                "training pairs: {n}\nvalidation pairs: {n_validation}\ndimension: {dim}\n"
            ))?;
            return Ok(Outcome::Success);
        }
        let called = self.place.as_deref().unwrap_or(&self.encoder);
        let held_out = if self.held_out { "-held-out" } else { "" };
        let gives = match self.gives {
            Gives::Descriptor => String::new(),
            other => format!("-{}", other.name()),
        };
        let name = format!("data/models/copr-{called}{gives}{held_out}.safetensors");
        let output = self.output.clone().unwrap_or_else(|| name.into());
        let stem = output.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let folder = self.checkpoints.clone();
        let folder = folder.unwrap_or_else(|| Path::new("target").join(format!("copr-{stem}")));
        let mut facts = settings.facts(&training, &validation, &encoder);
        if self.gives != Gives::Descriptor {
            facts.push(("gives", self.gives.name().to_owned()));
        }
        let log = settings.log(&output.with_extension("log.csv"));
        let mut run = Run::open(&folder, &facts, log)?;
        cli::resumes(&folder);
        let pairs = (&training, &validation);
        let definition = match self.gives {
            Gives::Descriptor => None,
            Gives::Pose => Some(Definition::Corrected),
            Gives::PosePublished => Some(Definition::Published),
        };
        let written = (output.as_path(), &facts[..]);
        if let Some(definition) = definition {
            train_pose(&settings, definition, pairs, &mut run, &folder, written, show)?;
            cli::note(&format!("generated: {}", output.display()));
        } else {
            let network = train(&settings, pairs, &mut run, &folder, written, show)?;
            cli::note(&format!("{}: sha256 {}", output.display(), network.digest()));
        }
        Ok(Outcome::Success)
    }

    fn settings(&self) -> Training {
        Training {
            steps: self.steps,
            batch: self.batch,
            rate: self.rate,
            halved_every: self.halved_every,
            validated_every: self.validated_every,
            seed: self.seed,
            hidden_layers: self.layers,
        }
    }

    fn definition(&self) -> Definition {
        match self.definition {
            Relative::Published => Definition::Published,
            Relative::Corrected => Definition::Corrected,
        }
    }

    /// The pairs of some sequences; of anchors every `every`-th image is one.
    fn pairs(&self, map: Map, sequences: &[Range<usize>], every: usize) -> copr::Result<Pairs> {
        let definition = self.definition();
        let all = match self.near {
            Some(Limits(metres, degrees)) => {
                Pairs::near(map, sequences, (metres, degrees), definition)
            }
            None => Pairs::following(map, sequences, every, definition),
        };
        Ok(all?.thinned(self.at_most))
    }

    fn of_maps(&self, training: &Path, validation: &Path) -> anyhow::Result<Material> {
        let every = self.every.unwrap_or(50);
        let open = |path: &Path| -> anyhow::Result<(Pairs, Option<String>)> {
            let map = OpenMap::open(path, Opening::default())?;
            ensure!(
                map.origins()?.is_none(),
                "{}: has regressed rows, which are nothing to learn from",
                path.display()
            );
            let sequences = sequences(map.names()?.as_ref(), map.len());
            let pairs = self
                .pairs(map.to_map()?, &sequences, every)
                .map_err(|err| anyhow::Error::from(err).context(path.display().to_string()))?;
            Ok((pairs, map.about().encoder.clone()))
        };
        let ((training, ours), (validation, theirs)) = (open(training)?, open(validation)?);
        ensure!(ours == theirs, "the maps are of different encoders: {ours:?} and {theirs:?}");
        let encoder = ours.unwrap_or_else(|| "unknown".to_owned());
        Ok(Material { training, validation, encoder })
    }

    /// All rooms of an experiment that every clone has, one after the other.
    fn of_rooms(&self) -> anyhow::Result<Material> {
        let Some(path) = &self.experiment else { bail!("give `--experiment` or `--training`") };
        let experiment = experiment::load::<Study>(path)?;
        let path = path.display();
        ensure!(experiment.chapter == CHAPTER, "{path}: belongs to `{}`", experiment.chapter);
        let bar = Bar::default();
        let (folders, cache) = (self.data.folders(), self.data.cache());
        let sources = Sources::new(folders.iter().map(PathBuf::as_path), &cache, &bar);
        let bare = Sources::new([], &cache, &bar);
        let seed = experiment.seed;
        let context = Context { sources: &sources, bare: &bare, seed, timings: false };
        if let Some(key) = &self.place {
            let Study::Lanes { places, .. } = &experiment.study else {
                bail!("{path}: has no places beside which a lane lies")
            };
            let Some(place) = places.iter().find(|it| it.key == *key) else {
                let known: Vec<&str> = places.iter().map(|it| it.key.as_str()).collect();
                bail!("{path}: no place `{key}`; known: {}", known.join(", "))
            };
            return self.of_place(place, context);
        }
        let Some((scenes, rooms)) = experiment.study.rooms() else {
            bail!("{path}: has no generated rooms; `--place` chooses one of its places")
        };
        let known = || scenes.iter().map(|it| it.key.as_str()).collect::<Vec<&str>>().join(", ");
        if let Some(key) = self.without.iter().find(|key| scenes.iter().all(|it| it.key != **key)) {
            bail!("{path}: no room `{key}`; known: {}", known())
        }
        let every = self.every.unwrap_or(rooms.every);
        let (mut training, mut validation) = (Joined::default(), Joined::default());
        for scene in scenes.iter().filter(|it| !self.without.contains(&it.key)) {
            let room = match rooms.open(scene, &self.encoder, Paths::Own, context)? {
                Ok(room) => room,
                Err(why) => bail!("{why}"),
            };
            if self.held_out {
                let Side { map, sequences } = &room.references;
                let is_left_out = |rows: &&Range<usize>| **rows != room.kept;
                let left_out: Vec<_> = sequences.iter().filter(is_left_out).cloned().collect();
                training.add(map, &left_out)?;
                validation.add(map, slice::from_ref(&room.kept))?;
            } else {
                training.add(&room.queries.map, &room.queries.sequences)?;
                validation.add(&room.references.map, &room.references.sequences)?;
            }
        }
        let encoder = self.encoder.clone();
        let (training, validation) = (training.pairs(self, every)?, validation.pairs(self, every)?);
        Ok(Material { training, validation, encoder })
    }
}

impl RegressorArgs {
    /// The other places of a kind, the last of them for validation.
    fn of_place(&self, place: &Place, context: Context<'_>) -> anyhow::Result<Material> {
        let lessons = match place.lessons(context)? {
            Ok(lessons) => lessons,
            Err(why) => bail!("{why}"),
        };
        ensure!(lessons.len() > 1, "`{}` names fewer than two places to learn from", place.key);
        let (mut training, mut validation) = (Joined::default(), Joined::default());
        for (number, map) in lessons.iter().enumerate() {
            let side = if number + 1 == lessons.len() { &mut validation } else { &mut training };
            side.add(map, slice::from_ref(&(0..map.len())))?;
        }
        let every = self.every.unwrap_or(50);
        let (training, validation) = (training.pairs(self, every)?, validation.pairs(self, every)?);
        Ok(Material { training, validation, encoder: place.encoder.clone() })
    }
}

/// Sequences of several rooms as one map.
#[derive(Default)]
struct Joined {
    values: Vec<f32>,
    poses: Vec<vpr_core::Pose>,
    sequences: Vec<Range<usize>>,
}

impl Joined {
    fn add(&mut self, map: &Map, sequences: &[Range<usize>]) -> anyhow::Result<()> {
        let poses = map.poses().six_dof()?;
        for rows in sequences {
            let start = self.poses.len();
            self.poses.extend_from_slice(&poses[rows.clone()]);
            for row in rows.clone() {
                self.values.extend(map.descriptors().row(row));
            }
            self.sequences.push(start..self.poses.len());
        }
        Ok(())
    }

    fn pairs(self, args: &RegressorArgs, every: usize) -> anyhow::Result<Pairs> {
        let dim = self.values.len() / self.poses.len().max(1);
        let rows = ndarray::Array2::from_shape_vec((self.poses.len(), dim), self.values)?;
        let map = Map::new(vpr_core::Descriptors::new(rows)?, Poses::SixDof(self.poses))?;
        Ok(args.pairs(map, &self.sequences, every)?)
    }
}
