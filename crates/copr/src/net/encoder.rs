//! Training of an encoder under the three losses of thesis §6.2.3: a new projection on the trunk of the
//! default network, which stays as it is, so that it takes a minute and no hour.

use std::path::Path;

use burn::{
    module::Module,
    tensor::{Device, Tensor, TensorData},
};
use serde::{Deserialize, Serialize};
use vpr_core::Error as CoreError;
use vpr_nets::{
    encode::registry::Method,
    loss::{Triplet, distance_based, relative_pose},
    model::default::{DefaultEncoder, DefaultEncoderConfig},
    regress::RELATIVE_POSE,
    train::{Descent, Learner, Log, Optimizer, Report, Run, Schedule, device, seeded},
    weights::{self, Precision, Weights},
};

use super::{
    Reach, ViewBatch, Views,
    best::{best, keep_if_best},
    head::RelativeHead,
};
use crate::Result;

/// What an encoder is trained to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum EncoderLoss {
    /// Images of one place are nearer than those of other rooms (eq. 6.5)
    Triplet,
    /// Two descriptors tell the pose between their cameras (eq. 6.6)
    Relative,
    /// Descriptors are as far apart as their cameras (eq. 6.7)
    Distance,
}

impl EncoderLoss {
    /// All three, in the order of table 6.4.
    pub const ALL: [Self; 3] = [Self::Triplet, Self::Relative, Self::Distance];

    /// The name of encoders that were trained so, where it is typed.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Triplet => "triplet",
            Self::Relative => "relative",
            Self::Distance => "distance",
        }
    }

    /// The pairs that it learns from: for a distance any two of a room; a relative pose can only be
    /// seen, and a place only be the same, where both cameras see the same things.
    #[must_use]
    pub fn reach(self) -> Reach {
        match self {
            Self::Triplet => Reach { metres: 0.5, degrees: 30.0 },
            Self::Relative => Reach { metres: 1.0, degrees: 45.0 },
            Self::Distance => Reach { metres: 2.0, degrees: 180.0 },
        }
    }
}

/// How to train an encoder.
#[derive(Clone, Debug, PartialEq)]
pub struct EncoderTraining {
    /// What it is trained to do.
    pub loss: EncoderLoss,
    /// Number of steps.
    pub steps: usize,
    /// Pairs of a step.
    pub batch: usize,
    /// Highest learning rate; it warms up and falls as a half cosine.
    pub rate: f64,
    /// The network is validated, logged and kept after so many steps.
    pub validated_every: usize,
    /// Decides pairs, their changes and the first weights of the head of a relative pose.
    pub seed: u64,
}

impl EncoderTraining {
    /// Settings that train in a minute. The thesis' learning rates are those of a whole ResNet-34.
    #[must_use]
    pub fn new(loss: EncoderLoss) -> Self {
        Self { loss, steps: 2000, batch: 128, rate: 1e-3, validated_every: 100, seed: 1984 }
    }

    /// The log that a training keeps.
    #[must_use]
    pub fn log(&self, path: &Path) -> Log {
        Log::new(path, &["loss", "rate", "validation"], self.validated_every)
    }

    /// Everything that two runs must share to be one; `start` stands for the network it begins with,
    /// `rooms` names where the images are from.
    #[must_use]
    pub fn facts(
        &self,
        (training, validation): (&Views, &Views),
        start: &str,
        rooms: &str,
    ) -> Vec<(&'static str, String)> {
        let Reach { metres, degrees } = self.loss.reach();
        let of = |views: &Views| format!("{} of {} rooms", views.len(), views.n_rooms());
        vec![
            ("loss", self.loss.name().to_owned()),
            ("begins_with", format!("default network, sha256 {start}")),
            ("rooms", rooms.to_owned()),
            ("images", format!("{}, {} for validation", of(training), of(validation))),
            ("features_digest", format!("{} {}", training.digest(), validation.digest())),
            ("pairs", format!("up to {metres} m and {degrees}° apart")),
            ("steps", self.steps.to_string()),
            ("batch", format!("{} pairs", self.batch)),
            ("rate", self.rate.to_string()),
            ("validated_every", self.validated_every.to_string()),
            ("seed", self.seed.to_string()),
            ("licence", "MIT OR Apache-2.0".to_owned()),
        ]
    }

