//! The program as a user meets it: output, exit codes, and what it says about wrong input.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod program;

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use ndarray::{Array2, array};
use program::{assert_refused, success, sue};
use serde_json::Value;
use tempfile::TempDir;
use vpr_core::{
    Descriptors, Map, PlanarPosition, Poses,
    map::{self, About, Coordinates, Names, UtmZone},
};
use vpr_files::npy;

/// A map of twelve places with look-alikes, and queries in front of some of them.
struct World {
    folder: TempDir,
}

const N: usize = 12;

fn descriptors(n: usize, shift: f32) -> Descriptors {
    let of = |(row, column): (usize, usize)| {
        // Places 0 and 6, 1 and 7, … look alike.
        let angle = (1 + row % 6) as f32 + shift * (1.0 + row as f32 / 10.0);
        (angle * (1 + column) as f32).sin()
    };
    Descriptors::new(Array2::from_shape_fn((n, 4), of)).unwrap().normalized()
}

fn positions(n: usize, shift: f64) -> Vec<PlanarPosition> {
    (0..n).map(|i| PlanarPosition::new(i as f64 * 40.0 + shift, 0.0)).collect()
}

fn pose_csv(positions: &[PlanarPosition]) -> String {
    let lines = positions.iter().enumerate().map(|(i, it)| format!("{i},{},{}\n", it.x, it.y));
    "name,easting,northing\n".to_owned() + &lines.collect::<String>()
}

impl World {
    fn new() -> Self {
        let world = Self { folder: tempfile::tempdir().unwrap() };
        let about = About { encoder: Some("toy".to_owned()), ..About::default() };
        world.write_map("map.safetensors", &positions(N, 0.0), &about);
        world.write_map("queries.safetensors", &positions(N, 3.0), &about);
        npy::write_f32(&world.path("queries.npy"), descriptors(N, 0.05).view()).unwrap();
        fs::write(world.path("poses.csv"), pose_csv(&positions(N, 3.0))).unwrap();
        world
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write_map(&self, name: &str, positions: &[PlanarPosition], about: &About) {
        let shift = if name.starts_with("queries") { 0.05 } else { 0.0 };
        let descriptors = descriptors(positions.len(), shift);
        let map = Map::new(descriptors, Poses::Planar(positions.to_vec())).unwrap();
        let mut names = Names::default();
        (0..positions.len()).for_each(|i| names.push(&format!("{name}-{i}")));
        map::write(&self.path(name), &map, Some(&names), about.clone()).unwrap();
    }

    fn run(&self, arguments: &[&str]) -> Output {
        sue(self.folder.path(), arguments)
    }

    /// Standard arguments, then these.
    fn with(&self, command: &str, more: &[&str]) -> Output {
        let mut arguments = vec![
            command,
            "--map",
            "map.safetensors",
            "--queries",
            "queries.safetensors",
            "-k",
            "3",
        ];
        arguments.extend(more);
        self.run(&arguments)
    }
}

#[test]
fn every_query_gets_an_uncertainty_in_three_formats() {
    let world = World::new();
    let csv = success(&world.with("estimate", &["--lambda", "20"]));
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines.len(), N + 1);
    assert_eq!(lines[0], "query,reference,distance,uncertainty");
    assert!(lines[1].starts_with("queries.safetensors-0,map.safetensors-"), "{csv}");
    assert!(!csv.contains("NaN") && !csv.contains("inf"), "{csv}");

    let json = success(
        &world.with("estimate", &["--lambda", "20", "--format", "json", "--threshold", "50"]),
    );
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json.as_array().unwrap().len(), N);
    let uncertainty = json[3]["uncertainty"].as_f64().unwrap();
    assert_eq!(json[3]["accepted"].as_bool(), Some(uncertainty < 50.0));

    success(&world.with("estimate", &["--lambda", "20", "--format", "npy", "--out", "u.npy"]));
    let values = npy::read_f64(&world.path("u.npy")).unwrap();
    assert_eq!(values.dim(), (N, 1));
    assert_eq!(values[(3, 0)], uncertainty);
}

