//! Fine-tuning: rounds of steps between two minings, until the held-out references no longer gain.

use std::{
    fs,
    path::{Path, PathBuf},
};

use serde::Deserialize;
use vpr_core::Error as CoreError;
use vpr_nets::{
    model::{
        Tunable,
        default::{DefaultEncoder, DefaultEncoderConfig},
    },
    train::{Checkpoint, Descent, Log, Optimizer, Report, Run, Schedule, device},
    weights::{self, Precision, Weights},
};

use super::{
    Lessons, Material, Parts, Score, Student, Trial,
    mixture::{SHARES, mixed},
    parts::merged,
};
use crate::{Augmentations, Mined, MiningParams, Preset, ReferenceSet, Result, Split};

/// Steps between two lines of the log.
const LOG_EVERY: usize = 5;
/// What the best network so far is called; step and score follow.
const BEST: &str = "best-";
/// The network that it began with.
const START: &str = "start.safetensors";

/// How to fine-tune. Of these the thesis gives the learning rate alone, 1e-7 for its `DINOv2` models;
/// the default network, of 0.65 M parameters, needs a larger one. Steps, batch and rate of the default
/// are those, of a few, after which held-out references of the generated railway were found best; no
/// query was looked at. That the network is mixed with the one before was decided after the recall
/// of rail's queries had been seen; the share is chosen by held-out references.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Finetuning {
    /// Most steps, a multiple of those of a round.
    pub steps: usize,
    /// Steps between two minings and validations, a multiple of 5.
    pub round: usize,
    /// Rounds without a gain after which it ends.
    pub patience: usize,
    /// Triplets of a step.
    pub batch: usize,
    /// Learning rate of Adam, after a warm-up over the first twentieth; 0 changes nothing.
    pub rate: f64,
    /// Margin of the triplet loss.
    pub margin: f64,
    /// Which references are compared.
    pub mining: MiningParams,
    /// How queries are made of references.
    pub augmentations: Preset,
    /// How the held-out references are changed: always the same, so that what is tuned with other
    /// augmentations is judged alike.
    pub trial: Preset,
    /// Share of references that are not learned from but say when it was best.
    pub held_out: f64,
    /// Variants of each of them.
    pub variants: usize,
    /// What of the network learns.
    pub parts: Parts,
    /// Rank of its updates, where they have one.
    pub rank: usize,
    /// Parts of the network that stay as they are besides, by the names of its parameters.
    pub frozen: Vec<String>,
    /// Decides what is held out, drawn and changed.
    pub seed: u64,
}

impl Default for Finetuning {
    fn default() -> Self {
        Self {
            steps: 50,
            round: 25,
            patience: 6,
            batch: 16,
            rate: 3e-4,
            margin: 0.3,
            mining: MiningParams::default(),
            augmentations: Preset::All,
            trial: Preset::All,
            held_out: 0.15,
            variants: 4,
            parts: Parts::All,
            rank: 4,
            frozen: Vec::new(),
            seed: 1,
        }
    }
}

/// What came of it.
#[derive(Debug)]
pub struct Outcome<N = DefaultEncoder> {
    /// The network of the best validation; the one that it began with if none was better.
    pub network: N,
    /// Steps after which it was best; 0 for the network that it began with.
    pub best_step: usize,
    /// Share of the way from the network that it began with to the one of these steps.
    pub share: f32,
    /// What that network makes of the held-out references.
    pub best: Score,
    /// What the network that it began with makes of them.
    pub before: Score,
}

/// The log that a fine-tuning keeps.
#[must_use]
pub fn run_log(path: &Path) -> Log {
    Log::new(path, &["loss", "rate", "recall_held_out", "gap_held_out"], LOG_EVERY)
}

impl Finetuning {
    /// Steps for about five passes over a map of so many references, in whole rounds.
    #[must_use]
    pub fn steps_for(&self, n_references: usize) -> usize {
        let queries = n_references as f64 * (1.0 - self.held_out);
        let rounds = 5.0 * queries / (self.batch * self.round).max(1) as f64;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
        let rounds = rounds.round().max(1.0) as usize;
        rounds * self.round
    }

