//! Training of H on descriptors of a frozen encoder.

use std::path::{Path, PathBuf};

use burn::{
    module::Module,
    store::ModuleSnapshot,
    tensor::{Device, Tensor, TensorData},
};
use vpr_core::{Definition, Error as CoreError};
use vpr_nets::{
    regress::{DescriptorRegressor, DescriptorRegressorConfig, RELATIVE_POSE},
    train::{Descent, Learner, Log, Optimizer, Report, Run, Schedule, device, seeded},
    weights::{self, Precision, Weights},
};

use super::{
    NetworkRegressor, PairBatch, Pairs,
    best::{best, keep_if_best},
};
use crate::Result;

/// What the released loss multiplies the mean squared error by (C-6).
const SCALE: f64 = 1000.0;

/// How to train; the numbers by default are the released ones but for the length.
#[derive(Clone, Debug, PartialEq)]
pub struct Training {
    /// Number of steps; at most 800 000 as released, where the best came long before.
    pub steps: usize,
    /// Pairs of a step.
    pub batch: usize,
    /// Learning rate of the first step.
    pub rate: f64,
    /// The rate is halved after so many steps.
    pub halved_every: usize,
    /// The network is validated, logged and kept after so many steps.
    pub validated_every: usize,
    /// Decides first weights and the order of pairs.
    pub seed: u64,
    /// Hidden layers, 7 in the thesis.
    pub hidden_layers: usize,
}

impl Default for Training {
    fn default() -> Self {
        Self {
            steps: 26_000,
            batch: 32,
            rate: 5e-4,
            halved_every: 50_000,
            validated_every: 1300,
            seed: 1984,
            hidden_layers: 7,
        }
    }
}

impl Training {
    /// The log that a training keeps.
    #[must_use]
    pub fn log(&self, path: &Path) -> Log {
        Log::new(path, &["loss", "rate", "validation"], self.validated_every)
    }

    /// Everything that two runs must share to be one; `encoder` names whose descriptors they are.
    #[must_use]
    pub fn facts(
        &self,
        training: &Pairs,
        validation: &Pairs,
        encoder: &str,
    ) -> Vec<(&'static str, String)> {
        let relative = match training.definition() {
            Definition::Published => "published",
            Definition::Corrected => "corrected",
        };
        vec![
            ("network", format!("H of {} hidden layers", self.hidden_layers)),
            ("encoder", encoder.to_owned()),
            ("relative_pose", relative.to_owned()),
            ("pairs", format!("{} and {} for validation", training.len(), validation.len())),
            ("pairs_digest", format!("{} {}", training.digest(), validation.digest())),
            ("dimension", training.dim().to_string()),
            ("steps", self.steps.to_string()),
            ("batch", self.batch.to_string()),
            ("rate", format!("{}, halved every {}", self.rate, self.halved_every)),
            ("validated_every", self.validated_every.to_string()),
            ("seed", self.seed.to_string()),
        ]
    }

    fn check(&self, training: &Pairs, validation: &Pairs) -> Result<()> {
        let counts = [
            ("steps", self.steps),
            ("batch", self.batch),
            ("halved_every", self.halved_every),
            ("validated_every", self.validated_every),
            ("hidden_layers", self.hidden_layers),
        ];
        if let Some((name, _)) = counts.into_iter().find(|(_, count)| *count == 0) {
            let (value, reason) = ("0".to_owned(), "must be at least 1");
            return Err(CoreError::Parameter { name, value, reason }.into());
        }
        if !(self.rate.is_finite() && self.rate > 0.0) {
            let (value, reason) = (self.rate.to_string(), "must be positive");
            return Err(CoreError::Parameter { name: "rate", value, reason }.into());
        }
        let what = "dimension of the validation's descriptors";
        let (expected, actual) = (training.dim(), validation.dim());
        if expected != actual {
            return Err(CoreError::Mismatch { what, expected, actual }.into());
        }
        if training.definition() != validation.definition() {
            let (name, value) = ("definition", validation.definition().to_string());
            let reason = "training and validation need the same relative poses";
            return Err(CoreError::Parameter { name, value, reason }.into());
        }
        Ok(())
    }
}