/// Regressed rows that lie between the queries and their references in every respect.
#[test]
fn references_that_were_regressed_can_be_left_out() {
    use vpr_core::map::{MapWriter, Origins, RowType};

    let world = World::new();
    let about = || About { encoder: Some("toy".to_owned()), ..About::default() };
    let mut writer =
        MapWriter::create(&world.path("dense.safetensors"), 4, RowType::F32, about()).unwrap();
    let names = |prefix: &str| (0..N).map(|i| format!("{prefix}-{i}")).collect::<Names>();
    let here = Poses::Planar(positions(N, 0.0));
    let measured = descriptors(N, 0.0);
    writer.append(measured.view(), Some(&here), Some(&names("map.safetensors"))).unwrap();
    let mut origins = Origins::default();
    (0..N).for_each(|row| origins.push_regressed(&[row]).unwrap());
    let between = Poses::Planar(positions(N, 1.5));
    let rows = descriptors(N, 0.05);
    let names = names("regressed");
    writer.append_regressed(rows.view(), Some(&between), Some(&names), &origins).unwrap();
    writer.finish().unwrap();
    for estimator in ["sue", "sue-density", "l2"] {
        let of = |map: &str, more: &[&str]| {
            let head = ["estimate", "--map", map, "--queries", "queries.safetensors", "-k", "3"];
            let words = [&head[..], &["--lambda", "20", "--estimator", estimator], more].concat();
            success(&world.run(&words))
        };
        let sparse = of("map.safetensors", &[]);
        assert_eq!(of("dense.safetensors", &["--measured"]), sparse);
        let dense = of("dense.safetensors", &[]);
        assert!(dense.contains(",regressed-0,"), "{dense}");
    }
}

#[test]
fn batches_and_threads_change_nothing() {
    let world = World::new();
    let whole = success(&world.with("estimate", &[]));
    for batch in ["1", "5", "12", "100"] {
        assert_eq!(success(&world.with("estimate", &["--batch-size", batch])), whole);
    }
    let mut command = Command::new(env!("CARGO_BIN_EXE_sue"));
    command.current_dir(world.folder.path()).env("RAYON_NUM_THREADS", "1");
    command.args([
        "estimate",
        "--map",
        "map.safetensors",
        "--queries",
        "queries.safetensors",
        "-k",
        "3",
    ]);
    assert_eq!(success(&command.output().unwrap()), whole);
}

#[test]
fn every_estimator_runs() {
    let world = World::new();
    for estimator in [
        "l2",
        "pa",
        "similarity-distribution",
        "ratio-spread",
        "statistical-uncertainty",
        "sue",
        "sue-published",
        "sue-thesis",
        "sue-density",
        "uniform",
    ] {
        let csv = success(&world.with("estimate", &["--estimator", estimator, "--lambda", "5"]));
        assert_eq!(csv.lines().count(), N + 1, "{estimator}");
    }
    npy::write_f32(&world.path("v.npy"), Array2::from_elem((N, 2), 0.5).view()).unwrap();
    let csv = success(&world.with("estimate", &["--variances", "v.npy"]));
    assert!(csv.lines().nth(1).unwrap().ends_with(",0.5"), "{csv}");
}

#[test]
fn evaluation_prints_metrics_intervals_and_differences() {
    let world = World::new();
    let json = success(
        &world.with("evaluate", &["--lambda", "5", "--format", "json", "--resamples", "200"]),
    );
    let table: Value = serde_json::from_str(&json).unwrap();
    let cells = table["cells"].as_array().unwrap();
    let columns: Vec<&str> = cells.iter().map(|it| it["column"].as_str().unwrap()).collect();
    for column in [
        "AUC-PR, published",
        "AUC-PR, corrected",
        "AUC-ROC",
        "excess AURC",
        "R@95%P",
        "AUC-PR minus first",
    ] {
        assert!(columns.contains(&column), "{column}");
    }
    assert!(table["title"].as_str().unwrap().contains("12 queries, base rate"));
    let from_csv = success(&world.run(&[
        "evaluate",
        "--map",
        "map.safetensors",
        "--queries",
        "queries.npy",
        "--query-poses",
        "poses.csv",
        "-k",
        "3",
        "--lambda",
        "5",
        "--format",
        "json",
        "--resamples",
        "200",
    ]));
    assert_eq!(from_csv, json, "the same queries from another format");
}

