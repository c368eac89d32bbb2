//! Every format that holds poses, as poses of the map and of the queries: the same uncertainties.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod program;

use std::fs;

use nalgebra::Vector3;
use ndarray::Array2;
use program::{stderr, success, sue};
use vpr_core::{
    Descriptors, PlanarPosition, Pose, Poses,
    map::{About, Coordinates},
};
use vpr_data::exchange::{self, Format, Parts};
use vpr_files::npy;

const N: usize = 12;

fn rows(shift: f32) -> Descriptors {
    // Places 0 and 6, 1 and 7, … look alike.
    let value = |(row, column): (usize, usize)| {
        let angle = (row % 6) as f32 + shift * (1.0 + row as f32 / 10.0);
        (angle * (1 + column) as f32).sin()
    };
    Descriptors::new(Array2::from_shape_fn((N, 4), value)).unwrap().normalized()
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    npy::write_f32(&folder.path().join("d.npy"), rows(0.0).view()).unwrap();
    npy::write_f32(&folder.path().join("q.npy"), rows(0.05).view()).unwrap();
    folder
}

fn cameras() -> Parts {
    let pose = |row: usize| {
        let turn = Vector3::new(0.2, -0.4, 0.3 * row as f64);
        Pose::new(Vector3::new(40.0 * row as f64, (row * row) as f64, 0.5), turn)
    };
    Parts {
        names: Some((0..N).map(|row| format!("{row}.25")).collect()),
        poses: Some(Poses::SixDof((0..N).map(pose).collect())),
        descriptors: Some(rows(0.0)),
        ..Parts::default()
    }
}

fn places() -> Parts {
    let position = |row: usize| PlanarPosition::new(480_000.0 + 40.0 * row as f64, 4_427_750.0);
    let coordinates = Some(Coordinates::Utm("18N".parse().unwrap()));
    Parts {
        poses: Some(Poses::Planar((0..N).map(position).collect())),
        about: About { coordinates, ..About::default() },
        ..cameras()
    }
}

/// The last column of what `sue estimate` prints.
fn uncertainties(text: &str) -> Vec<f64> {
    text.lines().skip(1).map(|line| line.rsplit_once(',').unwrap().1.parse().unwrap()).collect()
}

fn every_file_gives_the_same(parts: &Parts, files: &[(Format, &str)]) {
    let folder = folder();
    let folder = folder.path();
    let (mut estimated, mut evaluated) = (Vec::new(), Vec::new());
    for &(format, file) in files {
        exchange::write(format, &folder.join(file), parts).unwrap();
        let input = ["--map", "d.npy", "--map-poses", file, "--queries", "q.npy", "-k", "3"];
        let flags = ["--poses-format", format.name(), "--lambda", "20"];
        let estimate = sue(folder, &[&["estimate"], input.as_slice(), &flags].concat());
        estimated.push((format.name(), uncertainties(&success(&estimate))));
        let queries = ["--query-poses", file, "--resamples", "100", "--format", "csv"];
        let evaluate = sue(folder, &[&["evaluate"], input.as_slice(), &flags, &queries].concat());
        evaluated.push((format.name(), success(&evaluate)));
    }
    let first = &estimated[0].1;
    assert!(first.iter().any(|it| *it > 1.0), "{first:?}");
    for (format, values) in &estimated {
        let close = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-3 * (1.0 + b.abs());
        assert!(values.len() == N && values.iter().zip(first).all(close), "{format}: {values:?}");
    }
    for (format, text) in &evaluated {
        assert_eq!(text.lines().count(), evaluated[0].1.lines().count(), "{format}");
    }
}

#[test]
fn cameras_of_every_format_give_the_same_uncertainties() {
    let files = [
        (Format::PoseCsv, "poses.csv"),
        (Format::HlocPoses, "poses.txt"),
        (Format::Colmap, "images.txt"),
        (Format::Colmap, "images.bin"),
        (Format::Kapture, "kapture"),
        (Format::Tum, "poses.tum"),
        (Format::Kitti, "poses.kitti"),
        (Format::SevenScenes, "seq-01"),
        (Format::Map, "poses.safetensors"),
        (Format::Npz, "poses.npz"),
    ];
    every_file_gives_the_same(&cameras(), &files);
}

#[test]
fn places_of_every_format_give_the_same_uncertainties() {
    let files = [
        (Format::PoseCsv, "poses.csv"),
        (Format::LatLon, "gps.csv"),
        (Format::UtmNames, "names.txt"),
        (Format::Npz, "poses.npz"),
    ];
    every_file_gives_the_same(&places(), &files);
}

#[test]
fn a_path_that_says_nothing_asks_for_a_flag_that_is_there() {
    let folder = folder();
    let folder = folder.path();
    fs::write(folder.join("poses"), "1 0 0 0 0 1 0 0 0 0 1 0\n".repeat(N)).unwrap();
    let input =
        ["estimate", "--map", "d.npy", "--map-poses", "poses", "--queries", "q.npy", "-k", "3"];
    let output = sue(folder, &input);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("give `--poses-format` one of"), "{}", stderr(&output));
    let output = sue(folder, &[input.as_slice(), &["--poses-format", "kitti"]].concat());
    assert!(
        stderr(&output).contains("all 12 references have the same position"),
        "{}",
        stderr(&output)
    );
}

#[test]
fn a_map_smaller_than_k_names_the_flag() {
    let folder = folder();
    let folder = folder.path();
    exchange::write(Format::PoseCsv, &folder.join("p.csv"), &cameras()).unwrap();
    let input = ["estimate", "--map", "d.npy", "--map-poses", "p.csv", "--queries", "q.npy"];
    let output = sue(folder, &[input.as_slice(), &["-k", "13"]].concat());
    assert!(stderr(&output).contains("`-k`"), "{}", stderr(&output));
    let zero = sue(folder, &[input.as_slice(), &["-k", "0"]].concat());
    assert!(stderr(&zero).contains("must be at least 1"), "{}", stderr(&zero));
}
