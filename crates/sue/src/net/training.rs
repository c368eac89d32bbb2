//! Training on batches by number.

use std::path::Path;

use vpr_nets::{
    loss::{LogVariance, SelfTeaching},
    model::default::{DefaultEncoder, DefaultEncoderConfig},
    train::{Batch, Descent, Log, Report, Run, Trainable, device},
    weights,
};

use super::{Btl, SelfTaught, Stun};
use crate::Result;

/// Steps between two checkpoints.
const SAVE_EVERY: usize = 25;

/// How to train on the default network.
#[derive(Clone, Debug)]
pub struct Training {
    /// Sizes of the default network.
    pub config: DefaultEncoderConfig,
    /// Number of steps.
    pub steps: usize,
    /// Highest learning rate, as [`Descent::adam_w`] takes it.
    pub rate: f64,
    /// Decides the weights that training begins with.
    pub seed: u64,
}

/// What a student learns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lesson {
    /// The loss.
    pub loss: SelfTeaching,
    /// How the variance head is read in training; in use it is always [`LogVariance::Sigmoid`].
    pub log_variance: LogVariance,
}

/// The default network with these weights, as other heads start from it or are taught by it.
///
/// # Errors
///
/// [`vpr_nets::Error::Weights`] with the file and its keys that do not fit.
pub fn default_network(config: &DefaultEncoderConfig, path: &Path) -> Result<DefaultEncoder> {
    let mut network = config.init(&device());
    weights::load(&mut network, path, &[])?;
    Ok(network)
}

impl Training {
    /// The log that a run of such a training keeps: a line per step.
    #[must_use]
    pub fn log(path: &Path) -> Log {
        Log::new(path, &["loss", "rate"], 1)
    }

    /// Trains the Bayesian triplet loss from `encoder`'s weights, or goes on from the run's newest
    /// checkpoint. `batch(step)` must depend on nothing but `step`; `observe` is called after every
    /// step. The run's log is a [`Self::log`].
    ///
    /// # Errors
    ///
    /// Those of `batch`, of `observe` and of [`Run::descend`].
    pub fn btl(
        &self,
        encoder: DefaultEncoder,
        run: &mut Run,
        batch: impl Fn(usize) -> vpr_core::Result<Batch> + Sync,
        observe: impl FnMut(&Report) -> vpr_core::Result<()>,
    ) -> Result<Btl<DefaultEncoder>> {
        let images = batch(self.steps)?.tensor(&device());
        let network = Btl::init(&self.config, &device()).start(encoder, self.seed, images);
        self.descend(network, run, batch, observe)
    }

    /// Trains STUN's student under a teacher, or goes on from the newest checkpoint; otherwise as
    /// [`Self::btl`].
    ///
    /// # Errors
    ///
    /// Those of `batch`, of `observe` and of [`Run::descend`].
    pub fn stun(
        &self,
        teacher: &DefaultEncoder,
        lesson: Lesson,
        run: &mut Run,
        batch: impl Fn(usize) -> vpr_core::Result<Batch> + Sync,
        observe: impl FnMut(&Report) -> vpr_core::Result<()>,
    ) -> Result<SelfTaught> {
        let images = batch(self.steps)?.tensor(&device());
        let student = Stun::init(&self.config, &device()).start(self.seed, images);
        let pair = SelfTaught::new(student, teacher, lesson.loss, lesson.log_variance);
        self.descend(pair, run, batch, observe)
    }

    fn descend<M: Trainable>(
        &self,
        module: M,
        run: &mut Run,
        batch: impl Fn(usize) -> vpr_core::Result<Batch> + Sync,
        mut observe: impl FnMut(&Report) -> vpr_core::Result<()>,
    ) -> Result<M> {
        let descent = Descent::adam_w(self.steps, self.rate, SAVE_EVERY);
        let network = run.descend(&descent, module, batch, |report, _| {
            observe(report)?;
            Ok(vec![format!("{:.5}", report.loss), format!("{:.3e}", report.rate)])
        })?;
        Ok(network)
    }
}