#[test]
fn a_report_has_a_run_per_estimator() {
    let world = World::new();
    let more = ["--lambda", "5", "--resamples", "50", "--report", "out.html"];
    success(&world.with("evaluate", &more));
    let html = fs::read_to_string(world.path("out.html")).unwrap();
    for part in ["SUE", "L2-distance", "PA-Score", "sue evaluate", "id=\"curves\""] {
        assert!(html.contains(part), "{part}");
    }
    assert!(!html.contains("id=\"pairs\""), "the matches are the same for all");
}

#[test]
fn calibration_says_what_it_promises() {
    let world = World::new();
    let words = success(&world.with("calibrate", &["--estimator", "l2"]));
    assert!(words.contains("No threshold can be promised a precision of 0.95"), "{words}");
    let easy = ["--estimator", "l2", "--precision", "0.05", "--risk", "0.4"];
    let words = success(&world.with("calibrate", &[&easy[..], &["--report", "out.html"]].concat()));
    assert!(words.starts_with("Accept "), "{words}");
    let html = fs::read_to_string(world.path("out.html")).unwrap();
    assert!(html.contains(words.trim()) && !html.contains("no threshold was given"), "the promise");
    let json = success(
        &world.with("calibrate", &["--false-acceptance", "0.5", "--estimator", "l2", "--json"]),
    );
    let json: Value = serde_json::from_str(&json).unwrap();
    assert!(json["guarantee"].as_str().unwrap().contains("wrong match"), "{json}");
}

#[test]
fn wrong_input_is_refused_with_what_and_where() {
    let world = World::new();
    assert_refused(&world.with("estimate", &["--lambda", "0"]), &["`lambda` = 0", "positive"]);
    assert_refused(&world.with("estimate", &["--lambda", "-3"]), &["`lambda` = -3"]);
    assert_refused(&world.with("estimate", &["--clip", "0"]), &["`clip_m` = 0"]);
    assert_refused(
        &world.run(&[
            "estimate",
            "--map",
            "map.safetensors",
            "--queries",
            "queries.safetensors",
            "-k",
            "13",
        ]),
        &["SUE needs 13 neighbours", "only 12"],
    );
    assert_refused(&world.with("estimate", &["--format", "npy"]), &["--out"]);
    assert_refused(&world.with("calibrate", &["--precision", "1.0"]), &["`precision` = 1"]);
    assert_refused(
        &world.run(&["estimate", "--map", "nowhere.npy", "--queries", "queries.npy"]),
        &["nowhere.npy"],
    );
    fs::write(world.path("garbage.safetensors"), b"not a map at all").unwrap();
    assert_refused(
        &world.run(&["estimate", "--map", "garbage.safetensors", "--queries", "queries.npy"]),
        &["garbage.safetensors"],
    );
}

#[test]
fn what_cannot_be_written_is_said_before_the_work() {
    let world = World::new();
    fs::create_dir(world.path("folder")).unwrap();
    // A map that is not there would be found by the work.
    let on = |command: &str, flag: &str, path: &str| {
        let input = ["--map", "nowhere.npy", "--queries", "queries.npy"];
        world.run(&[&[command], input.as_slice(), &[flag, path]].concat())
    };
    for (command, flag) in
        [("estimate", "--out"), ("evaluate", "--report"), ("calibrate", "--report")]
    {
        assert_refused(&on(command, flag, "folder"), &["folder: is a folder"]);
        assert_refused(&on(command, flag, "no/x.html"), &["no/x.html: no is no folder"]);
    }
    assert_refused(&world.run(&["train", "btl", "--output", "folder"]), &["is a folder"]);
}

