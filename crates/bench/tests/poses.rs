//! Every format that holds poses × every door that takes them: the same poses come through.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

use nalgebra::Vector3;
use ndarray::{Array2, array};
use vpr_core::{
    Descriptors, PlanarPosition, Pose, Poses,
    map::{About, Coordinates, LatLon, Names},
};
use vpr_data::exchange::{self, Format, Parts};
use vpr_files::npy;

const N: usize = 6;

fn bench(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bench"));
    command.current_dir(folder).args(arguments).env_remove("VPR_DATA");
    command.output().expect("the program starts")
}

fn stdout(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(0), "{}", stderr(output));
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// Asserts exit code 2 and a one-line error that contains all of these.
fn assert_refused(output: &Output, parts: &[&str]) {
    let text = stderr(output);
    assert_eq!(output.status.code(), Some(2), "{text}");
    let error = text.lines().filter(|line| !line.starts_with("note: ")).collect::<Vec<_>>();
    assert!(error.len() == 1 && error[0].starts_with("error: "), "{text}");
    for part in parts {
        assert!(error[0].contains(part), "`{part}` is not in: {text}");
    }
}

fn descriptors() -> Array2<f32> {
    Array2::from_shape_fn((N, 3), |(row, column)| ((row * 7 + column * 3) as f32).sin())
}

/// Descriptors without names, of references and of queries.
fn rows(folder: &Path) {
    npy::write_f32(&folder.join("d.npy"), descriptors().view()).unwrap();
    npy::write_f32(&folder.join("q.npy"), (&descriptors() + 0.05).view()).unwrap();
}

/// Cameras along a curve; names that every format holds.
fn cameras() -> Parts {
    let pose = |row: usize| {
        let turn = Vector3::new(0.2, -0.4, 0.3 * row as f64);
        Pose::new(Vector3::new(2.0 * row as f64, (row * row) as f64, 0.5), turn)
    };
    Parts {
        names: Some((0..N).map(|row| format!("{row}.25")).collect()),
        poses: Some(Poses::SixDof((0..N).map(pose).collect())),
        descriptors: Some(Descriptors::new(descriptors()).unwrap()),
        ..Parts::default()
    }
}

/// Centimetres, which names hold.
fn places() -> Parts {
    let position =
        |row: usize| PlanarPosition::new(480_000.0 + 3.25 * row as f64, 4_427_750.0 + row as f64);
    let coordinates = Some(Coordinates::Utm("18N".parse().unwrap()));
    Parts {
        poses: Some(Poses::Planar((0..N).map(position).collect())),
        about: About { coordinates, ..About::default() },
        names: Some((0..N).map(|row| format!("{row}.jpg")).collect()),
        ..cameras()
    }
}

/// The poses of a table that `bench map convert` wrote.
fn table(path: &Path) -> Poses {
    exchange::read(Format::PoseCsv, path).unwrap().poses.unwrap()
}

fn assert_close(found: &Poses, expected: &Poses, what: &str) {
    assert_eq!((found.kind(), found.len()), (expected.kind(), expected.len()), "{what}");
    for row in 0..expected.len() {
        let apart = (found.position(row) - expected.position(row)).norm();
        assert!(apart < 2e-5, "{what}: row {row} is off by {apart} m");
        if let (Ok(found), Ok(expected)) = (found.six_dof(), expected.six_dof()) {
            let angle = found[row].rotation.angle_to(&expected[row].rotation);
            assert!(angle < 1e-6, "{what}: row {row} is off by {angle} rad");
        }
    }
}

/// Sends the poses of every one of these files through every door.
fn through_every_door(parts: &Parts, files: &[(Format, &str)]) {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    rows(folder);
    let expected = parts.poses.as_ref().unwrap();
    let mut evaluated = Vec::new();
    for &(format, file) in files {
        exchange::write(format, &folder.join(file), parts).unwrap();
        let (name, kind) = (format.name(), format.kind());
        for named in [true, false] {
            // Files whose names say their format need no flag.
            if !named && Format::guess(&folder.join(file)).ok() != Some(format) {
                continue;
            }
            let with = |arguments: &[&str], flag: &str| {
                let flags = [flag, name];
                let flags = if named { flags.as_slice() } else { &[] };
                bench(folder, &[arguments, flags].concat())
            };
            stdout(&with(&["map", "convert", file, "out.csv"], "--from"));
            assert_close(&table(&folder.join("out.csv")), expected, &format!("convert {name}"));
            let build =
                ["map", "build", "--descriptors", "d.npy", "--poses", file, "m.safetensors"];
            stdout(&with(&build, "--poses-format"));
            stdout(&bench(folder, &["map", "convert", "m.safetensors", "built.csv"]));
            assert_close(&table(&folder.join("built.csv")), expected, &format!("build {name}"));
            let evaluate = [
                "evaluate",
                "--database-descriptors",
                "d.npy",
                "--queries-descriptors",
                "q.npy",
                "--database-poses",
                file,
                "--queries-poses",
                file,
                "--positive-dist-threshold",
                "3.5",
                "--recall-values",
                "1",
                "2",
                "3",
            ];
            evaluated.push((name, kind, stdout(&with(&evaluate, "--poses-format"))));
        }
    }
    assert!(evaluated.iter().all(|it| it.2 == evaluated[0].2), "{evaluated:?}");
    assert!(evaluated[0].2.starts_with("R@1: 100.0, "), "{evaluated:?}");
}

