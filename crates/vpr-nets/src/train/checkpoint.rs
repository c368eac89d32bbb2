//! Checkpoints: what a killed run goes on from.

use std::{
    fs::{self, File},
    path::{Path, PathBuf},
};

use burn::{
    module::Module,
    optim::{ModuleOptimizer, OptimizerRecord},
    store::{ModuleRecord, RecordError},
};
use vpr_core::{Error, Result};

/// Names of whole states begin with this.
const STEP: &str = "step-";
/// Names of those that are being written begin with this.
const PARTIAL: &str = ".partial-";

/// A folder with the state of a run: `step-N/{weights,optimizer}.bpk`, of which the newest counts.
///
/// A state is written under a temporary name, synced and renamed, so a kill leaves the last whole
/// one. A run that goes on from it takes the same steps as one that was never killed, bit by bit.
/// One process at a time writes to a folder; [`super::Run`] sees to it.
#[derive(Clone, Debug)]
pub struct Checkpoint {
    folder: PathBuf,
}

impl Checkpoint {
    /// The checkpoints in a folder, which need not exist yet.
    #[must_use]
    pub fn new(folder: &Path) -> Self {
        Self { folder: folder.to_owned() }
    }

    /// Steps done at the newest state; `None` if there is none.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] with the folder.
    pub fn latest(&self) -> Result<Option<usize>> {
        Ok(self.numbers(STEP)?.into_iter().max())
    }

    /// Writes the state after `step` steps and removes older ones.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] and [`Error::Format`] with the file.
    pub fn save<M: Module>(
        &self,
        step: usize,
        module: &M,
        optimizer: &ModuleOptimizer,
    ) -> Result<()> {
        let done = self.folder.join(format!("{STEP}{step}"));
        if done.exists() {
            return Ok(());
        }
        // What a killed run left.
        for process in self.numbers(PARTIAL)? {
            let left = self.folder.join(format!("{PARTIAL}{process}"));
            fs::remove_dir_all(&left).map_err(Error::io(&left))?;
        }
        let partial = self.folder.join(format!("{PARTIAL}{}", std::process::id()));
        fs::create_dir_all(&partial).map_err(Error::io(&partial))?;
        let weights = partial.join("weights.bpk");
        module.clone().into_record().save(&weights).map_err(broken(&weights))?;
        let state = partial.join("optimizer.bpk");
        optimizer.to_record().save(&state).map_err(broken(&state))?;
        for path in [&weights, &state] {
            File::open(path).and_then(|file| file.sync_all()).map_err(Error::io(path))?;
        }
        fs::rename(&partial, &done).map_err(Error::io(&done))?;
        for old in self.numbers(STEP)?.into_iter().filter(|old| *old != step) {
            let old = self.folder.join(format!("{STEP}{old}"));
            fs::remove_dir_all(&old).map_err(Error::io(&old))?;
        }
        Ok(())
    }

    /// The newest state: steps done, module, optimiser; `None` if there is none. `module` and
    /// `optimizer` give the shapes.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] and [`Error::Format`] with the file.
    pub fn load<M: Module>(
        &self,
        module: M,
        optimizer: ModuleOptimizer,
    ) -> Result<Option<(usize, M, ModuleOptimizer)>> {
        let Some(step) = self.latest()? else { return Ok(None) };
        let folder = self.folder.join(format!("{STEP}{step}"));
        let weights = folder.join("weights.bpk");
        let record = ModuleRecord::load(&weights).map_err(broken(&weights))?;
        let module = module.load_record(record);
        let state = folder.join("optimizer.bpk");
        let record = OptimizerRecord::load(&state).map_err(broken(&state))?;
        Ok(Some((step, module, optimizer.load_record(record))))
    }

    /// The numbers after `prefix` in the names of what is in the folder.
    fn numbers(&self, prefix: &str) -> Result<Vec<usize>> {
        if !self.folder.exists() {
            return Ok(Vec::new());
        }
        let mut numbers = Vec::new();
        for entry in fs::read_dir(&self.folder).map_err(Error::io(&self.folder))? {
            let name = entry.map_err(Error::io(&self.folder))?.file_name();
            let number = name.to_str().and_then(|name| name.strip_prefix(prefix));
            numbers.extend(number.and_then(|number| number.parse::<usize>().ok()));
        }
        Ok(numbers)
    }
}

fn broken(path: &Path) -> impl FnOnce(RecordError) -> Error {
    move |cause| Error::format(path, "checkpoint", cause.to_string())
}

#[cfg(test)]
mod tests {
    use burn::{
        nn::{Linear, LinearConfig},
        optim::GradientsParams,
        tensor::{Device, Tensor},
    };

    use super::*;
    use crate::train::{Optimizer, seeded};

    fn steps(
        n: usize,
        mut module: Linear,
        mut optimizer: ModuleOptimizer,
    ) -> (Linear, ModuleOptimizer) {
        let input = Tensor::<2>::from_floats([[1.0, 2.0, -1.0]], &Device::flex().autodiff());
        for _ in 0..n {
            let loss = (module.forward(input.clone()) - 1.0).square().sum();
            let gradients = GradientsParams::from_grads(loss.backward(), &module);
            module = optimizer.step(0.01, module, gradients);
        }
        (module, optimizer)
    }

    fn fresh() -> (Linear, ModuleOptimizer) {
        let linear = LinearConfig::new(3, 2).with_bias(false).init(&Device::flex().autodiff());
        (seeded(linear, 5), Optimizer::AdamW { decay: 0.01 }.init())
    }

    fn weights(module: &Linear) -> Vec<f32> {
        module.weight.val().into_data().try_to_vec().unwrap()
    }

    #[test]
    fn a_resumed_run_ends_with_the_same_bits() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join(".partial-1")).unwrap();
        let checkpoint = Checkpoint::new(folder.path());
        let (module, optimizer) = fresh();
        assert!(checkpoint.load(module, optimizer).unwrap().is_none());

        let (module, optimizer) = fresh();
        let whole = weights(&steps(9, module, optimizer).0);

        let (module, optimizer) = fresh();
        let (module, optimizer) = steps(2, module, optimizer);
        checkpoint.save(2, &module, &optimizer).unwrap();
        let (module, optimizer) = steps(3, module, optimizer);
        checkpoint.save(5, &module, &optimizer).unwrap();
        drop((module, optimizer));
        let (module, optimizer) = fresh();
        let (done, module, optimizer) = checkpoint.load(module, optimizer).unwrap().unwrap();
        assert_eq!(done, 5);
        assert_eq!(weights(&steps(4, module, optimizer).0), whole);
        let names = fs::read_dir(folder.path()).unwrap().map(|it| it.unwrap().file_name());
        assert_eq!(names.collect::<Vec<_>>(), ["step-5"]);
    }

    #[test]
    fn half_a_checkpoint_is_not_one_and_a_broken_one_is_named() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join(".partial-1")).unwrap();
        let checkpoint = Checkpoint::new(folder.path());
        let (module, optimizer) = fresh();
        assert!(checkpoint.load(module, optimizer).unwrap().is_none());
        let broken = folder.path().join("step-3");
        fs::create_dir(&broken).unwrap();
        fs::write(broken.join("weights.bpk"), b"nothing").unwrap();
        let (module, optimizer) = fresh();
        let err = checkpoint.load(module, optimizer).err().expect("it is broken").to_string();
        assert!(err.contains("weights.bpk"), "{err}");
    }
}