/// Trains H, or goes on with a killed training: Adam, mean squared error, the rate halved on the way.
///
/// After every [`Training::validated_every`] steps the mean loss over whole batches of the validation
/// pairs is logged, and the network is kept in `folder` if it is the best so far; that one is
/// written to `output`, with `facts`. `run` must be open in `folder`, with [`Training::log`].
///
/// # Errors
///
/// [`CoreError::Parameter`] and [`CoreError::Mismatch`] for settings and pairs that do not fit, those
/// of `observe` and of [`Run::descend`], [`CoreError::Io`] and [`CoreError::Format`] for files.
pub fn train(
    settings: &Training,
    (training, validation): (&Pairs, &Pairs),
    run: &mut Run,
    folder: &Path,
    (output, facts): (&Path, &[(&str, String)]),
    observe: impl FnMut(&Report, f64) -> vpr_core::Result<()>,
) -> Result<NetworkRegressor> {
    let config =
        DescriptorRegressorConfig::new(training.dim()).with_hidden_layers(settings.hidden_layers);
    let fresh = seeded(Pupil { network: config.init(&device()) }, settings.seed);
    let pairs = (training, validation);
    let (step, loss, path) =
        fitted(settings, fresh, pairs, (run, folder), |pupil| &pupil.network, observe)?;
    let mut network = config.init(&Device::flex());
    Weights::open(&path)?.apply(&mut network)?;
    let mut facts = facts.to_vec();
    facts.push(("best", format!("step {step}, validation loss {loss:.5}")));
    weights::save(&network, output, &facts, Precision::Half)?;
    NetworkRegressor::open(output)
}

/// Trains what learns from pairs; step, loss and file of the best network, which is the part of the
/// learner that `network` names.
pub(super) fn fitted<M: Learner<Batch = PairBatch>, N: ModuleSnapshot>(
    settings: &Training,
    fresh: M,
    (training, validation): (&Pairs, &Pairs),
    (run, folder): (&mut Run, &Path),
    network: impl Fn(&M) -> &N,
    mut observe: impl FnMut(&Report, f64) -> vpr_core::Result<()>,
) -> Result<(usize, f64, PathBuf)> {
    settings.check(training, validation)?;
    let schedule =
        Schedule::Steps { rate: settings.rate, every: settings.halved_every, factor: 0.5 };
    let (steps, save_every) = (settings.steps, settings.validated_every);
    let descent = Descent { steps, schedule, optimizer: Optimizer::Adam, save_every };
    let batch = |step| Ok(training.batch(step, settings.batch, settings.seed));
    let cells = |report: &Report, pupil: &M| {
        let loss = validation_loss(&pupil.clone().valid(), validation, settings.batch);
        keep_if_best(folder, report.step, loss, network(pupil))?;
        observe(report, loss)?;
        Ok(vec![
            format!("{:.5}", report.loss),
            format!("{:.3e}", report.rate),
            format!("{loss:.5}"),
        ])
    };
    run.descend(&descent, fresh, batch, cells)?;
    let (step, loss, path) =
        best(folder)?.ok_or_else(|| CoreError::format(folder, "best network", "is not there"))?;
    run.append("best", &[String::new(), format!("step {step}"), format!("{loss:.5}")])?;
    Ok((step, loss, path))
}

/// Mean of the loss over whole batches.
fn validation_loss<M: Learner<Batch = PairBatch>>(pupil: &M, pairs: &Pairs, size: usize) -> f64 {
    let (mut sum, mut n) = (0.0, 0_usize);
    for batch in pairs.batches(size) {
        let loss = pupil.learn(batch, &Device::flex());
        (sum, n) = (sum + f64::from(loss.into_scalar::<f32>()), n + 1);
    }
    sum / n.max(1) as f64
}

fn loss(network: &DescriptorRegressor, batch: PairBatch, device: &Device) -> Tensor<1> {
    let (n, dim) = (batch.n, batch.targets.len() / batch.n.max(1));
    let tensor = |values: Vec<f32>, width: usize| {
        Tensor::<2>::from_data(TensorData::new(values, [n, width]), device)
    };
    let found = network.forward(tensor(batch.anchors, dim), tensor(batch.relative, RELATIVE_POSE));
    (found - tensor(batch.targets, dim)).square().mean() * SCALE
}

/// H while it learns.
#[derive(Module, Debug)]
struct Pupil {
    network: DescriptorRegressor,
}

impl Learner for Pupil {
    type Batch = PairBatch;