#[test]
fn the_smallest_and_largest_uncertainties_take_few_letters() {
    let world = World::new();
    for lambda in ["0.01", "350", "1e5"] {
        let csv = success(&world.with("estimate", &["--lambda", lambda]));
        for field in csv.lines().flat_map(|line| line.split(',')) {
            assert!(field.len() <= 24, "{field}");
        }
    }
}

#[test]
fn planar_and_spatial_poses_are_told_apart_by_their_files() {
    let world = World::new();
    let lines: Vec<String> = (0..N).map(|i| format!("{i},{i},0,1,1,0,0,0\n")).collect();
    let spatial = "name,x,y,z,qw,qx,qy,qz\n".to_owned() + &lines.concat();
    fs::write(world.path("spatial.csv"), spatial).unwrap();
    npy::write_f32(&world.path("bare.npy"), descriptors(N, 0.0).view()).unwrap();
    let input = ["evaluate", "--map", "bare.npy", "--queries", "queries.npy", "-k", "3"];
    let poses = ["--query-poses", "spatial.csv", "--map-poses", "poses.csv"];
    assert_refused(&world.run(&[input.as_slice(), &poses].concat()), &["spatial.csv", "poses.csv"]);
}

#[test]
fn wrong_maps_are_refused_with_what_and_where() {
    let world = World::new();
    let estimate = |map: &str, queries: &str| {
        world.run(&["estimate", "--map", map, "--queries", queries, "-k", "3"])
    };
    let toy = About { encoder: Some("toy".to_owned()), ..About::default() };
    world.write_map("same.safetensors", &[PlanarPosition::new(4.0, 2.0); N], &toy);
    assert_refused(&estimate("same.safetensors", "queries.npy"), &["all 12 references"]);

    let other = About { encoder: Some("HOG".to_owned()), ..About::default() };
    world.write_map("queries-hog.safetensors", &positions(N, 3.0), &other);
    assert_refused(&estimate("map.safetensors", "queries-hog.safetensors"), &["`toy`", "`HOG`"]);

    let zone = |number| {
        let coordinates = Some(Coordinates::Utm(UtmZone { number, south: false }));
        About { coordinates, ..About::default() }
    };
    world.write_map("zone.safetensors", &positions(N, 0.0), &zone(31));
    world.write_map("queries-zone.safetensors", &positions(N, 3.0), &zone(32));
    assert_refused(
        &estimate("zone.safetensors", "queries-zone.safetensors"),
        &["utm 31N", "utm 32N"],
    );

    npy::write_f32(&world.path("bare.npy"), descriptors(N, 0.0).view()).unwrap();
    assert_refused(&estimate("bare.npy", "queries.npy"), &["`sue` needs positions", "--map-poses"]);
    fs::write(world.path("nan.csv"), pose_csv(&positions(N, 0.0)).replace("80,", "NaN,")).unwrap();
    let arguments = [
        "estimate",
        "--map",
        "bare.npy",
        "--map-poses",
        "nan.csv",
        "--queries",
        "queries.npy",
        "-k",
        "3",
    ];
    assert_refused(&world.run(&arguments), &["nan.csv", "line 4", "easting"]);

    npy::write_f32(&world.path("none.npy"), Array2::zeros((0, 4)).view()).unwrap();
    let output = estimate("map.safetensors", "none.npy");
    assert_refused(&output, &["none.npy"]);
    npy::write_f32(&world.path("wide.npy"), array![[0.0_f32; 5]].view()).unwrap();
    assert_refused(&estimate("map.safetensors", "wide.npy"), &["5"]);
    npy::write_f32(&world.path("nan.npy"), array![[0.0_f32, 1.0, f32::NAN, 0.0]].view()).unwrap();
    assert_refused(&estimate("map.safetensors", "nan.npy"), &["row 0, column 2"]);
    let output =
        world.run(&["evaluate", "--map", "map.safetensors", "--queries", "queries.npy", "-k", "3"]);
    assert_refused(&output, &["--query-poses"]);
    assert!(Path::new(&world.path("map.safetensors")).exists());
}
