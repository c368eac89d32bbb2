//! A training run: the folder that makes a killed one go on.

use std::{
    fmt,
    fs::{self, File, TryLockError},
    path::Path,
};

use vpr_core::Error as CoreError;
use vpr_files::replace;

use super::{Checkpoint, Descent, Learner, Log, Report};
use crate::{Error, Result};

/// The file of settings in the folder of a run.
const FACTS: &str = "run.txt";

/// A run in a folder of its own: its settings (`run.txt`), its checkpoints, and a log.
///
/// Opened again with the same settings after a kill, it takes the steps that are left and ends with
/// the same weights and the same log, bit by bit. The folder is locked as long as it is open.
#[derive(Debug)]
pub struct Run {
    checkpoint: Checkpoint,
    log: Log,
    /// Holds the lock.
    _facts: File,
}

/// A setting in which two runs differ.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// The setting.
    pub name: String,
    /// What the folder has.
    pub was: Option<String>,
    /// What was asked for.
    pub now: Option<String>,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = |value: &Option<String>| value.clone().unwrap_or_else(|| "absent".to_owned());
        write!(f, "{}: was {}, now {}", self.name, text(&self.was), text(&self.now))
    }
}

impl Run {
    /// Opens a folder, which need not exist yet, for a run with these settings. `facts` is
    /// everything that two runs must share to be one.
    ///
    /// # Errors
    ///
    /// [`Error::OtherRun`] with every setting that differs; [`CoreError::Io`] also if another
    /// process has the folder open; [`CoreError::Format`] if there are checkpoints without
    /// settings, if a setting is not one line, or as the log says.
    pub fn open(folder: &Path, facts: &[(&str, String)], mut log: Log) -> Result<Self> {
        let path = folder.join(FACTS);
        if let Some((name, _)) = facts.iter().find(|(_, value)| value.contains(['\n', '\r'])) {
            return Err(Error::format(path, *name, "is not one line"));
        }
        fs::create_dir_all(folder).map_err(CoreError::io(folder))?;
        let checkpoint = Checkpoint::new(folder);
        let done = checkpoint.latest()?;
        match fs::read_to_string(&path) {
            Ok(found) => {
                let differences = differences(&parsed(&path, &found)?, facts);
                if !differences.is_empty() {
                    return Err(Error::OtherRun { folder: folder.to_owned(), differences });
                }
            }
            Err(cause) if cause.kind() == std::io::ErrorKind::NotFound => {
                if done.is_some() {
                    let reason = "is not there, but checkpoints of some run are";
                    return Err(Error::format(path, "settings", reason));
                }
                let lines = facts.iter().map(|(name, value)| format!("{name}: {value}\n"));
                replace(&path, lines.collect::<String>().as_bytes())?;
            }
            Err(cause) => return Err(CoreError::io(&path)(cause).into()),
        }
        let held = File::open(&path).map_err(CoreError::io(&path))?;
        match held.try_lock() {
            Err(cause @ TryLockError::WouldBlock) => {
                return Err(CoreError::io(&path)(cause.into()).into());
            }
            // A file system without locks: nothing warns of a second process.
            Ok(()) | Err(TryLockError::Error(_)) => {}
        }
        log.resume(done.unwrap_or(0))?;
        Ok(Self { checkpoint, log, _facts: held })
    }

    /// Trains from the newest checkpoint, or from `module` if there is none, as
    /// [`Descent::run`] does, and keeps the log.
    ///
    /// `cells` gives a line of the log, without the step: it is called with every step that has
    /// one and with the last, before the checkpoint of that step. Its report has the mean loss of
    /// the steps since the line before.
    ///
    /// # Errors
    ///
    /// Those of `batch`, of `cells`, of the log and of the checkpoint; [`CoreError::Parameter`] if
    /// checkpoints fall between two lines, where a mean would be lost.
    pub fn descend<M: Learner>(
        &mut self,
        descent: &Descent,
        module: M,
        batch: impl Fn(usize) -> vpr_core::Result<M::Batch> + Sync,
        mut cells: impl FnMut(&Report, &M) -> vpr_core::Result<Vec<String>>,
    ) -> Result<M> {
        let every = self.log.every();
        if !descent.save_every.is_multiple_of(every) {
            let (name, value) = ("save_every", descent.save_every.to_string());
            let reason = "must be a multiple of the steps between two lines of the log";
            return Err(CoreError::Parameter { name, value, reason }.into());
        }
        let (mut sum, mut n) = (0.0, 0_usize);
        let observe = |report: &Report, module: &M| {
            (sum, n) = (sum + report.loss, n + 1);
            if !report.step.is_multiple_of(every) && report.step != descent.steps {
                return Ok(());
            }
            let mean = Report { loss: sum / n as f64, ..*report };
            (sum, n) = (0.0, 0);
            self.log.append(&report.step.to_string(), &cells(&mean, module)?)
        };
        Ok(descent.run(module, &self.checkpoint, batch, observe)?)
    }

    /// Appends a line to the log that is not one of a step, such as that of the finished network. A
    /// run that is opened again takes it back.
    ///
    /// # Errors
    ///
    /// [`CoreError::Mismatch`] if there is not a cell for every column; [`CoreError::Io`].
    pub fn append(&mut self, label: &str, cells: &[String]) -> Result<()> {
        Ok(self.log.append(label, cells)?)
    }
}

