//! Maps that are small, odd or broken: a clear refusal or the right thing, on the command line.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{
    fs,
    path::Path,
    process::{Child, Command, Output, Stdio},
    thread,
    time::{Duration, Instant},
};

use image::{DynamicImage, Rgb, RgbImage};
use tempfile::TempDir;

/// A folder `database` with these images, 40 m apart or at one place.
fn map(images: &[DynamicImage], metres: usize) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("database")).unwrap();
    for (number, image) in images.iter().enumerate() {
        let name = format!("@{}@4000000@32@N@{number}.png", 500_000 + metres * number);
        image.save(folder.path().join("database").join(name)).unwrap();
    }
    folder
}

fn blocks(number: u32) -> RgbImage {
    RgbImage::from_fn(40, 30, |x, y| {
        let mixed = (1 + number * 31 + x / 8 * 7 + y / 6 * 131).wrapping_mul(2_654_435_761);
        Rgb([mixed >> 9, mixed >> 14, mixed >> 19].map(|it| u8::try_from(it % 200).unwrap() + 20))
    })
}

fn different(n: u32) -> Vec<DynamicImage> {
    (0..n).map(|number| blocks(number).into()).collect()
}

fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rsf"));
    command
        .current_dir(folder)
        .args(arguments)
        .env_remove("VPR_DATA")
        .env("VPR_CACHE", Path::new(env!("CARGO_TARGET_TMPDIR")).join("rsf-cli"));
    command
}

const FEW: [&str; 11] = [
    "finetune",
    "--database-folder",
    "database",
    "--output",
    "tuned.safetensors",
    "--checkpoints=work",
    "--round=5",
    "--batch=2",
    "--rate=1e-3",
    "--seed=1",
    "--margin=0.3",
];

