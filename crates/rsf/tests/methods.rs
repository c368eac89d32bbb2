//! Fine-tuning of the heads on the default network's trunk, by the names of their methods.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{
    fs,
    path::{Path, PathBuf},
};

use rsf::{
    ReferenceSet, Result,
    net::{Finetuning, Material, finetune, run_log},
};
use vpr_core::{Error as CoreError, PlanarPosition, Poses};
use vpr_nets::{
    encode::{Options, Start, Task, by_name, encode_files, tune},
    model::Tunable,
    train::{Run, device},
    weights::{Precision, Weights},
};
use vpr_vision::image::{ImageSize, from_pixels, write_png};

const METHODS: [&str; 2] = ["boq-default", "salad-default"];

fn committed(method: &str) -> PathBuf {
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/models");
    models.join(format!("{method}.safetensors"))
}

/// Six references of stripes, 40 m apart.
fn map(folder: &Path) -> ReferenceSet {
    let (width, height) = (48, 36);
    let paths: Vec<PathBuf> = (0..6).map(|it| folder.join(format!("{it}.png"))).collect();
    for (number, path) in paths.iter().enumerate() {
        let level = |at: usize| u8::try_from((at / 3 % width * (3 + number) + at % 3 * 40) % 251);
        let levels = (0..3 * width * height).map(|at| level(at).unwrap()).collect();
        write_png(&from_pixels(ImageSize { width, height }, levels), path).unwrap();
    }
    let at = |it: i32| PlanarPosition::new(40.0 * f64::from(it), 0.0);
    ReferenceSet::new(paths, Some(Poses::Planar((0..6).map(at).collect()))).unwrap()
}

/// Fine-tunes in `folder` and writes what it came to, and what it began with.
struct Steps<'a> {
    settings: &'a Finetuning,
    set: &'a ReferenceSet,
    folder: &'a Path,
    /// The round at which it dies.
    last: usize,
}

impl Task for Steps<'_> {
    type Output = Result<usize>;

    fn with<N: Tunable>(self, network: N, start: Start) -> Self::Output {
        let Self { settings, set, folder, last } = self;
        let material = Material::open_for(set, start.preprocessing, start.size)?;
        let facts = settings.facts(&material, &start.digest);
        let mut run = Run::open(folder, &facts, run_log(&folder.join("log.csv")))?;
        let tuned =
            finetune(settings, network, (set, &material), &mut run, folder, |step, _, _| {
                if step == last { Err(CoreError::Empty("power")) } else { Ok(()) }
            })?;
        tuned.network.write(&folder.join("tuned.safetensors"), &facts, Precision::Single)?;
        Ok(tuned.best_step)
    }
}

fn steps(method: &str, settings: &Finetuning, folder: &Path, last: usize) -> Result<usize> {
    fs::create_dir_all(folder).unwrap();
    let set = map(folder.parent().unwrap());
    let task = Steps { settings, set: &set, folder, last };
    tune(method, Some(&committed(method)), &[], &device(), task)?
}

fn settings() -> Finetuning {
    Finetuning { steps: 10, round: 5, batch: 2, variants: 1, ..Finetuning::default() }
}

fn tensors(path: &Path) -> Vec<(String, Vec<f32>)> {
    let weights = Weights::open(path).unwrap();
    weights.iter().map(|(key, tensor)| (key.to_owned(), tensor.data.clone())).collect()
}

#[test]
fn a_frozen_trunk_is_not_in_the_file_and_the_file_describes() {
    for method in METHODS {
        let folder = tempfile::tempdir().unwrap();
        let settings = Finetuning { frozen: vec!["trunk".to_owned()], rate: 1e-2, ..settings() };
        let work = folder.path().join("work");
        steps(method, &settings, &work, usize::MAX).unwrap();
        let path = work.join("tuned.safetensors");
        let (before, after) = (tensors(&committed(method)), tensors(&path));
        assert_eq!(before.len(), after.len(), "{method}");
        assert!(after.iter().all(|it| it.0.starts_with("head.")), "{method}");
        let set = map(folder.path());
        let rows = |path: &Path| {
            let network = by_name(method, Some(path), &[]).unwrap();
            encode_files(network.as_ref(), set.images(), &Options::default(), &mut |_| {}).unwrap()
        };
        let (old, new) = (rows(&committed(method)), rows(&path));
        assert_eq!(old.len(), 6);
        assert_eq!(before == after, old.as_slice() == new.as_slice(), "{method}");
    }
}

#[test]
fn a_killed_run_goes_on_to_the_same_bits_and_a_rate_of_zero_moves_nothing() {
    for method in METHODS {
        let folder = tempfile::tempdir().unwrap();
        let work = |name: &str| folder.path().join(name);
        assert!(steps(method, &settings(), &work("killed"), 5).is_err());
        let ends = ["killed", "whole"].map(|name| {
            let best = steps(method, &settings(), &work(name), usize::MAX).unwrap();
            (best, tensors(&work(name).join("tuned.safetensors")))
        });
        assert!(ends[0] == ends[1], "{method}");
        let still = Finetuning { rate: 0.0, steps: 5, ..settings() };
        assert_eq!(steps(method, &still, &work("still"), usize::MAX).unwrap(), 0);
        assert_eq!(tensors(&work("still").join("tuned.safetensors")), tensors(&committed(method)));
    }
}

#[test]
fn a_method_without_gradients_is_refused_with_those_that_have_some() {
    let err = steps("calc", &settings(), &tempfile::tempdir().unwrap().path().join("work"), 0);
    let err = err.unwrap_err().to_string();
    assert!(err.contains("calc") && err.contains("salad-default"), "{err}");
}