/// Names and values of lines `name: value`.
fn parsed(path: &Path, text: &str) -> Result<Vec<(String, String)>> {
    let pair = |(number, line): (usize, &str)| {
        let (name, value) = line.split_once(": ").ok_or_else(|| {
            Error::format(path, format!("line {}", number + 1), "is not `name: value`")
        })?;
        Ok((name.to_owned(), value.to_owned()))
    };
    text.lines().enumerate().map(pair).collect()
}

/// What differs, in the order of `now`, then what is no longer there.
fn differences(was: &[(String, String)], now: &[(&str, String)]) -> Vec<Difference> {
    let old = |name: &str| was.iter().find(|(it, _)| it == name).map(|(_, value)| value.clone());
    let changed = now.iter().filter_map(|(name, value)| {
        let (was, now) = (old(name), Some(value.clone()));
        (was != now).then(|| Difference { name: (*name).to_owned(), was, now })
    });
    let gone = was.iter().filter(|(name, _)| now.iter().all(|(it, _)| it != name));
    let gone = gone.map(|(name, value)| Difference {
        name: name.clone(),
        was: Some(value.clone()),
        now: None,
    });
    changed.chain(gone).collect()
}

/// The lines of a message, one for each difference.
pub(crate) fn listed(folder: &Path, differences: &[Difference]) -> String {
    let lines: Vec<String> = differences.iter().map(ToString::to_string).collect();
    format!("{}: a run with other settings:\n{}", folder.display(), lines.join("\n"))
}

#[cfg(test)]
mod tests {
    use burn::{
        module::Module,
        nn::{Linear, LinearConfig},
        tensor::{Device, Tensor},
    };

    use super::*;
    use crate::train::{Batch, Optimizer, Schedule, Trainable, seeded};

    /// One linear layer over the mean colour of an image; its loss pulls places apart.
    #[derive(Module, Debug)]
    struct Tiny {
        layer: Linear,
    }

    impl Trainable for Tiny {
        fn loss(&self, images: Tensor<4>, places: &[usize]) -> Tensor<1> {
            let n = places.len();
            let colours = images.mean_dim(3).mean_dim(2).reshape([n, 3]);
            let wanted: Vec<f32> = places.iter().map(|&place| place as f32).collect();
            let wanted = Tensor::<1>::from_floats(&wanted[..], &Device::flex().autodiff());
            let found = self.layer.forward(colours).reshape([n]);
            (found - wanted).square().mean()
        }
    }

    const STEPS: usize = 6;

    fn fresh() -> Tiny {
        let layer = LinearConfig::new(3, 1).init(&Device::flex().autodiff());
        seeded(Tiny { layer }, 3)
    }

    fn batch(step: usize) -> Batch {
        let images = (0..2 * 3 * 4).map(|value| ((value * 7 + step) % 11) as f32 / 11.0).collect();
        Batch { images, size: (2, 2), places: vec![0, 1] }
    }

    fn descent() -> Descent {
        let schedule = Schedule::Cosine { rate: 0.1, last: 0.01, warmup: 2, steps: STEPS };
        let optimizer = Optimizer::AdamW { decay: 0.01 };
        Descent { steps: STEPS, schedule, optimizer, save_every: 2 }
    }

    fn facts(rate: &str) -> Vec<(&'static str, String)> {
        vec![("rate", rate.to_owned()), ("seed", "3".to_owned())]
    }

    fn open(folder: &Path, rate: &str) -> Result<Run> {
        Run::open(
            &folder.join("run"),
            &facts(rate),
            Log::new(&folder.join("log.csv"), &["loss"], 1),
        )
    }

    /// Trains until the batch of `last` is asked for, which fails as a kill would.
    fn train(folder: &Path, last: usize) -> Result<Vec<f32>> {
        let cells = |report: &Report, _: &Tiny| Ok(vec![format!("{:.6}", report.loss)]);
        let batch = |step| match step {
            step if step == last => Err(CoreError::Empty("power")),
            step => Ok(batch(step)),
        };
        let network = open(folder, "0.1")?.descend(&descent(), fresh(), batch, cells)?;
        Ok(network.layer.weight.val().into_data().try_to_vec().unwrap())
    }

    #[test]
    fn a_killed_run_goes_on_to_the_same_bits_and_the_same_log() {
        let (whole, killed) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let expected = train(whole.path(), STEPS).unwrap();
        // Killed after a checkpoint and a line that has none, twice.
        assert!(train(killed.path(), 3).is_err());
        assert!(train(killed.path(), 5).is_err());
        assert_eq!(train(killed.path(), STEPS).unwrap(), expected);
        let log = |folder: &Path| fs::read_to_string(folder.join("log.csv")).unwrap();
        assert_eq!(log(killed.path()), log(whole.path()));
        assert_eq!(log(whole.path()).lines().count(), 1 + STEPS);
    }

    #[test]
    fn other_settings_are_listed_and_an_open_folder_is_held() {
        let folder = tempfile::tempdir().unwrap();
        let held = open(folder.path(), "0.1").unwrap();
        assert!(open(folder.path(), "0.1").is_err(), "two processes in one folder");
        drop(held);
        open(folder.path(), "0.1").unwrap();
        let err = open(folder.path(), "0.2").unwrap_err().to_string();
        assert!(err.contains("\nrate: was 0.1, now 0.2") && !err.contains("seed"), "{err}");
    }
}
