//! Fine-tuning on maps small enough for a test.

use std::{
    fs,
    path::{Path, PathBuf},
};

use ndarray::Array2;
use vpr_core::{Error as CoreError, PlanarPosition, Poses};
use vpr_nets::{
    model::default::DefaultEncoder,
    train::Run,
    weights::{Precision, Weights, save},
};
use vpr_vision::image::{ImageSize, from_pixels, write_png};

use super::*;
use crate::{Error, MiningParams, Preset, ReferenceSet, Result};

/// References of random blocks, 40 m apart.
fn map(folder: &Path, n: usize, has_poses: bool) -> ReferenceSet {
    let (width, height) = (48, 36);
    let image = |number: usize| {
        let level = |at: usize| {
            let (x, y, channel) = (at / 3 % width / 9, at / 3 / width / 7, at % 3);
            let mixed = (1 + number * 31 + x * 7 + y * 131 + channel * 977) * 2_654_435_761;
            u8::try_from((mixed >> 9) % 200).unwrap() + 20
        };
        from_pixels(ImageSize { width, height }, (0..3 * width * height).map(level).collect())
    };
    let paths: Vec<PathBuf> = (0..n).map(|it| folder.join(format!("{it:03}.png"))).collect();
    for (number, path) in paths.iter().enumerate() {
        write_png(&image(number), path).unwrap();
    }
    let at = |it: usize| PlanarPosition::new(40.0 * it as f64, 0.0);
    let poses = has_poses.then(|| Poses::Planar((0..n).map(at).collect()));
    ReferenceSet::new(paths, poses).unwrap()
}

fn settings() -> Finetuning {
    Finetuning { steps: 15, round: 5, batch: 2, rate: 1e-3, variants: 1, ..Finetuning::default() }
}

/// Fine-tunes in `folder`; dies when it is told of the round that ends with step `last`.
fn tuned(settings: &Finetuning, set: &ReferenceSet, folder: &Path, last: usize) -> Result<Outcome> {
    let material = Material::open(set)?;
    let (network, digest) = default_network(None)?;
    let facts = settings.facts(&material, &digest);
    let mut run = Run::open(folder, &facts, run_log(&folder.join("log.csv")))?;
    finetune(settings, network, (set, &material), &mut run, folder, |step, _, _| {
        if step == last { Err(CoreError::Empty("power")) } else { Ok(()) }
    })
}

/// All weights, in order of their names.
fn weights(network: &DefaultEncoder) -> Vec<(String, Vec<f32>)> {
    let file = tempfile::NamedTempFile::new().unwrap();
    save(network, file.path(), &[], Precision::Single).unwrap();
    let weights = Weights::open(file.path()).unwrap();
    weights.iter().map(|(key, tensor)| (key.to_owned(), tensor.data.clone())).collect()
}

/// Names, in order, of the weights that differ.
fn moved(before: &[(String, Vec<f32>)], after: &[(String, Vec<f32>)]) -> Vec<String> {
    let pairs = before.iter().zip(after).filter(|(before, after)| before != after);
    let mut names: Vec<String> = pairs.map(|(before, _)| before.0.clone()).collect();
    names.sort();
    names
}

/// The weights after the last step, whether they were best or not.
fn last_weights(settings: &Finetuning, folder: &Path) -> Vec<(String, Vec<f32>)> {
    weights(&last(settings, folder).unwrap())
}

#[test]
fn a_learning_rate_of_zero_changes_nothing_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let set = map(folder.path(), 6, true);
    let settings = Finetuning { rate: 0.0, steps: 5, ..settings() };
    let work = folder.path().join("work");
    let outcome = tuned(&settings, &set, &work, usize::MAX).unwrap();
    assert_eq!((outcome.best_step, outcome.best), (0, outcome.before));
    let (start, _) = default_network(None).unwrap();
    assert_eq!(weights(&outcome.network), weights(&start));
    // Not only the network that was kept: also the one that took the steps.
    assert_eq!(last_weights(&settings, &work), weights(&start));
}