    /// Everything that two runs must share to be one; `weights` stands for the network that it
    /// begins with.
    #[must_use]
    pub fn facts(&self, material: &Material, weights: &str) -> Vec<(&'static str, String)> {
        let MiningParams { positive_m, negative_m, hardest } = self.mining;
        let mining = match material.poses() {
            Some(_) => {
                format!("positives to {positive_m} m, the {hardest} hardest from {negative_m} m")
            }
            None => "no poses, random negatives".to_owned(),
        };
        vec![
            ("finetuned_from", weights.to_owned()),
            ("references", format!("{}, digest {}", material.len(), material.digest())),
            ("mining", mining),
            ("augmentations", self.augmentations.key().to_owned()),
            ("trial", format!("{}, {} variants", self.trial.key(), self.variants)),
            ("held_out", self.held_out.to_string()),
            ("steps", format!("{} in rounds of {}", self.steps, self.round)),
            ("patience", self.patience.to_string()),
            ("batch", format!("{} triplets", self.batch)),
            ("rate", self.rate.to_string()),
            ("margin", self.margin.to_string()),
            (
                "parts",
                match self.parts {
                    Parts::LowRank => format!("{}, rank {}", self.parts.key(), self.rank),
                    parts => parts.key().to_owned(),
                },
            ),
            ("frozen", self.frozen.join(" ")),
            ("seed", self.seed.to_string()),
            ("licence", "MIT OR Apache-2.0".to_owned()),
        ]
    }

    /// Checks the numbers.
    ///
    /// # Errors
    ///
    /// [`CoreError::Parameter`] with the first that is out of range.
    pub fn check(&self) -> Result<()> {
        let refuse = |name, value: String, reason| -> Result<()> {
            Err(CoreError::Parameter { name, value, reason }.into())
        };
        self.mining.check()?;
        if self.round == 0 || !self.round.is_multiple_of(LOG_EVERY) {
            return refuse("round", self.round.to_string(), "must be a multiple of 5 steps");
        }
        if self.steps == 0 || !self.steps.is_multiple_of(self.round) {
            return refuse("steps", self.steps.to_string(), "must be a multiple of `round`");
        }
        for (name, count) in [
            ("batch", self.batch),
            ("patience", self.patience),
            ("variants", self.variants),
            ("rank", self.rank),
        ] {
            if count == 0 {
                return refuse(name, "0".to_owned(), "must be at least 1");
            }
        }
        for (name, value) in [("rate", self.rate), ("margin", self.margin)] {
            if !(value >= 0.0 && value.is_finite()) {
                return refuse(name, value.to_string(), "must be a number from 0");
            }
        }
        Ok(())
    }

    /// The network as it learns.
    fn student<N: Tunable>(&self, network: N) -> Result<Student<N>> {
        let (network, frozen) = self.parts.prepare(network, &self.frozen, self.rank, self.seed)?;
        Student::new(network, self.margin, &frozen)
    }

    fn mine<N: Tunable>(
        &self,
        student: &Student<N>,
        material: &Material,
        split: &Split,
    ) -> Result<Mined> {
        let Some(poses) = material.poses() else {
            return Mined::without_poses(material.len(), &split.training);
        };
        self.mining.with_poses(
            &material.describe(&merged(student.network()))?,
            poses,
            &split.training,
        )
    }
}

