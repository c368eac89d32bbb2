//! `bench match` as a user meets it.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#![expect(clippy::print_stdout, reason = "says what it skips and how far off it is")]

use std::{
    path::{Path, PathBuf},
    process::{Command, Output},
};

use serde_json::Value;
use vpr_vision::image::{self, ImageSize, RgbImage};

fn run(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bench"));
    command.arg("match").args(arguments).env_remove("VPR_DATA").output().unwrap()
}

fn stdout(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// Asserts exit code 2 and a one-line error that contains this.
fn assert_refused(arguments: &[&str], part: &str) {
    let output = run(arguments);
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(text.contains(part), "`{part}` is not in: {text}");
}

/// Rectangles of random places, sizes and colours, seen from `(x, y)`.
fn view(folder: &Path, name: &str, x: usize, y: usize) -> String {
    let (width, height) = (240, 180);
    let mut state = 99_u64;
    let mut next = |below: usize| {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(state >> 33).unwrap() % below
    };
    let mut wall = vec![[90_u8; 3]; 400 * 300];
    for _ in 0..250 {
        let (left, top) = (next(400), next(300));
        let (right, bottom) = ((left + 4 + next(40)).min(400), (top + 4 + next(40)).min(300));
        let color = [0; 3].map(|_| u8::try_from(next(256)).unwrap());
        for row in top..bottom {
            wall[row * 400 + left..row * 400 + right].fill(color);
        }
    }
    let rows = (0..height).flat_map(|row| &wall[(row + y) * 400 + x..][..width]);
    let pixels = rows.flatten().copied().collect();
    let image = RgbImage::new(ImageSize { width, height }, pixels).unwrap();
    let path = folder.join(name);
    image::write_png(&image, &path).unwrap();
    path.to_str().unwrap().to_owned()
}

fn path(folder: &Path, name: &str) -> String {
    folder.join(name).to_str().unwrap().to_owned()
}

#[test]
fn two_views_of_a_wall_share_a_shift() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b] = [view(folder.path(), "a.png", 20, 30), view(folder.path(), "b.png", 57, 41)];
    for method in ["sift", "orb"] {
        let plot = path(folder.path(), "plot.png");
        let arguments = [&a, &b, "--method", method, "--format", "json", "--plot", &plot];
        let found: Value = serde_json::from_str(&stdout(&run(&arguments))).unwrap();
        let count = |key: &str| found[key].as_u64().unwrap();
        assert!(count("inliers") >= 30, "{method}: {found}");
        assert!(count("inliers") * 10 >= count("matches") * 9, "{method}");
        let shift = |row: usize| found["model"][row][2].as_f64().unwrap();
        assert!((shift(0) + 37.0).abs() < 1.0 && (shift(1) + 11.0).abs() < 1.0, "{method}");
        let picture = image::decode(plot.as_ref()).unwrap();
        assert_eq!(picture.size(), ImageSize { width: 480, height: 180 });
        let green = picture.as_slice().as_chunks::<3>().0.iter().filter(|it| **it == [60, 220, 90]);
        assert!(green.count() > 500, "{method}");
    }
}

#[test]
fn text_csv_and_the_seed() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b] = [view(folder.path(), "a.png", 20, 30), view(folder.path(), "b.png", 57, 41)];
    let text = stdout(&run(&[&a, &b, "--geometry", "fundamental"]));
    let lines: Vec<Vec<&str>> = text.lines().map(|it| it.split_whitespace().collect()).collect();
    assert_eq!([lines[0][0], lines[1][0], lines[2][0]], ["keypoints", "matches", "inliers"]);
    let rows = stdout(&run(&[&a, &b, "--format", "csv"]));
    assert!(rows.starts_with("a_x,a_y,b_x,b_y,distance,inlier\n"));
    assert_eq!((rows.lines().count() - 1).to_string(), lines[1][1]);
    assert_eq!(rows, stdout(&run(&[&a, &b, "--format", "csv", "--seed", "0"])));
}

#[test]
fn a_blank_image_has_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let a = view(folder.path(), "a.png", 20, 30);
    for (width, height) in [(1, 1), (240, 180)] {
        let blank = RgbImage::from_size_val(ImageSize { width, height }, 128).unwrap();
        let b = path(folder.path(), "blank.png");
        image::write_png(&blank, b.as_ref()).unwrap();
        for method in ["sift", "orb"] {
            let text = stdout(&run(&[&a, &b, "--method", method]));
            assert!(text.ends_with("matches    0\ninliers    0\n"), "{text}");
        }
    }
}

#[test]
fn what_is_missing_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let a = view(folder.path(), "a.png", 0, 0);
    assert_refused(&[&a, "no/such.png"], "no/such.png");
    assert_refused(&[&a, &a, "--method", "xfeat"], "xfeat.pt");
    assert_refused(&[&a, &a, "--method", "disk", "--weights", &a], "a.png");
    assert_refused(&[&a, &a, "--ratio", "2"], "`ratio` = 2");
    assert_refused(&[&a, &a, "--iterations", "0"], "`iterations` = 0");
    assert_refused(&[&a, &a, "--plot", "no/such/folder.png"], "no/such/folder.png");
}

/// Neighbouring frames of red kitchen, by the published networks.
#[test]
fn networks_match_neighbouring_frames() {
    let Some(data) = std::env::var_os("VPR_DATA").map(PathBuf::from) else {
        println!("skipped: VPR_DATA is not set");
        return;
    };
    let frame = |n: usize| {
        let folder = data.join("7scenes/redkitchen/seq-01");
        folder.join(format!("frame-{n:06}.color.jpg")).to_str().unwrap().to_owned()
    };
    let data = data.to_str().unwrap();
    for method in ["xfeat", "disk"] {
        let text = stdout(&run(&[&frame(100), &frame(105), "--method", method, "--data", data]));
        let last = text.lines().last().unwrap().split_whitespace().last().unwrap();
        println!("{method}: {last} inliers");
        assert!(last.parse::<usize>().unwrap() >= 100, "{method}: {text}");
    }
}
