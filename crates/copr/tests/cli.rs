//! The program as a user meets it: output, exit codes, and what it says about wrong input.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{
    path::{Path, PathBuf},
    process::{Command, Output},
};

use ndarray::Array2;
use tempfile::TempDir;
use vpr_core::{
    Descriptors, Map, PlanarPosition, Pose, Poses,
    map::{self, About, Names, OpenMap, Opening, Origin},
};

/// Images every metre along x in two sequences, whose descriptors turn with x, and queries between
/// them.
struct World {
    folder: TempDir,
}

/// Images of each of the two sequences.
const N: usize = 9;

fn descriptors(xs: &[f64]) -> Descriptors {
    #[expect(clippy::cast_possible_truncation, reason = "descriptors are f32")]
    let of = |(row, column): (usize, usize)| (0.3 * xs[row] + column as f64).sin() as f32;
    Descriptors::new(Array2::from_shape_fn((xs.len(), 4), of)).unwrap()
}

fn write(path: &Path, xs: &[f64], names: &[String], encoder: &str) {
    // A path in space: every four images determine a plane.
    let at = |&x: &f64| Pose::translation(x, (2.0 * x).sin(), (3.0 * x).cos());
    let map = Map::new(descriptors(xs), Poses::SixDof(xs.iter().map(at).collect())).unwrap();
    let names: Names = names.iter().collect();
    let about = About { encoder: Some(encoder.to_owned()), ..About::default() };
    map::write(path, &map, Some(&names), about).unwrap();
}

impl World {
    fn new() -> Self {
        let world = Self { folder: tempfile::tempdir().unwrap() };
        let xs: Vec<f64> = (0..2 * N).map(|at| (at % N) as f64 + 20.0 * (at / N) as f64).collect();
        let name = |at: usize| format!("seq-{:02}/frame-{:06}.color.png", 1 + at / N, at % N);
        let names: Vec<String> = (0..2 * N).map(name).collect();
        write(&world.path("sparse.safetensors"), &xs, &names, "toy");
        let xs: Vec<f64> = (0..N - 1).map(|at| at as f64 + 0.5).collect();
        let names: Vec<String> = (0..N - 1).map(|at| format!("q-{at}")).collect();
        write(&world.path("queries.safetensors"), &xs, &names, "toy");
        write(&world.path("others.safetensors"), &xs, &names, "another");
        world
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn run(&self, arguments: &str) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_copr"));
        command.current_dir(self.folder.path()).args(arguments.split_whitespace());
        command.env_remove("VPR_DATA").output().expect("the program starts")
    }

    fn ok(&self, arguments: &str) -> (String, String) {
        let output = self.run(arguments);
        let (out, err) = (text(&output.stdout), text(&output.stderr));
        assert_eq!(output.status.code(), Some(0), "{err}");
        (out, err)
    }

    fn refused(&self, arguments: &str) -> String {
        let output = self.run(arguments);
        assert_eq!(output.status.code(), Some(2), "{}", text(&output.stdout));
        assert_eq!(text(&output.stdout), "");
        text(&output.stderr)
    }

