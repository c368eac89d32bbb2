//! Fine-tuning: rounds of steps between two minings, until the held-out references no longer gain.

use std::path::Path;

use vpr_core::Error as CoreError;
use vpr_nets::{
    model::{
        Tunable,
        default::{DefaultEncoder, DefaultEncoderConfig},
    },
    train::{Checkpoint, Descent, Optimizer, Report, Run, Schedule, device},
    weights::{self, Precision, Weights},
};

use super::{
    Finetuning, Lessons, Material, Score, Student, Trial,
    best::{best, is_better, keep_if_best},
    mixture::{SHARES, mixed},
    parts::merged,
};
use crate::{Augmentations, Mined, ReferenceSet, Result, Split};

/// The network that it began with.
const START: &str = "start.safetensors";

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

impl Finetuning {
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
/// [`run_log`](super::run_log); `observe` is told of every round, after 0 steps too.
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