    fn check(&self) -> Result<()> {
        let counts = [
            ("steps", self.steps),
            ("batch", self.batch),
            ("validated_every", self.validated_every),
        ];
        if let Some((name, _)) = counts.into_iter().find(|(_, count)| *count == 0) {
            let (value, reason) = ("0".to_owned(), "must be at least 1");
            return Err(CoreError::Parameter { name, value, reason }.into());
        }
        if !(self.rate.is_finite() && self.rate > 0.0) {
            let (value, reason) = (self.rate.to_string(), "must be positive");
            return Err(CoreError::Parameter { name: "rate", value, reason }.into());
        }
        Ok(())
    }
}

/// The default network and the SHA-256 of its weights: what every encoder of a clone begins as.
///
/// # Errors
///
/// [`vpr_nets::Error`] if the built-in weights do not fit.
pub fn default_network() -> Result<(DefaultEncoder, String)> {
    let weights = Method::find("default", None)?.built_in_weights()?;
    let digest = weights.digest().to_owned();
    let mut network = DefaultEncoderConfig::new().init(&device());
    weights.apply(&mut network)?;
    Ok((network, digest))
}

/// Batches of a validation.
const VALIDATION_BATCHES: usize = 8;
/// Validation draws from a stream that no training step has.
const VALIDATION_STREAM: usize = usize::MAX / 2;

/// Trains an encoder, or goes on with a killed training.
///
/// After every [`EncoderTraining::validated_every`] steps the mean loss of fixed pairs of `validation`
/// is logged, and the network is kept in `folder` if it is the best so
/// far; that one is written to `output`, with `facts`. `run` must be open in `folder`, with
/// [`EncoderTraining::log`].
///
/// # Errors
///
/// [`CoreError::Parameter`] for settings out of range; those of [`Views::batch`], of `observe`, of
/// [`Run::descend`] and of files.
pub fn train_encoder(
    settings: &EncoderTraining,
    network: DefaultEncoder,
    (training, validation): (&Views, &Views),
    run: &mut Run,
    folder: &Path,
    (output, facts): (&Path, &[(&str, String)]),
    mut observe: impl FnMut(&Report, f64) -> vpr_core::Result<()>,
) -> Result<()> {
    settings.check()?;
    let loss = settings.loss;
    let (reach, others) = (loss.reach(), loss == EncoderLoss::Triplet);
    let head = seeded(RelativeHead::new(network.dimension()), settings.seed);
    let fresh = Student { network, head, loss };
    let descent = Descent {
        steps: settings.steps,
        schedule: Schedule::warm_cosine(settings.steps, settings.rate),
        optimizer: Optimizer::AdamW { decay: 0.01 },
        save_every: settings.validated_every,
    };
    let (seed, n) = (settings.seed, settings.batch);
    let batch = |step| training.batch((seed, step), n, reach, others);
    let cells = |report: &Report, student: &Student| {
        let (student, mut sum) = (student.clone().valid(), 0.0);
        for number in 0..VALIDATION_BATCHES {
            let at = (seed, VALIDATION_STREAM + number);
            let batch = validation.batch(at, n, reach, others)?;
            let loss = student.learn(batch, &Device::flex());
            sum += f64::from(loss.into_scalar::<f32>());
        }
        let validation = sum / VALIDATION_BATCHES as f64;
        keep_if_best(folder, report.step, validation, &student.network)?;
        observe(report, validation)?;
        Ok(vec![
            format!("{:.5}", report.loss),
            format!("{:.3e}", report.rate),
            format!("{validation:.5}"),
        ])
    };
    run.descend(&descent, fresh, batch, cells)?;
    let (step, validation, path) =
        best(folder)?.ok_or_else(|| CoreError::format(folder, "best network", "is not there"))?;
    let mut network = DefaultEncoderConfig::new().init(&Device::flex());
    Weights::open(&path)?.apply(&mut network)?;
    run.append("best", &[String::new(), format!("step {step}"), format!("{validation:.5}")])?;
    let mut facts = facts.to_vec();
    facts.push(("best", format!("step {step}, validation loss {validation:.5}")));
    weights::save(&network, output, &facts, Precision::Half)?;
    Ok(())
}

/// An encoder while it learns.
#[derive(Module, Debug)]
struct Student {
    network: DefaultEncoder,
    head: RelativeHead,
    #[module(skip)]
    loss: EncoderLoss,
}

