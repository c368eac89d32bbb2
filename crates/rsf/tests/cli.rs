//! The program as a user meets it.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use rsf::study::Study;
use tempfile::TempDir;
use vpr_report::experiment;
use vpr_vision::image::{self, ImageSize, from_pixels, write_png};

/// Queries that show nothing.
const NOISE: usize = usize::MAX;

/// A map of six references 40 m apart, and queries beside it.
fn place(seed: usize) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (side, shift) in [("database", 0), ("queries", 5)] {
        fs::create_dir(folder.path().join(side)).unwrap();
        for number in 0..6 {
            let name = format!("@{}@{}@32@N@.png", 500_000 + 40 * number + shift, 4_000_000);
            let changed = if side == "queries" { seed } else { 0 };
            let image =
                if changed == NOISE { noise(number) } else { blocks(number + 100 * changed) };
            write_png(&image, &folder.path().join(side).join(name)).unwrap();
        }
    }
    folder
}

fn blocks(number: usize) -> image::RgbImage {
    let size = ImageSize { width: 40, height: 30 };
    let level = |at: usize| {
        let (x, y, channel) = (at / 3 % 40 / 8, at / 120 / 6, at % 3);
        let mixed = (1 + number * 31 + x * 7 + y * 131 + channel * 977) * 2_654_435_761;
        u8::try_from((mixed >> 9) % 200).unwrap() + 20
    };
    from_pixels(size, (0..3 * 40 * 30).map(level).collect())
}

fn noise(number: usize) -> image::RgbImage {
    let mut state = 1 + number as u64;
    let byte = |_| {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        state.to_be_bytes()[0]
    };
    from_pixels(ImageSize { width: 40, height: 30 }, (0..3 * 40 * 30).map(byte).collect())
}

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

fn rsf(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_rsf"))
        .current_dir(folder)
        .args(arguments)
        .env_remove("VPR_DATA")
        .env("VPR_CACHE", Path::new(env!("CARGO_TARGET_TMPDIR")).join("rsf-cli"))
        .output()
        .unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

const FEW: [&str; 10] = [
    "finetune",
    "--database-folder",
    "database",
    "--output",
    "tuned.safetensors",
    "--steps",
    "5",
    "--round",
    "5",
    "--batch=2",
];

/// Weights that came of a map beside these queries.
fn tuned(queries: usize, how: &[&str]) -> Vec<u8> {
    let place = place(queries);
    let output = rsf(place.path(), &[&FEW[..5], how].concat());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(output.stdout.is_empty(), "stdout is data");
    let read = |name: &str| fs::read(place.path().join(name)).unwrap_or_default();
    let weights = read("tuned.safetensors");
    assert!(weights.len() > 1_000_000);
    [weights, read("tuned.log.csv")].concat()
}

/// Whatever is learned: noise in place of all queries leaves every bit of the weights.
#[test]
fn queries_beside_the_map_change_no_bit() {
    let few = ["--steps=5", "--round=5", "--batch=2", "--rate=1e-3", "--checkpoints=work"];
    for how in ["--parts=all", "--parts=last-block", "--parts=low-rank", "--whitening"] {
        let how = if how == "--whitening" { vec![how] } else { [&few[..], &[how]].concat() };
        let found = tuned(1, &how);
        assert!(found == tuned(2, &how) && found == tuned(NOISE, &how), "{how:?}");
    }
}

#[test]
fn other_settings_are_another_run_and_wrong_ones_are_named() {
    let place = place(1);
    let run =
        |more: &[&str]| rsf(place.path(), &[&FEW[..], &["--checkpoints", "work"], more].concat());
    assert_eq!(run(&[]).status.code(), Some(0));
    let other = run(&["--margin", "0.2"]);
    assert_eq!(other.status.code(), Some(2));
    assert!(stderr(&other).contains("margin: was 0.3, now 0.2"), "{}", stderr(&other));
    for (more, part) in [
        (&["--steps", "7"][..], "`steps` = 7"),
        (&["--method", "ap-gem"][..], "unknown method with gradients `ap-gem`"),
        (&["--negative-m", "900", "--checkpoints", "a"][..], "nothing to tell apart"),
        (
            &["--frozen", "stem", "--checkpoints", "b"][..],
            "no part of the network is called `stem`",
        ),
    ] {
        let arguments = [&FEW[..5], more].concat();
        let output = rsf(place.path(), &arguments);
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        assert!(stderr(&output).contains(part), "`{part}` is not in: {}", stderr(&output));
    }
}

#[test]
fn a_sheet_shows_every_augmentation_and_a_projection_takes_seconds() {
    let place = place(1);
    let image =
        fs::read_dir(place.path().join("database")).unwrap().next().unwrap().unwrap().path();
    let path = image.to_str().unwrap();
    let output = rsf(place.path(), &["augment", "--image", path, "--preview", "sheet.png"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("RandomSnow Snow") && text.contains("seed 8: "), "{text}");
    let sheet = image::decode(&place.path().join("sheet.png")).unwrap();
    let tiles = rsf::Preset::All.augmentations().0.len() + 1 + 8;
    assert_eq!(sheet.height(), tiles.div_ceil(5) * 34 + 4);
    let arguments = ["finetune", "--database-folder", "database", "--output", "w.safetensors"];
    let output = rsf(place.path(), &[&arguments[..], &["--whitening", "--half"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(fs::metadata(place.path().join("w.safetensors")).unwrap().len() < 1_500_000);
}

#[test]
fn every_experiment_of_the_chapter_can_be_read() {
    let mut n = 0;
    for entry in fs::read_dir(workspace().join("experiments")).unwrap() {
        let path = entry.unwrap().path();
        let is_of_chapter = || fs::read_to_string(&path).unwrap().contains("\nchapter = \"rsf\"\n");
        if path.extension().is_some_and(|it| it == "toml") && is_of_chapter() {
            experiment::load::<Study>(&path).unwrap();
            n += 1;
        }
    }
    assert!(n >= 6, "{n} experiments");
}

#[test]
fn rows_before_and_after_are_held_against_each_other() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir_all(folder.path().join("experiments")).unwrap();
    fs::create_dir_all(folder.path().join("data/models")).unwrap();
    let path = folder.path().join("experiments/table-0.toml");
    let study = "id = \"table-0\"\ntitle = \"t\"\nsource = \"s\"\nchapter = \"rsf\"\n[study]\n\
        kind = \"recalls\"\nranks = [1]\n\
        places = [{ name = \"Street\", key = \"street\", dataset = \"world/street?places=6&camera.width=64&camera.height=48&camera.focal=46.0\" }]\n\
        encoders = [{ name = \"before\" }, { name = \"after\", weights = \"models/rsf-{place}.safetensors\" }, { name = \"none\", weights = \"models/none.safetensors\" }]\n";
    fs::write(&path, study).unwrap();
    let start = workspace().join("crates/vpr-nets/models/default-encoder.safetensors");
    fs::copy(start, folder.path().join("data/models/rsf-street.safetensors")).unwrap();
    let output = rsf(folder.path(), &["run", "experiments/table-0.toml", "--format", "csv"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let text = String::from_utf8(output.stdout).unwrap();
    for part in [
        "+0.0 points on before: 0 queries gained, 0 lost, McNemar mid-p 1.00e0",
        "models/none.safetensors is not at hand",
        "Wilson",
        "generated",
    ] {
        assert!(text.contains(part), "`{part}` is not in: {text}");
    }
}