#[test]
fn killed_at_any_round_it_ends_with_the_same_bits_and_the_same_log() {
    let folder = tempfile::tempdir().unwrap();
    let set = map(folder.path(), 7, true);
    let of = |name: &str| folder.path().join(name);
    let whole = tuned(&settings(), &set, &of("whole"), usize::MAX).unwrap();
    for last in [0, 5, 10, 15] {
        let killed = tuned(&settings(), &set, &of("killed"), last);
        assert!(killed.err().unwrap().to_string().contains("power"), "{last}");
    }
    let again = tuned(&settings(), &set, &of("killed"), usize::MAX).unwrap();
    assert_eq!((again.best_step, again.best), (whole.best_step, whole.best));
    assert_eq!(weights(&again.network), weights(&whole.network));
    let [last, other] = ["whole", "killed"].map(|it| last_weights(&settings(), &of(it)));
    assert_eq!(last, other);
    assert_ne!(last, weights(&default_network(None).unwrap().0));
    let log = |name: &str| fs::read_to_string(of(name).join("log.csv")).unwrap();
    assert_eq!(log("killed"), log("whole"));
    assert_eq!(log("whole").lines().count(), 4, "a line every five steps");
}

#[test]
fn frozen_parts_stay_and_others_move_also_after_a_kill() {
    let folder = tempfile::tempdir().unwrap();
    let set = map(folder.path(), 6, false);
    let frozen = vec!["trunk.stem".to_owned(), "trunk.stages".to_owned()];
    let settings = Finetuning { frozen, held_out: 0.2, ..settings() };
    let work = folder.path().join("work");
    assert!(tuned(&settings, &set, &work, 10).is_err());
    assert!(tuned(&settings, &set, &work, usize::MAX).is_ok());
    let (start, _) = default_network(None).unwrap();
    let (before, after) = (weights(&start), last_weights(&settings, &work));
    assert_eq!(moved(&before, &after), ["head.bias", "head.weight", "trunk.reduce.weight"]);
}

#[test]
fn what_cannot_be_learned_from_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let set = map(folder.path(), 4, true);
    let run = |settings: &Finetuning, name: &str| {
        tuned(settings, &set, &folder.path().join(name), usize::MAX).err().unwrap()
    };
    let mining = MiningParams { negative_m: 500.0, ..MiningParams::default() };
    let err = run(&Finetuning { mining, ..settings() }, "a");
    assert!(matches!(err, Error::OnePlace { .. }), "{err}");
    let err = run(&Finetuning { frozen: vec!["stem".to_owned()], ..settings() }, "b").to_string();
    assert!(err.contains("`stem`") && err.contains("trunk.stem.conv.weight"), "{err}");
    for (settings, name) in [
        (Finetuning { steps: 12, ..settings() }, "steps"),
        (Finetuning { round: 7, ..settings() }, "round"),
        (Finetuning { rate: f64::NAN, ..settings() }, "rate"),
        (Finetuning { batch: 0, ..settings() }, "batch"),
    ] {
        assert!(settings.check().unwrap_err().to_string().contains(name));
    }
}

#[test]
fn steps_pull_a_trial_apart() {
    let folder = tempfile::tempdir().unwrap();
    let set = map(folder.path(), 8, true);
    let settings = Finetuning {
        steps: 20,
        batch: 4,
        rate: 3e-4,
        variants: 6,
        augmentations: Preset::Appearance,
        trial: Preset::Appearance,
        ..settings()
    };
    let outcome = tuned(&settings, &set, &folder.path().join("work"), usize::MAX).unwrap();
    assert!(outcome.best.gap > outcome.before.gap, "{:?} {:?}", outcome.best, outcome.before);
    assert!(outcome.best_step > 0);
}