    fn open(&self, name: &str) -> OpenMap {
        OpenMap::open(&self.path(name), Opening::default()).unwrap()
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[test]
fn a_map_is_made_denser_and_localizes_better() {
    let world = World::new();
    let between = "densify --map sparse.safetensors --between 1 --regressor linear";
    let (out, err) = world.ok(&format!("{between} --out dense.safetensors"));
    assert_eq!(out, "");
    assert!(err.contains("16 regressed rows after 18 of the map: 34"), "{err}");
    let dense = world.open("dense.safetensors");
    let origins = dense.origins().unwrap().unwrap();
    assert_eq!(origins.measured_rows(), (0..18).collect::<Vec<_>>());
    assert_eq!(origins.get(18), Some(Origin::Regressed(&[0, 1])));
    assert_eq!(origins.get(26), Some(Origin::Regressed(&[9, 10])), "not across sequences");
    assert_eq!(dense.about().encoder.as_deref(), Some("toy"));
    let localize = |map: &str| {
        let (out, err) = world.ok(&format!("localize --map {map} --queries queries.safetensors"));
        let line = err.lines().find(|line| line.contains("translation")).unwrap().to_owned();
        let value = line.split_whitespace().nth(3).unwrap().parse::<f64>().unwrap();
        (out, value)
    };
    let (sparse_lines, sparse) = localize("sparse.safetensors");
    let (lines, error) = localize("dense.safetensors");
    assert!(error < 0.7 * sparse, "{error} {sparse}");
    assert!(lines.starts_with("query,reference,origin,distance,x,y,z,"), "{lines}");
    assert!(lines.contains("q-3,regressed-0000003,regressed,"), "{lines}");
    let (measured, _) =
        world.ok("localize --map dense.safetensors --queries queries.safetensors --measured");
    assert_eq!(measured, sparse_lines);
}

#[test]
fn a_dense_map_can_be_made_denser_from_its_images_only() {
    let world = World::new();
    world.ok("densify --map sparse.safetensors --between 1 --regressor linear -o a.safetensors");
    world.ok("densify --map a.safetensors --lane 0.1,0,0 -o b.safetensors");
    let origins = world.open("b.safetensors").origins().unwrap().unwrap();
    assert_eq!((origins.len(), origins.n_regressed()), (18 + 16 + 18, 16 + 18));
    assert_eq!(origins.get(18), Some(Origin::Regressed(&[0, 1])));
    let Some(Origin::Regressed(anchors)) = origins.get(34) else { panic!("row 34 is measured") };
    assert_eq!((anchors.len(), anchors[0]), (4, 0));
}

#[test]
fn a_dry_run_counts_and_the_absurd_is_refused() {
    let world = World::new();
    let grid = "densify --map sparse.safetensors --every 3 --grid 0.05 --span 1.0x0.5";
    let (out, _) = world.ok(&format!("{grid} --dry-run"));
    // 6 anchors × 21 × 11 targets; 4 values of 4 bytes and a pose of 56.
    let rows = 18 + 6 * 21 * 11;
    for line in ["anchors: 6", "regressed rows: 1386", &format!("bytes: {}", rows * 72)] {
        assert!(out.lines().any(|it| it == line), "`{line}` is not in: {out}");
    }
    let (out, _) = world.ok(&format!("{grid} --dry-run --definition published"));
    assert!(out.contains("regressed rows: 1200\n"), "{out}");
    assert!(!world.path("dense.safetensors").exists());
    let absurd = "densify --map sparse.safetensors --grid 0.0001 --span 9x9 -o dense.safetensors";
    let err = world.refused(absurd);
    assert!(err.contains("targets: more than 50000000"), "{err}");
    assert!(!world.path("dense.safetensors").exists());
}

#[test]
fn a_target_without_a_value_is_named_and_leaves_no_map() {
    let world = World::new();
    let out = "-o dense.safetensors";
    // Two anchors of each sequence: a plane has none to stand on.
    let few = "densify --map sparse.safetensors --every 20 --grid 0.5 --span 1x1";
    let err = world.refused(&format!("{few} {out}"));
    assert!(err.contains("target 0: plane fit needs 4 anchors, 2 can be had"), "{err}");
    let err = world.refused(&format!("{few} --neighbours 2 {out}"));
    assert!(err.contains("target 0") && err.contains("`flat`"), "{err}");
    assert!(!world.path("dense.safetensors").exists());
    let (_, err) = world.ok(&format!("{few} --neighbours 2 --outside flat {out}"));
    assert!(err.contains("lie outside of what their anchors span"), "{err}");
}

#[test]
fn wrong_words_are_explained() {
    let world = World::new();
    let map = "densify --map sparse.safetensors -o d.safetensors";
    for (arguments, part) in [
        ("", "no target"),
        ("--grid 0.1", "`--span` or `--reach`"),
        ("--grid -1 --span 1x1", "`grid` = -1"),
        ("--grid 0.1 --span -1x1", "`span` = -1"),
        ("--grid 0.1 --span 1", "is not two lengths"),
        ("--lane 1,2", "is not X,Y,Z"),
        ("--between 1 --every 0", "`--every` must be at least 1"),
        ("--between 1 --regressor network", "needs `--weights`"),
        ("--between 1 --regressor network --weights none.safetensors", "none.safetensors"),
        ("--at none.txt", "none.txt"),
    ] {
        let err = world.refused(&format!("{map} {arguments}"));
        assert!(err.contains(part), "`{part}` is not in: {err}");
    }
    let err = world.refused("localize --map sparse.safetensors --queries others.safetensors");
    assert!(err.contains("the map is of `toy`, the queries are of `another`"), "{err}");
    let planar = Poses::Planar(vec![PlanarPosition::new(0.0, 1.0); 2]);
    let flat = Map::new(descriptors(&[0.0, 1.0]), planar).unwrap();
    map::write(&world.path("flat.safetensors"), &flat, None, About::default()).unwrap();
    let err = world.refused("densify --map flat.safetensors --between 1 -o d.safetensors");
    assert!(err.contains("flat.safetensors") && err.contains("needs 6-DoF poses"), "{err}");
}

#[test]
fn the_oracle_needs_poses_only() {
    let world = World::new();
    let list = "a 1 0 0 0 -4.1 0.0 0.0\nb 1 0 0 0 -23 0 0\n";
    std::fs::write(world.path("poses.txt"), list).unwrap();
    let localize =
        "localize --map sparse.safetensors --queries poses.txt --queries-format hloc-poses";
    let (out, err) = world.ok(&format!("{localize} --oracle"));
    let lines: Vec<&str> = out.lines().collect();
    assert!(lines[2].starts_with("b,seq-02/frame-000003.color.png,measured,,23,"), "{out}");
    assert!(err.contains("2 queries"), "{err}");
    let err = world.refused(localize);
    assert!(err.contains("poses.txt: has no descriptors"), "{err}");
}

#[test]
fn a_report_shows_where_queries_were_placed() {
    let world = World::new();
    world.ok("densify --map sparse.safetensors --between 1 --regressor linear -o d.safetensors");
    world.ok("localize --map d.safetensors --queries queries.safetensors --report r.html");
    let html = std::fs::read_to_string(world.path("r.html")).unwrap();
    for part in ["Where queries were taken", "references within 0.5 m", "(regressed)", "q-3"] {
        assert!(html.contains(part), "`{part}` is not in the report");
    }
    let oracle = "localize --map d.safetensors --queries queries.safetensors --oracle";
    world.ok(&format!("{oracle} --report o.html"));
    assert!(world.path("o.html").is_file());
}

#[test]
fn pairs_that_are_near_can_be_learnt_from() {
    let world = World::new();
    let train = "train regressor --training sparse.safetensors --validation queries.safetensors \
                 --output h.safetensors --dry-run";
    let (out, _) = world.ok(&format!("{train} --near 2.4,10"));
    let count = |text: &str| -> usize {
        let line = text.lines().find_map(|it| it.strip_prefix("training pairs: ")).unwrap();
        line.parse().unwrap()
    };
    let some = count(&out);
    assert!(some > 0 && some.is_multiple_of(2), "{out}");
    let (out, _) = world.ok(&format!("{train} --near 99,180"));
    assert_eq!(count(&out), 2 * N * (N - 1));
    let (out, _) = world.ok(&format!("{train} --near 99,180 --at-most 7"));
    assert!(out.contains("training pairs: 7\nvalidation pairs: 7\n"), "{out}");
    let err = world.refused(&format!("{train} --near 99"));
    assert!(err.contains("is not metres and degrees"), "{err}");
}

#[test]
fn a_small_network_is_trained_and_used() {
    let world = World::new();
    let train = "train regressor --training sparse.safetensors --validation queries.safetensors \
                 --every 3 --steps 6 --batch 4 --validated-every 3 --layers 1 \
                 --output h.safetensors --checkpoints work";
    let (out, _) = world.ok(&format!("{train} --dry-run"));
    assert!(out.contains("training pairs: 12\nvalidation pairs: 5\ndimension: 4\n"), "{out}");
    let (_, err) = world.ok(train);
    assert!(err.contains("6: loss") && err.contains("h.safetensors: sha256"), "{err}");
    let log = std::fs::read_to_string(world.path("h.log.csv")).unwrap();
    assert_eq!(log.lines().count(), 4, "{log}");
    let err = world.refused(&train.replace("--steps 6", "--steps 9"));
    assert!(err.contains("steps: was 6, now 9"), "{err}");
    let densify = "densify --map sparse.safetensors --grid 0.5 --span 1x0 --weights h.safetensors";
    let (_, err) = world.ok(&format!("{densify} -o dense.safetensors --renormalise"));
    assert!(err.contains("54 regressed rows after 18"), "{err}");
    let err = world.refused(&format!("{densify} -o d.safetensors").replace("sparse", "others"));
    assert!(err.contains("trained on `toy`, the map is of `another`"), "{err}");
}