    fn learn(&self, batch: PairBatch, device: &Device) -> Tensor<1> {
        loss(&self.network, batch, device)
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use ndarray::Array2;
    use vpr_core::{Descriptors, Map, Pose, Poses};

    use super::*;
    use crate::sequences;

    /// Descriptors that turn with the position along a line.
    fn pairs(n: usize, shift: f64) -> Pairs {
        let at = |row: usize| shift + 0.1 * row as f64;
        let rows = Array2::from_shape_fn((n, 3), |(row, column)| {
            crate::regression::narrow((at(row) + column as f64).sin())
        });
        let poses = (0..n).map(|row| Pose::translation(at(row), 0.0, 0.0)).collect();
        let map = Map::new(Descriptors::new(rows).unwrap(), Poses::SixDof(poses)).unwrap();
        Pairs::following(map, &sequences(None, n), 5, Definition::Corrected).unwrap()
    }

    fn settings() -> Training {
        Training {
            steps: 40,
            batch: 8,
            rate: 5e-3,
            validated_every: 10,
            hidden_layers: 2,
            ..Training::default()
        }
    }

    /// Trains in `folder`, stopping as a kill would when `last` validations were seen.
    fn trained(folder: &Path, last: usize) -> Result<Vec<u8>> {
        let (settings, training, validation) = (settings(), pairs(60, 0.0), pairs(20, 0.05));
        let facts = settings.facts(&training, &validation, "sines");
        let work = folder.join("work");
        let log = settings.log(&folder.join("log.csv"));
        let mut run = Run::open(&work, &facts, log)?;
        let output = folder.join("h.safetensors");
        let mut seen = 0;
        let observe = |_: &Report, _| {
            seen += 1;
            if seen < last { Ok(()) } else { Err(CoreError::Empty("power")) }
        };
        let both = (&training, &validation);
        train(&settings, both, &mut run, &work, (&output, &facts), observe)?;
        Ok(fs::read(&output).unwrap())
    }

    #[test]
    fn a_killed_training_ends_with_the_same_bytes_and_learns() {
        let (whole, killed) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let expected = trained(whole.path(), 99).unwrap();
        assert!(trained(killed.path(), 3).unwrap_err().to_string().contains("power"));
        assert_eq!(trained(killed.path(), 99).unwrap(), expected);
        let log = |folder: &Path| fs::read_to_string(folder.join("log.csv")).unwrap();
        assert_eq!(log(whole.path()), log(killed.path()));
        let text = log(whole.path());
        let validation: Vec<f64> = text
            .lines()
            .skip(1)
            .map(|line| line.rsplit(',').next().unwrap().parse().unwrap())
            .collect();
        assert_eq!(validation.len(), 5, "four validations and the best: {text}");
        assert!(validation[3] < 0.5 * validation[0], "{text}");
        assert_eq!(validation[4], validation[..4].iter().copied().fold(f64::MAX, f64::min));
    }

    #[test]
    fn another_run_is_not_gone_on_with() {
        let folder = tempfile::tempdir().unwrap();
        trained(folder.path(), 99).unwrap();
        let (settings, other) = (settings(), pairs(60, 0.3));
        let facts = settings.facts(&other, &pairs(20, 0.05), "sines");
        let log = settings.log(&folder.path().join("log.csv"));
        let err = Run::open(&folder.path().join("work"), &facts, log).unwrap_err().to_string();
        assert!(err.contains("pairs_digest"), "{err}");
    }

    #[test]
    fn a_mirrored_world_is_the_same_problem() {
        use crate::net::mirrored;

        // The weights of x and of the turns about y and z change sign, and so do these inputs.
        let network = DescriptorRegressorConfig::new(3).with_hidden_layers(1).init(&Device::flex());
        let folder = tempfile::tempdir().unwrap();
        let save = |network: &DescriptorRegressor, name: &str| {
            let path = folder.path().join(name);
            weights::save(network, &path, &[], Precision::Single).unwrap();
            path
        };
        let weights = Weights::open(&save(&network, "here")).unwrap();
        let flipped = weights.mapped(|key, mut tensor| {
            if key == "net_regdesc.0.weight" {
                // Rows of 3 + 7 inputs: the first and the last two of the relative pose.
                for row in tensor.data.chunks_mut(10) {
                    for at in [3, 8, 9] {
                        row[at] = -row[at];
                    }
                }
            }
            Some((key, tensor))
        });
        let mut other = network.clone();
        flipped.apply(&mut other).unwrap();
        let way = [0.3, -0.2, 0.9, 0.8, 0.1, -0.5, 0.2];
        let of = |network: &DescriptorRegressor, way: [f32; RELATIVE_POSE]| -> Vec<f32> {
            let anchor = Tensor::<2>::from_floats([[0.5, -0.1, 0.7]], &Device::flex());
            let way = Tensor::<2>::from_floats([way], &Device::flex());
            network.forward(anchor, way).into_data().try_to_vec().unwrap()
        };
        assert_eq!(of(&network, way), of(&other, mirrored(way)));
    }
}