/// Fine-tunes a network on a map, or goes on with a fine-tuning that was killed, to the same bits.
///
/// A round mines triplets with the network as it is, takes [`Finetuning::round`] steps, and looks
/// held-out references up under augmentations that training does not draw. The best network is kept
/// in `folder`; after [`Finetuning::patience`] rounds without a gain it ends. Then the held-out
/// references say how much of the way to the best network is gone: a quarter, half, three quarters or
/// all of it, since less than all keeps more of what was known. `run` must be open in `folder`, with
/// [`run_log`]; `observe` is told of every round, after 0 steps too.
///
/// # Errors
///
/// [`CoreError::Parameter`] for numbers out of range; [`crate::Error::OnePlace`] and
/// [`crate::Error::TooFew`] for a map with nothing to tell apart; [`crate::Error::NoSuchPart`]; those
/// of `observe`, of [`Run::descend`] and of files.
pub fn finetune<N: Tunable>(
    settings: &Finetuning,
    network: N,
    (set, material): (&ReferenceSet, &Material),
    run: &mut Run,
    folder: &Path,
    mut observe: impl FnMut(usize, f64, Score) -> vpr_core::Result<()>,
) -> Result<Outcome<N>> {
    settings.check()?;
    let split = set.split(settings.held_out, settings.seed)?;
    let augmentations = settings.augmentations.augmentations();
    let unseen = settings.trial.augmentations();
    let trial = Trial::new(
        material,
        &split.held_out,
        settings.variants,
        &unseen,
        (&settings.mining, settings.seed),
    )?;
    let judge = |network: &N| trial.score(network, &material.describe(network)?);
    let before = judge(&network)?;
    observe(0, f64::NAN, before)?;
    keep_if_best(folder, 0, before, &network)?;
    weights::save(&network, &folder.join(START), &[], Precision::Single)?;
    let like = network.clone();
    let mut student = settings.student(network)?;
    let done = Checkpoint::new(folder).latest()?.unwrap_or(0) / settings.round;
    for round in done..=settings.steps / settings.round {
        let descent = |rounds: usize| Descent {
            steps: rounds * settings.round,
            schedule: Schedule::warm_cosine(settings.steps, settings.rate),
            optimizer: Optimizer::Adam,
            save_every: settings.round,
        };
        if round == done && done > 0 {
            // Brings the module of the checkpoint back; no step is left.
            let none = |_| Err(CoreError::Empty("steps"));
            student = run.descend(&descent(done), student, none, |_, _| Ok(Vec::new()))?;
        }
        let best_step = best(folder)?.map_or(0, |it| it.0);
        let since = (round * settings.round).saturating_sub(best_step);
        if round * settings.round >= settings.steps || since >= settings.patience * settings.round {
            break;
        }
        student = one_round(
            settings,
            (student, round, &descent(round + 1)),
            (material, &split, &augmentations),
            run,
            |report, network| {
                let score = judge(network)?;
                keep_if_best(folder, report.step, score, network)?;
                observe(report.step, report.loss, score)?;
                Ok(score)
            },
        )?;
    }
    chosen(folder, like, before, judge)
}

/// The best network in a folder, or one on the way to it.
fn chosen<N: Tunable>(
    folder: &Path,
    like: N,
    before: Score,
    judge: impl Fn(&N) -> Result<Score>,
) -> Result<Outcome<N>> {
    let (best_step, best, path) =
        best(folder)?.ok_or_else(|| CoreError::format(folder, "best network", "is not there"))?;
    let [start, end] = [Weights::open(&folder.join(START))?, Weights::open(&path)?];
    let best = Score { n: before.n, ..best };
    let network = mixed(like.clone(), &start, &end, 1.0)?;
    let whole = Outcome { network, best_step, share: 1.0, best, before };
    if best_step == 0 {
        return Ok(whole);
    }
    SHARES.iter().rev().try_fold(whole, |outcome, &share| {
        let network = mixed(like.clone(), &start, &end, share)?;
        let best = judge(&network)?;
        Ok(if is_better(&best, &outcome.best) {
            Outcome { network, share, best, ..outcome }
        } else {
            outcome
        })
    })
}

fn is_better(new: &Score, old: &Score) -> bool {
    (new.recall, new.gap) > (old.recall, old.gap)
}