#[test]
fn cameras_come_through_every_door() {
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
        (Format::Safetensors, "plain.safetensors"),
    ];
    through_every_door(&cameras(), &files);
}

#[test]
fn places_come_through_every_door() {
    let files = [
        (Format::PoseCsv, "poses.csv"),
        (Format::LatLon, "gps.csv"),
        (Format::UtmNames, "names.txt"),
        (Format::Npz, "poses.npz"),
    ];
    through_every_door(&places(), &files);
}

#[test]
fn every_format_of_poses_is_in_the_matrix_or_a_folder_of_images() {
    let tested = [
        "csv",
        "latlon",
        "utm-names",
        "hloc-poses",
        "colmap",
        "kapture",
        "tum",
        "kitti",
        "7scenes",
    ];
    let poses = Format::ALL.into_iter().filter(|it| it.kind() == exchange::Kind::Poses);
    for format in poses {
        assert!(tested.contains(&format.name()), "{format}");
    }
}

#[test]
fn a_path_that_says_nothing_asks_for_the_flag_that_helps() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    rows(folder);
    fs::write(folder.join("poses"), "1 0 0 0 0 1 0 0 0 0 1 0\n").unwrap();
    fs::copy(folder.join("d.npy"), folder.join("rows")).unwrap();
    let build = bench(folder, &["map", "build", "--descriptors", "d.npy", "--poses", "poses", "m"]);
    assert_refused(&build, &["poses: name: ", "give `--poses-format` one of", "kitti"]);
    let build = bench(folder, &["map", "build", "--descriptors", "rows", "m"]);
    assert_refused(&build, &["rows: name: ", "give `--from` one of", "npy"]);
    stdout(&bench(folder, &["map", "build", "--descriptors", "rows", "--from", "npy", "m"]));
}

#[test]
fn named_poses_win_and_what_is_no_table_is_only_mentioned() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    rows(folder);
    exchange::write(Format::PoseCsv, &folder.join("good.csv"), &cameras()).unwrap();
    // A table of training, and a result of an earlier search, beside the descriptors.
    fs::write(folder.join("d.csv"), "epoch,loss\n1,0.5\n").unwrap();
    fs::write(folder.join("q.csv"), "query,rank,reference,distance\n0,1,a.jpg,0.1\n").unwrap();
    let build = ["map", "build", "--descriptors", "d.npy", "--poses", "good.csv", "m.safetensors"];
    stdout(&bench(folder, &build));
    let search = ["map", "search", "m.safetensors", "--queries", "q.npy", "-k", "1"];
    let found = bench(folder, &search);
    assert!(stdout(&found).starts_with("query,rank,reference,distance\n0,1,0.25,"));
    assert!(stderr(&found).contains("q.csv: is no table of poses"), "{}", stderr(&found));
    // A table of other poses gives way to named ones, too.
    exchange::write(Format::PoseCsv, &folder.join("d.csv"), &places()).unwrap();
    stdout(&bench(folder, &build));
    stdout(&bench(folder, &["map", "convert", "m.safetensors", "out.csv"]));
    assert_close(&table(&folder.join("out.csv")), &cameras().poses.unwrap(), "named");
    // Without them it is used, so it must be sound; a search does not need it.
    fs::write(folder.join("d.csv"), "name,x,y\na,1\n").unwrap();
    let alone = ["map", "build", "--descriptors", "d.npy", "m.safetensors"];
    assert_refused(&bench(folder, &alone), &["d.csv: line 2, column y"]);
    fs::write(folder.join("q.csv"), "name,x,y\na,1\n").unwrap();
    let found = bench(folder, &search);
    assert!(stdout(&found).contains("\n0,1,0.25,"));
    assert!(stderr(&found).contains("q.csv: line 2, column y"), "{}", stderr(&found));
}

