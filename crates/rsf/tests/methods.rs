//! Fine-tuning of networks by the names of their methods.

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
    steps_from(&committed(method), method, settings, folder, last)
}

fn steps_from(
    weights: &Path,
    method: &str,
    settings: &Finetuning,
    folder: &Path,
    last: usize,
) -> Result<usize> {
    fs::create_dir_all(folder).unwrap();
    let set = map(folder.parent().unwrap());
    let task = Steps { settings, set: &set, folder, last };
    tune(method, Some(weights), &[], &device(), task)?
}

/// `CosPlace` on the first two stages of a `ResNet`, a block each, under the official names: uniform
/// numbers of a fixed sequence, of variance 2 over a layer's inputs.
fn cosplace(path: &Path) {
    let mut shapes = vec![
        ("backbone.0.weight".to_owned(), vec![64, 3, 7, 7]),
        ("aggregation.1.p".to_owned(), vec![1]),
        ("aggregation.3.weight".to_owned(), vec![32, 128]),
        ("aggregation.3.bias".to_owned(), vec![32]),
    ];
    let mut norms = vec![("backbone.1".to_owned(), 64)];
    for (stage, before, channels) in [(4, 64, 64), (5, 64, 128)] {
        let block = format!("backbone.{stage}.0");
        let mut layers = vec![("conv1", "bn1", before, 3), ("conv2", "bn2", channels, 3)];
        if before != channels {
            layers.push(("downsample.0", "downsample.1", before, 1));
        }
        for (convolution, norm, inputs, side) in layers {
            let shape = vec![channels, inputs, side, side];
            shapes.push((format!("{block}.{convolution}.weight"), shape));
            norms.push((format!("{block}.{norm}"), channels));
        }
    }
    for (norm, channels) in norms {
        for part in ["weight", "bias", "running_mean", "running_var"] {
            shapes.push((format!("{norm}.{part}"), vec![channels]));
        }
    }
    let (mut header, mut data, mut state) = (Vec::new(), Vec::new(), 1_u32);
    for (name, shape) in &shapes {
        let (begin, n) = (data.len(), shape.iter().product::<usize>());
        let inputs = shape.iter().skip(1).product::<usize>();
        let scale = (6.0 / inputs as f32).sqrt();
        for _ in 0..n {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let value = match (shape.len(), name.rsplit('.').next().unwrap()) {
                (1, "p") => 3.0,
                (1, "weight" | "running_var") => 1.0,
                (1, _) => 0.0,
                _ => scale * ((state >> 8) as f32 / 8_388_608.0 - 1.0),
            };
            data.extend_from_slice(&value.to_le_bytes());
        }
        let end = data.len();
        header.push(format!(
            "\"{name}\":{{\"dtype\":\"F32\",\"shape\":{shape:?},\"data_offsets\":[{begin},{end}]}}"
        ));
    }
    let header = format!("{{{}}}", header.join(","));
    let length = (header.len() as u64).to_le_bytes();
    fs::write(path, [&length[..], header.as_bytes(), &data].concat()).unwrap();
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

/// From the official names through two runs, one of them killed, to a file that describes and can be
/// tuned again.
#[test]
fn a_resnet_learns_from_end_to_end() {
    let folder = tempfile::tempdir().unwrap();
    let (method, start) = ("cosplace-resnet18", folder.path().join("start.safetensors"));
    cosplace(&start);
    let settings = Finetuning { batch: 1, rate: 1e-4, ..settings() };
    let work = |name: &str| folder.path().join(name);
    let tuned = |name: &str| work(name).join("tuned.safetensors");
    let run = |name: &str, last| steps_from(&start, method, &settings, &work(name), last);
    assert!(run("killed", 5).is_err());
    assert_eq!(run("killed", usize::MAX).unwrap(), run("whole", usize::MAX).unwrap());
    assert!(fs::read(tuned("killed")).unwrap() == fs::read(tuned("whole")).unwrap());
    let log = fs::read_to_string(work("whole").join("log.csv")).unwrap();
    assert_eq!(log, fs::read_to_string(work("killed").join("log.csv")).unwrap());
    let gaps: Vec<&str> = log.lines().skip(1).filter_map(|line| line.rsplit(',').next()).collect();
    assert!(gaps.len() == 2 && gaps[0] != gaps[1], "nothing moved: {log}");
    let weights = tensors(&tuned("whole"));
    assert_eq!(weights.len(), tensors(&start).len());
    assert!(
        weights.iter().all(|it| it.0.starts_with("backbone.") || it.0.starts_with("aggregator."))
    );
    let set = map(folder.path());
    let network = by_name(method, Some(&tuned("whole")), &[]).unwrap();
    let options = Options::default();
    let rows = encode_files(network.as_ref(), &set.images()[..2], &options, &mut |_| {}).unwrap();
    assert_eq!((rows.len(), rows.dim()), (2, 32));
    let still = Finetuning { rate: 0.0, steps: 5, ..settings };
    steps_from(&tuned("whole"), method, &still, &work("still"), usize::MAX).unwrap();
    assert!(tensors(&tuned("still")) == weights);
}

#[test]
fn a_method_without_gradients_is_refused_with_those_that_have_some() {
    let err = steps("calc", &settings(), &tempfile::tempdir().unwrap().path().join("work"), 0);
    let err = err.unwrap_err().to_string();
    assert!(err.contains("calc") && err.contains("salad-default"), "{err}");
}