fn tune(folder: &Path, more: &[&str]) -> Output {
    command(folder, &[&FEW[..], more].concat()).output().unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn three_images_are_enough_and_one_is_not() {
    let three = map(&different(3), 40);
    let output = tune(three.path(), &["--steps=5"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let one = map(&different(1), 40);
    let output = tune(one.path(), &["--steps=5"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("1 references: at least 2"), "{}", stderr(&output));
    let none = map(&[], 40);
    let output = tune(none.path(), &["--steps=5"]);
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
}

#[test]
fn one_place_has_no_negatives() {
    let place = map(&different(4), 1);
    let output = tune(place.path(), &["--steps=5"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("nothing to tell apart"), "{}", stderr(&output));
    assert!(!place.path().join("tuned.safetensors").exists());
}

#[test]
fn images_that_are_equal_leave_numbers_that_are_some() {
    let same: Vec<DynamicImage> = (0..4).map(|_| blocks(7).into()).collect();
    let place = map(&same, 40);
    let output = tune(place.path(), &["--steps=5", "--augmentations=none"]);
    // Queries, positives and negatives are one image: nothing can be learned, nothing may break.
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let weights = fs::read(place.path().join("tuned.safetensors")).unwrap();
    assert!(weights.len() > 1_000_000);
    let log = fs::read_to_string(place.path().join("tuned.log.csv")).unwrap();
    assert!(!log.to_lowercase().contains("nan"), "{log}");
    let whitened = tune_whitening(place.path());
    assert_eq!(whitened.status.code(), Some(0), "{}", stderr(&whitened));
}

fn tune_whitening(folder: &Path) -> Output {
    let arguments = ["finetune", "--database-folder", "database", "--output", "w.safetensors"];
    command(folder, &[&arguments[..], &["--whitening"]].concat()).output().unwrap()
}

#[test]
fn a_file_that_is_no_image_is_named() {
    let place = map(&different(4), 40);
    fs::write(place.path().join("database/@500200@4000000@32@N@9.png"), "no image").unwrap();
    let output = tune(place.path(), &["--steps=5"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("@500200@4000000@32@N@9.png"), "{}", stderr(&output));
}

#[test]
fn one_pixel_grey_and_transparent_images_are_images() {
    let pixel = RgbImage::from_pixel(1, 1, Rgb([90, 80, 70]));
    let images = [
        DynamicImage::from(pixel),
        DynamicImage::from(DynamicImage::from(blocks(1)).to_luma8()),
        DynamicImage::from(DynamicImage::from(blocks(2)).to_rgba8()),
        DynamicImage::from(blocks(3)),
    ];
    let place = map(&images, 40);
    let output = tune(place.path(), &["--steps=5"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let file = "database/@500000@4000000@32@N@0.png";
    let sheet = command(place.path(), &["augment", "--image", file, "--preview", "sheet.png"]);
    let output = { sheet }.output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
}

/// Ends a process once its log has a line, wherever it is then.
fn kill_after(mut child: Child, log: &Path, wait: Duration) {
    let start = Instant::now();
    let begun = || fs::read_to_string(log).is_ok_and(|text| text.lines().count() > 1);
    while !begun() && start.elapsed() < Duration::from_mins(2) {
        if child.try_wait().unwrap().is_some() {
            return;
        }
        thread::sleep(Duration::from_millis(5));
    }
    thread::sleep(wait);
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn a_killed_process_goes_on_to_the_same_bits() {
    let parts: [&[&str]; 2] = [&["--steps=20"], &["--steps=20", "--parts=low-rank"]];
    for more in parts {
        let [whole, killed] = [map(&different(6), 40), map(&different(6), 40)];
        let output = tune(whole.path(), more);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let log = killed.path().join("tuned.log.csv");
        // Between two of its steps, in one, while a checkpoint is written: wherever it is by then.
        for wait in [0, 40, 130, 220, 310] {
            let mut command = command(killed.path(), &[&FEW[..], more].concat());
            let child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
            kill_after(child, &log, Duration::from_millis(wait));
        }
        let output = tune(killed.path(), more);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        for name in ["tuned.safetensors", "tuned.log.csv"] {
            let read = |folder: &TempDir| fs::read(folder.path().join(name)).unwrap();
            assert!(read(&whole) == read(&killed), "{name}");
        }
    }
}

fn gap(folder: &Path) -> Output {
    let training = "world/street?places=6&camera.width=64&camera.height=48&camera.focal=46.0";
    command(folder, &["gap", "--database-folder", "database", "--training", training])
        .output()
        .unwrap()
}

/// A projection and the gap meter on what is odd: they need no negatives, so one place is enough.
#[test]
fn odd_maps_are_measured_and_whitened_or_refused() {
    let pixel: DynamicImage = RgbImage::from_pixel(1, 1, Rgb([90, 80, 70])).into();
    let rgba: DynamicImage = DynamicImage::from(blocks(2)).to_rgba8().into();
    let grey: DynamicImage = DynamicImage::from(blocks(1)).to_luma8().into();
    for (images, metres) in [
        (different(3), 40),
        (different(4), 1),
        (vec![blocks(7).into(); 4], 40),
        (vec![pixel, rgba, grey, blocks(3).into()], 40),
    ] {
        let place = map(&images, metres);
        for output in [tune_whitening(place.path()), gap(place.path())] {
            assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
            let text = String::from_utf8_lossy(&output.stdout).to_lowercase();
            assert!(!text.contains("nan"), "{text}");
        }
    }
    let one = map(&different(1), 40);
    let broken = map(&different(4), 40);
    let name = "@500200@4000000@32@N@9.png";
    fs::write(broken.path().join("database").join(name), "no image").unwrap();
    for (folder, part) in [(&one, "1 references: at least 2"), (&broken, name)] {
        for output in [tune_whitening(folder.path()), gap(folder.path())] {
            assert_eq!(output.status.code(), Some(2));
            assert!(stderr(&output).contains(part), "{}", stderr(&output));
        }
        assert!(!folder.path().join("w.safetensors").exists());
    }
}