#[test]
fn names_in_an_archive_decide_which_pose_is_whose() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut archive = npy::npz::Writer::new(fs::File::create(folder.join("d.npz")).unwrap());
    let rows = [[1.0_f32, 0.0], [0.0, 1.0]];
    archive
        .add("descriptors", "<f4", &[2, 2], rows.iter().flatten().map(|it| it.to_le_bytes()))
        .unwrap();
    let names = ["b.jpg", "a.jpg"].concat();
    archive.add("names", "<U5", &[2], names.chars().map(|it| u32::from(it).to_le_bytes())).unwrap();
    archive.add("labels", "|u1", &[2], [[1_u8], [2]].into_iter()).unwrap();
    archive.finish().unwrap();
    fs::write(folder.join("p.csv"), "name,x,y,z\na.jpg,0,0,0\nb.jpg,100,0,0\n").unwrap();
    let build = bench(
        folder,
        &["map", "build", "--descriptors", "d.npz", "--poses", "p.csv", "m.safetensors"],
    );
    stdout(&build);
    assert!(stderr(&build).contains("arrays that are not used: labels"), "{}", stderr(&build));
    stdout(&bench(folder, &["map", "convert", "m.safetensors", "out.csv"]));
    let out = fs::read_to_string(folder.join("out.csv")).unwrap();
    assert_eq!(out, "name,x,y,z\nb.jpg,100,0,0\na.jpg,0,0,0\n");
}

#[test]
fn a_time_stamp_in_two_rows_is_refused_in_every_door() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    npy::write_f32(&folder.join("d.npy"), array![[1.0_f32], [2.0]].view()).unwrap();
    fs::write(folder.join("p.tum"), "1.0 0 0 0 0 0 0 1\n1.0 5 0 0 0 0 0 1\n").unwrap();
    let build = bench(folder, &["map", "build", "--descriptors", "d.npy", "--poses", "p.tum", "m"]);
    assert_refused(&build, &["p.tum: ", "`1.0` stands in rows 0 and 1"]);
    let evaluate = bench(
        folder,
        &[
            "evaluate",
            "--database-descriptors",
            "d.npy",
            "--queries-descriptors",
            "d.npy",
            "--database-poses",
            "p.tum",
            "--queries-poses",
            "p.tum",
        ],
    );
    assert_refused(&evaluate, &["p.tum: ", "`1.0` stands in rows 0 and 1"]);
    let convert = bench(folder, &["map", "convert", "p.tum", "out.csv"]);
    assert_refused(&convert, &["`1.0`", "rows 0 and 1"]);
}

#[test]
fn names_that_a_format_cannot_hold_are_quoted_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    rows(folder);
    let names: Names = (0..N).map(|row| format!("db/street {row}, left.jpg")).collect();
    let parts = Parts { names: Some(names), ..cameras() };
    exchange::write(Format::Npz, &folder.join("d.npz"), &parts).unwrap();
    stdout(&bench(folder, &["map", "build", "--descriptors", "d.npz", "m.safetensors"]));
    let search = ["map", "search", "m.safetensors", "--queries", "q.npy", "-k", "1"];
    let found = stdout(&bench(folder, &search));
    assert!(found.contains("\n0,1,\"db/street 0, left.jpg\","), "{found}");
    let pairs = bench(folder, &[search.as_slice(), &["--out", "pairs.txt"]].concat());
    assert_refused(&pairs, &["pairs.txt: name `db/street", "has a blank"]);
    assert!(!folder.join("pairs.txt").exists());
    stdout(&bench(folder, &[search.as_slice(), &["--out", "log", "--to", "vpr-eval"]].concat()));
    for (to, out) in [("hloc-poses", "p.txt"), ("colmap", "images.txt"), ("kapture", "k")] {
        let output = bench(folder, &["map", "convert", "m.safetensors", out, "--to", to]);
        assert_refused(&output, &["name `db/street 0, left.jpg`"]);
    }
    stdout(&bench(folder, &["map", "convert", "m.safetensors", "out.csv"]));
    let read = exchange::read(Format::PoseCsv, &folder.join("out.csv")).unwrap();
    assert_eq!(read.names, parts.names);
    let lossy = bench(folder, &["map", "convert", "m.safetensors", "out.kitti"]);
    stdout(&lossy);
    let said = stderr(&lossy);
    assert!(
        said.contains("no place for the descriptors") && said.contains("for the names"),
        "{said}"
    );
}

#[test]
fn numbers_of_every_type_are_read_and_rounding_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    rows(folder);
    let doubles = descriptors().mapv(f64::from);
    npy::write_f64(&folder.join("f64.npy"), doubles.view()).unwrap();
    let build = bench(folder, &["map", "build", "--descriptors", "f64.npy", "m.safetensors"]);
    stdout(&build);
    assert!(
        stderr(&build).contains("descriptors are float64, rounded to float32"),
        "{}",
        stderr(&build)
    );
    stdout(&bench(folder, &["map", "convert", "m.safetensors", "back.npy"]));
    assert_eq!(npy::read_f32(&folder.join("back.npy")).unwrap(), descriptors());
    let evaluate = bench(
        folder,
        &[
            "evaluate",
            "--database-descriptors",
            "f64.npy",
            "--queries-descriptors",
            "d.npy",
            "--no-labels",
        ],
    );
    stdout(&evaluate);
    assert!(stderr(&evaluate).contains("float64"), "{}", stderr(&evaluate));
}

