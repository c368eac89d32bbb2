//! The training loop: batches by number, one step each, checkpoints on the way.

use std::{sync::mpsc, thread};

use burn::{
    module::Module,
    optim::GradientsParams,
    tensor::{Device, Tensor, TensorData},
};
use vpr_core::Result;

use super::{Checkpoint, Optimizer, Schedule};

/// Images and what they show, without a tensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Batch {
    /// `n × 3 × height × width` values, red, green, blue in 0 to 1.
    pub images: Vec<f32>,
    /// Width and height.
    pub size: (usize, usize),
    /// Which place each image shows.
    pub places: Vec<usize>,
}

impl Batch {
    /// The images as a tensor `n × 3 × height × width`.
    ///
    /// # Panics
    ///
    /// If there are not as many values as places and size say.
    #[must_use]
    pub fn tensor(self, device: &Device) -> Tensor<4> {
        let shape = [self.places.len(), 3, self.size.1, self.size.0];
        Tensor::from_data(TensorData::new(self.images, shape), device)
    }
}

/// What can be trained: a module that turns a batch into a loss.
pub trait Trainable: Module {
    /// The loss of a batch, a tensor of shape `[1]`.
    fn loss(&self, images: Tensor<4>, places: &[usize]) -> Tensor<1>;
}

/// What learns from batches of any kind; [`Trainable`] is one that learns from images of places.
pub trait Learner: Module {
    /// What one step sees.
    type Batch: Send;

    /// The loss of a batch, a tensor of shape `[1]` on `device`.
    fn learn(&self, batch: Self::Batch, device: &Device) -> Tensor<1>;
}

impl<M: Trainable> Learner for M {
    type Batch = Batch;

    fn learn(&self, batch: Batch, device: &Device) -> Tensor<1> {
        let places = batch.places.clone();
        self.loss(batch.tensor(device), &places)
    }
}

/// How to train.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Descent {
    /// Number of steps.
    pub steps: usize,
    /// Learning rates.
    pub schedule: Schedule,
    /// What turns gradients into steps.
    pub optimizer: Optimizer,
    /// A checkpoint is written after every so many steps.
    pub save_every: usize,
}

/// One step that was taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Report {
    /// Steps taken, this one included.
    pub step: usize,
    /// The loss before this step.
    pub loss: f64,
    /// Its learning rate.
    pub rate: f64,
}

impl Descent {
    /// `AdamW` with decay 0.01 under [`Schedule::warm_cosine`]: how the networks of this workspace
    /// are trained.
    #[must_use]
    pub fn adam_w(steps: usize, rate: f64, save_every: usize) -> Self {
        let schedule = Schedule::warm_cosine(steps, rate);
        Self { steps, schedule, optimizer: Optimizer::AdamW { decay: 0.01 }, save_every }
    }

    /// Trains from the newest checkpoint, or from `module` if there is none.
    ///
    /// `batch(step)` must depend on nothing but `step`, so that a resumed run sees what the killed
    /// one would have seen; it runs ahead on a thread of its own. `observe` is called after every
    /// step with the module as it then is, before the checkpoint of that step: what it keeps of a
    /// step is there if the run goes on from it.
    ///
    /// # Errors
    ///
    /// Those of `batch`, of `observe` and of the checkpoint.
    pub fn run<M: Learner>(
        &self,
        module: M,
        checkpoint: &Checkpoint,
        batch: impl Fn(usize) -> Result<M::Batch> + Sync,
        mut observe: impl FnMut(&Report, &M) -> Result<()>,
    ) -> Result<M> {
        let device = Device::flex().autodiff();
        let mut optimizer = self.optimizer.init();
        let mut module = module;
        let mut first = 0;
        if let Some(state) = checkpoint.load(module.clone(), optimizer.clone())? {
            (first, module, optimizer) = state;
        }
        thread::scope(|scope| {
            let (sender, receiver) = mpsc::sync_channel(2);
            let batch = &batch;
            scope.spawn(move || {
                for step in first..self.steps {
                    // A closed channel means that the loop has ended early.
                    if sender.send(batch(step)).is_err() {
                        return;
                    }
                }
            });
            for (step, batch) in (first..self.steps).zip(receiver) {
                let batch = batch?;
                let loss = module.learn(batch, &device);
                let rate = self.schedule.rate(step);
                let value = f64::from(loss.clone().into_scalar::<f32>());
                let gradients = GradientsParams::from_grads(loss.backward(), &module);
                module = optimizer.step(rate, module, gradients);
                let report = Report { step: step + 1, loss: value, rate };
                observe(&report, &module)?;
                if report.step.is_multiple_of(self.save_every) || report.step == self.steps {
                    checkpoint.save(report.step, &module, &optimizer)?;
                }
            }
            Ok(module)
        })
    }
}