/// The network after the last step that was saved in a folder, whether it was best or not.
///
/// # Errors
///
/// [`CoreError::Format`] if there is none; those of files.
pub fn last(settings: &Finetuning, folder: &Path) -> Result<DefaultEncoder> {
    let network = DefaultEncoderConfig::new().init(&device());
    let student = settings.student(network)?;
    let saved = Checkpoint::new(folder).load(student, Optimizer::Adam.init())?;
    let (_, student, _) =
        saved.ok_or_else(|| CoreError::format(folder, "checkpoint", "is not there"))?;
    Ok(merged(student.network()))
}

/// Mines, and takes the steps of a round.
fn one_round<N: Tunable>(
    settings: &Finetuning,
    (student, round, descent): (Student<N>, usize, &Descent),
    (material, split, augmentations): (&Material, &Split, &Augmentations),
    run: &mut Run,
    mut judged: impl FnMut(&Report, &N) -> Result<Score>,
) -> Result<Student<N>> {
    let mined = settings.mine(&student, material, split)?;
    let lessons = Lessons::new(material, mined, augmentations, settings.batch, settings.seed)?;
    let end = (round + 1) * settings.round;
    let cells = |report: &Report, student: &Student<N>| {
        let mut cells = vec![format!("{:.5}", report.loss), format!("{:.3e}", report.rate)];
        if report.step == end {
            let score = judged(report, &merged(student.network())).map_err(core)?;
            cells.extend([format!("{:.4}", score.recall), format!("{:.5}", score.gap)]);
        } else {
            cells.extend([String::new(), String::new()]);
        }
        Ok(cells)
    };
    let batch = |step| lessons.batch(step).map_err(core);
    Ok(run.descend(descent, student, batch, cells)?)
}

/// What a loop of `vpr-nets` can pass on.
fn core(err: crate::Error) -> CoreError {
    match err {
        crate::Error::Core(err) => err,
        crate::Error::Nets(err) => err.into(),
        other => CoreError::format("references", "triplets", other.to_string()),
    }
}

/// Keeps a network if none is better: by recall, then by gap. One that a killed run had reached after
/// its last checkpoint is reached again, with the same score.
fn keep_if_best<N: Tunable>(folder: &Path, step: usize, score: Score, network: &N) -> Result<()> {
    let before = best(folder)?;
    if before.as_ref().is_some_and(|(_, old, _)| !is_better(&score, old)) {
        return Ok(());
    }
    let (recall, gap) = (score.recall.to_bits(), score.gap.to_bits());
    let path = folder.join(format!("{BEST}{step}-{recall:016x}-{gap:016x}.safetensors"));
    weights::save(network, &path, &[], Precision::Single)?;
    if let Some((_, _, old)) = before {
        fs::remove_file(&old).map_err(CoreError::io(&old))?;
    }
    Ok(())
}

/// Step, score (without its number of variants) and file of the best network in a folder.
fn best(folder: &Path) -> Result<Option<(usize, Score, PathBuf)>> {
    let mut all = Vec::new();
    for entry in fs::read_dir(folder).map_err(CoreError::io(folder))? {
        let path = entry.map_err(CoreError::io(folder))?.path();
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        let parts = name.strip_prefix(BEST).and_then(|name| name.strip_suffix(".safetensors"));
        let parsed = parts.and_then(|parts| {
            let mut parts = parts.split('-');
            let step = parts.next()?.parse::<usize>().ok()?;
            let mut bits = || Some(f64::from_bits(u64::from_str_radix(parts.next()?, 16).ok()?));
            Some((step, Score { recall: bits()?, gap: bits()?, n: 0 }))
        });
        all.extend(parsed.map(|(step, score)| (step, score, path)));
    }
    let order = |a: &(usize, Score, PathBuf), b: &(usize, Score, PathBuf)| {
        let by_score = a.1.recall.total_cmp(&b.1.recall).then(a.1.gap.total_cmp(&b.1.gap));
        by_score.then(b.0.cmp(&a.0))
    };
    Ok(all.into_iter().max_by(order))
}