/// Two files of degrees on either side of the Greenwich meridian.
fn greenwich(folder: &Path) {
    fs::write(folder.join("w.csv"), "name,lat,lon\na,51.4779,-0.0005\nb,51.4779,-0.0015\n")
        .unwrap();
    fs::write(folder.join("e.csv"), "name,lat,lon\na,51.4779,0.0005\nb,51.4779,0.0015\n").unwrap();
    npy::write_f32(&folder.join("d.npy"), array![[1.0_f32, 0.0], [0.0, 1.0]].view()).unwrap();
}

#[test]
fn degrees_on_both_sides_of_a_zone_are_put_into_one() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    greenwich(folder);
    let evaluate = |more: &[&str]| {
        let arguments = [
            "evaluate",
            "--database-descriptors",
            "d.npy",
            "--queries-descriptors",
            "d.npy",
            "--database-poses",
            "w.csv",
            "--queries-poses",
            "e.csv",
            "--recall-values",
            "1",
            "--positive-dist-threshold",
            "100",
        ];
        bench(folder, &[arguments.as_slice(), more].concat())
    };
    assert_refused(&evaluate(&[]), &["e.csv", "utm 31N", "w.csv", "utm 30N", "--zone"]);
    // a is 70 m from a, b is 208 m from b.
    let one = evaluate(&["--zone", "30N"]);
    assert_eq!(stdout(&one), "R@1: 50.0\n");
    assert!(
        stderr(&one).contains("e.csv: 2 of 2 positions lie outside of UTM zone 30N"),
        "{}",
        stderr(&one)
    );
    let both = fs::read_to_string(folder.join("w.csv")).unwrap() + "c,51.4779,0.0005\n";
    fs::write(folder.join("both.csv"), both).unwrap();
    let convert =
        |more: &[&str]| bench(folder, &[&["map", "convert", "both.csv", "out.csv"], more].concat());
    assert_refused(
        &convert(&[]),
        &["both.csv", "30N (2, first line 2), 31N (1, line 4)", "--zone 30N"],
    );
    let auto = convert(&["--zone", "auto"]);
    stdout(&auto);
    assert!(
        stderr(&auto).contains("UTM zone 30N") && stderr(&auto).contains("scale factor"),
        "{}",
        stderr(&auto)
    );
    let out = table(&folder.join("out.csv"));
    let expected = LatLon { lat: 51.4779, lon: 0.0005 }.to_utm("30N".parse().unwrap());
    assert_eq!(out.planar().unwrap()[2], expected);
    let output = bench(folder, &["map", "convert", "both.csv", "out.csv", "--zone", "18T"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("no UTM zone"), "{}", stderr(&output));
}

#[test]
fn planes_and_spaces_are_not_compared() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    rows(folder);
    exchange::write(Format::PoseCsv, &folder.join("flat.csv"), &places()).unwrap();
    exchange::write(Format::PoseCsv, &folder.join("full.csv"), &cameras()).unwrap();
    let output = bench(
        folder,
        &[
            "evaluate",
            "--database-descriptors",
            "d.npy",
            "--queries-descriptors",
            "q.npy",
            "--database-poses",
            "flat.csv",
            "--queries-poses",
            "full.csv",
        ],
    );
    assert_refused(&output, &["full.csv: positions: have three coordinates", "flat.csv easting"]);
}

#[test]
fn what_cannot_be_written_is_refused_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::create_dir(folder.join("there")).unwrap();
    let build = bench(folder, &["map", "build", "--descriptors", "missing.npy", "there"]);
    assert_refused(&build, &["there: is a folder"]);
    let search = bench(
        folder,
        &["map", "search", "missing", "--queries", "missing", "--out", "no/such/p.txt"],
    );
    assert_refused(&search, &["no/such is no folder"]);
    let zero = bench(folder, &["map", "search", "missing", "--queries", "missing", "-k", "0"]);
    assert!(stderr(&zero).contains("must be at least 1"), "{}", stderr(&zero));
}

#[test]
fn fewer_references_than_k_are_said() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    rows(folder);
    stdout(&bench(folder, &["map", "build", "--descriptors", "d.npy", "m.safetensors"]));
    let search = bench(folder, &["map", "search", "m.safetensors", "--queries", "q.npy"]);
    assert_eq!(stdout(&search).lines().count(), 1 + N * N);
    assert!(stderr(&search).contains("6 references, fewer than `-k 10`"), "{}", stderr(&search));
}