#[test]
fn between_two_networks_lie_others() {
    let folder = tempfile::tempdir().unwrap();
    let (start, _) = default_network(None).unwrap();
    let material = Material::open(&map(folder.path(), 5, false)).unwrap();
    let end = whiten(&Whitening::default(), start.clone(), &material).unwrap();
    let saved = |network: &DefaultEncoder| {
        let file = tempfile::NamedTempFile::new().unwrap();
        save(network, file.path(), &[], Precision::Single).unwrap();
        Weights::open(file.path()).unwrap()
    };
    let (a, b) = (saved(&start), saved(&end));
    assert_eq!(weights(&mixture::mixed(start.clone(), &a, &b, 0.0).unwrap()), weights(&start));
    let half = weights(&mixture::mixed(start.clone(), &a, &b, 0.5).unwrap());
    assert_eq!(moved(&weights(&start), &half), ["head.bias", "head.weight"]);
    let values = |weights: &[(String, Vec<f32>)]| -> Vec<f32> {
        weights.iter().find(|it| it.0 == "head.bias").unwrap().1.clone()
    };
    let (a, b, half) = (values(&weights(&start)), values(&weights(&end)), values(&half));
    let is_middle = |at: usize| (f32::midpoint(a[at], b[at]) - half[at]).abs() < 1e-6;
    assert!((0..half.len()).all(is_middle));
}

#[test]
fn a_small_map_is_whitened_with_as_many_directions_as_it_has() {
    let folder = tempfile::tempdir().unwrap();
    let set = map(folder.path(), 5, false);
    let material = Material::open(&set).unwrap();
    let (start, _) = default_network(None).unwrap();
    let fitted = whiten(&Whitening::PUBLISHED, start.clone(), &material).unwrap();
    let rows = material.describe(&fitted).unwrap();
    assert_eq!(rows.dim(), start.dimension());
    let used = |row: usize| rows.row(row).iter().filter(|it| **it != 0.0).count();
    assert_eq!((0..5).map(used).collect::<Vec<_>>(), [4; 5]);
    let lengths: Array2<f32> = rows.view().mapv(|it| it * it);
    assert!(lengths.rows().into_iter().all(|it| (it.sum() - 1.0).abs() < 1e-4));
    // The trunk is what it was, and the same numbers come out again.
    let after = weights(&fitted);
    assert_eq!(moved(&weights(&start), &after), ["head.bias", "head.weight"]);
    let again = whiten(&Whitening::PUBLISHED, start.clone(), &material).unwrap();
    assert_eq!(weights(&again), after);
    assert!(whiten(&Whitening { variants: 0, ..Whitening::default() }, start, &material).is_err());
}

#[test]
fn with_a_prior_cosines_are_those_of_both_projections_mixed() {
    let folder = tempfile::tempdir().unwrap();
    let material = Material::open(&map(folder.path(), 6, false)).unwrap();
    let (start, _) = default_network(None).unwrap();
    let network = |settings: &Whitening| whiten(settings, start.clone(), &material).unwrap();
    let moved_by = |prior: f64| {
        let fitted = network(&Whitening { prior, ..Whitening::default() });
        let [before, after] = [&start, &fitted].map(|it| material.describe(it).unwrap());
        assert_eq!(before.dim(), after.dim());
        let cosine = |rows: &vpr_core::Descriptors, other: usize| rows.row(0).dot(&rows.row(other));
        (1..6).map(|it| (cosine(&before, it) - cosine(&after, it)).abs()).fold(0.0, f32::max)
    };
    // Nearly all of the old projection leaves the cosines; none of it does not.
    let (all, half, none) = (moved_by(0.999_999), moved_by(0.5), moved_by(0.0));
    assert!(all < 2e-3 && all < half && half < none, "{all} {half} {none}");
    let settings = Whitening { prior: 1.0, ..Whitening::default() };
    assert!(settings.check().unwrap_err().to_string().contains("prior"));
    let settings = Whitening { ridge: f64::NAN, ..Whitening::default() };
    assert!(settings.check().unwrap_err().to_string().contains("ridge"));
}