impl Learner for Student {
    type Batch = ViewBatch;

    fn learn(&self, batch: ViewBatch, device: &Device) -> Tensor<1> {
        let n = batch.n;
        let n_images = n * if self.loss == EncoderLoss::Triplet { 3 } else { 2 };
        let width = batch.features.len() / n_images.max(1);
        let features = TensorData::new(batch.features, [n_images, width]);
        let rows = self.network.project(Tensor::from_data(features, device));
        let part = |number: usize| rows.clone().narrow(0, number * n, n);
        match self.loss {
            EncoderLoss::Triplet => Triplet::default().forward(part(0), part(1), part(2)),
            EncoderLoss::Relative => {
                let truth = TensorData::new(batch.relative, [n, RELATIVE_POSE]);
                let truth = Tensor::from_data(truth, device);
                relative_pose(self.head.forward(part(0), part(1), false), truth)
            }
            EncoderLoss::Distance => {
                let metres = Tensor::from_data(TensorData::new(batch.metres, [n, 1]), device);
                distance_based(part(0), part(1), metres)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::net::views::tests::seen;

    fn settings(loss: EncoderLoss) -> EncoderTraining {
        EncoderTraining { steps: 6, batch: 3, validated_every: 2, ..EncoderTraining::new(loss) }
    }

    /// Trains in `folder`, stopping as a kill would when `last` validations were seen.
    fn trained(settings: &EncoderTraining, folder: &Path, last: usize) -> Result<Vec<u8>> {
        let views = seen(folder, 8)?;
        let (network, digest) = default_network()?;
        let facts = settings.facts((&views, &views), &digest, "two lines");
        let work = folder.join("work");
        let mut run = Run::open(&work, &facts, settings.log(&folder.join("log.csv")))?;
        let output = folder.join("encoder.safetensors");
        let mut seen = 0;
        let observe = |_: &Report, _| {
            seen += 1;
            if seen < last { Ok(()) } else { Err(CoreError::Empty("power")) }
        };
        let both = (&views, &views);
        train_encoder(settings, network, both, &mut run, &work, (&output, &facts), observe)?;
        Ok(fs::read(&output).unwrap())
    }

    #[test]
    fn a_killed_training_ends_with_the_same_bytes() {
        let (whole, killed) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let settings = settings(EncoderLoss::Relative);
        let expected = trained(&settings, whole.path(), 99).unwrap();
        assert!(trained(&settings, killed.path(), 2).unwrap_err().to_string().contains("power"));
        assert_eq!(trained(&settings, killed.path(), 99).unwrap(), expected);
        let path = whole.path().join("encoder.safetensors");
        let weights = Weights::open(&path).unwrap();
        assert_eq!(weights.facts()["loss"], "relative");
        assert!(weights.iter().all(|(key, _)| !key.contains("head.hidden")), "the head stays here");
        vpr_nets::encode::by_name("default", Some(&path), &[]).unwrap();
    }

    #[test]
    fn each_loss_falls_where_images_say_where_they_are() {
        for loss in EncoderLoss::ALL {
            let folder = tempfile::tempdir().unwrap();
            let settings =
                EncoderTraining { steps: 30, validated_every: 10, batch: 6, ..settings(loss) };
            trained(&settings, folder.path(), 99).unwrap();
            let log = fs::read_to_string(folder.path().join("log.csv")).unwrap();
            let last = |line: &str| line.rsplit(',').next().unwrap().parse::<f64>().unwrap();
            let values: Vec<f64> = log.lines().skip(1).map(last).collect();
            assert!(values[3] <= values[0], "{loss:?}: {log}");
            let mean = |line: &str| line.split(',').nth(1).unwrap().parse::<f64>().unwrap();
            let (first, third) = (log.lines().nth(1).unwrap(), log.lines().nth(3).unwrap());
            assert!(mean(third) < mean(first), "{loss:?}: {log}");
        }
    }

    #[test]
    fn impossible_settings_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let wrong = EncoderTraining { rate: f64::NAN, ..settings(EncoderLoss::Distance) };
        let err = trained(&wrong, folder.path(), 99).unwrap_err().to_string();
        assert!(err.contains("`rate` = NaN"), "{err}");
        let wrong = EncoderTraining { batch: 0, ..settings(EncoderLoss::Distance) };
        assert!(wrong.check().unwrap_err().to_string().contains("batch"));
    }
}
