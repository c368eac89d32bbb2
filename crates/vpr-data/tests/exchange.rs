//! Every door of the map: what is written is read, and what others wrote means what they meant.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a test fails by panicking and says what it skips"
)]

use std::path::{Path, PathBuf};

use nalgebra::{UnitQuaternion, Vector3};
use ndarray::Array2;
use vpr_core::{
    Descriptors, Error, PlanarPosition, Pose, Poses,
    map::{About, Coordinates, Names, UtmZone},
};
use vpr_data::exchange::{self, Direction, Format, PairList, Pairs, Parts, Reading};
use vpr_files::npy;

const N: usize = 7;

fn descriptors() -> Descriptors {
    let value = |(row, column): (usize, usize)| ((row * 13 + column * 5) as f32).sin();
    Descriptors::new(Array2::from_shape_fn((N, 6), value)).unwrap()
}

fn poses() -> Poses {
    let pose = |row: usize| {
        let turn = Vector3::new(0.1, 0.2, row as f64);
        Pose::new(Vector3::new(row as f64 * 1.5, -2.0, 0.25), turn)
    };
    Poses::SixDof((0..N).map(pose).collect())
}

fn names() -> Names {
    (0..N).map(|row| format!("db/frame-{row:06}.color.png")).collect()
}

fn parts() -> Parts {
    let poses = Some(poses());
    Parts { names: Some(names()), descriptors: Some(descriptors()), poses, ..Parts::default() }
}

/// Writes and reads again.
fn round_trip(format: Format, parts: &Parts) -> Parts {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file.npy");
    exchange::write(format, &path, parts).unwrap();
    assert!(
        exchange::problems(format, &path).is_empty(),
        "{:?}",
        exchange::problems(format, &path)
    );
    exchange::read(format, &path).unwrap()
}

fn assert_close(read: &Poses, written: &Poses) {
    let pairs = read.six_dof().unwrap().iter().zip(written.six_dof().unwrap());
    assert_eq!(read.len(), written.len());
    for (read, written) in pairs {
        let offset = (read.translation.vector - written.translation.vector).norm();
        let angle = read.rotation.angle_to(&written.rotation);
        assert!(offset < 1e-12 && angle < 1e-7, "off by {offset} m and {angle} rad");
    }
}

#[test]
fn descriptors_pass_every_door_bit_by_bit() {
    use Format::{HlocH5, Map, Npy, Npz, Safetensors, VprEval, VprEvalQueries};
    for format in [Map, Npy, Npz, Safetensors, HlocH5, VprEval, VprEvalQueries] {
        let read = round_trip(format, &parts());
        assert_eq!(read.descriptors, Some(descriptors()), "{format}");
        if !matches!(format, VprEval | VprEvalQueries) {
            assert_eq!(read.names, Some(names()), "{format}");
        }
        if !matches!(format, VprEval | VprEvalQueries | HlocH5) {
            assert_close(&read.poses.unwrap(), &poses());
        }
    }
}

#[test]
fn poses_pass_every_door() {
    use Format::{Colmap, HlocPoses, Kapture, Kitti, PoseCsv, SevenScenes, Tum};
    for format in [HlocPoses, Colmap, Kapture, Kitti, PoseCsv, Tum] {
        let read = round_trip(format, &parts());
        assert_close(&read.poses.unwrap(), &poses());
        if !matches!(format, Kitti | Tum) {
            assert_eq!(read.names, Some(names()), "{format}");
        }
    }
    let flat: Names = (0..N).map(|row| format!("frame-{row:06}.color.png")).collect();
    let read = round_trip(SevenScenes, &Parts { names: Some(flat.clone()), ..parts() });
    assert_close(&read.poses.unwrap(), &poses());
    assert_eq!(read.names, Some(flat));
}

#[test]
fn planar_poses_pass_through_degrees_and_names() {
    let zone = UtmZone { number: 10, south: false };
    let position = |row: usize| PlanarPosition::new(549_678.25 + row as f64, 4_180_874.5);
    let poses = Poses::Planar((0..N).map(position).collect());
    let coordinates = Some(Coordinates::Utm(zone));
    let about = About { coordinates, ..About::default() };
    let planar = Parts { poses: Some(poses.clone()), about: about.clone(), ..parts() };
    let read = round_trip(Format::LatLon, &planar);
    assert_eq!((&read.about, &read.names), (&about, &planar.names));
    for row in 0..N {
        let offset = (read.poses.as_ref().unwrap().position(row) - poses.position(row)).norm();
        assert!(offset < 2e-5, "row {row} is off by {offset} m");
    }
    let read = round_trip(Format::UtmNames, &planar);
    assert_eq!((read.poses, &read.about), (Some(poses.clone()), &about));
    let read = round_trip(Format::PoseCsv, &planar);
    assert_eq!(read.poses, Some(poses));
}

#[test]
fn pairs_pass_both_doors() {
    let list = |query: &str, references: [&str; 2]| PairList {
        query: query.to_owned(),
        references: references.map(str::to_owned).to_vec(),
    };
    let pairs = Pairs { lists: vec![list("q/1.jpg", ["b", "a"]), list("q/0.jpg", ["a", "c"])] };
    for format in [Format::HlocPairs, Format::VprEval] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pairs");
        exchange::write_pairs(format, &path, &pairs).unwrap();
        assert_eq!(exchange::read_pairs(format, &path).unwrap(), pairs, "{format}");
    }
}

#[test]
fn every_line_with_a_problem_is_listed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("poses.txt");
    let text = "a 1 0 0 0 0 0 0\nb 1 0 0 0 0 0\nc 2 0 0 0 0 0 0\nd 1 0 0 0 0 x 0\n";
    std::fs::write(&path, text).unwrap();
    let prefix = format!("{}: ", path.display());
    let problems = exchange::problems(Format::HlocPoses, &path);
    let problems: Vec<String> =
        problems.iter().map(|err| err.to_string().replace(&prefix, "")).collect();
    assert_eq!(
        problems,
        [
            "line 2: has 6 numbers, expected 7",
            "line 3: the quaternion has length 2, not 1",
            "line 4: `x` is not a finite number"
        ]
    );
    let err = exchange::read(Format::HlocPoses, &path).unwrap_err().to_string();
    assert!(err.ends_with("line 2: has 6 numbers, expected 7 (and 2 more problems)"), "{err}");
}

#[test]
fn a_zone_crossing_is_refused_with_its_lines() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("gps.csv");
    std::fs::write(&path, "name,lat,lon\na,52.0,5.9\nb,52.0,6.1\n").unwrap();
    let err = exchange::read(Format::LatLon, &path).unwrap_err().to_string();
    assert!(err.contains("different UTM zones: 31N (1, line 2), 32N (1, line 3)"), "{err}");
}

#[test]
fn a_name_with_two_rows_has_no_place_in_hdf5() {
    let names = Some(["a"; N].into_iter().collect());
    let folder = tempfile::tempdir().unwrap();
    let parts = Parts { names, ..parts() };
    let err = exchange::write(Format::HlocH5, &folder.path().join("a.h5"), &parts).unwrap_err();
    assert!(err.to_string().contains("is the name of two images"), "{err}");
}

#[test]
fn formats_without_orientation_are_not_given_one() {
    let folder = tempfile::tempdir().unwrap();
    let planar = Poses::Planar(vec![PlanarPosition::origin(); N]);
    let parts = Parts { poses: Some(planar), ..parts() };
    let err = exchange::write(Format::Tum, &folder.path().join("tum.txt"), &parts).unwrap_err();
    assert!(matches!(err, Error::PoseKind { .. }), "{err}");
}

#[test]
fn parts_that_say_nothing_alone_are_refused_and_poses_may_stand_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    let npz = |arrays: &[&str]| {
        let mut archive = npy::npz::Writer::new(std::fs::File::create(&path).unwrap());
        for array in arrays {
            let (descr, shape): (_, &[usize]) = match *array {
                "positions" => ("<i4", &[2, 3]),
                "orientations" => ("<f4", &[2, 4]),
                "names" => ("|u1", &[2]),
                "name_offsets" => ("<i8", &[3]),
                _ => ("<f4", &[2, 2]),
            };
            let n: usize = shape.iter().product();
            let size = if descr == "<i8" { 8 } else { 4 };
            let size = if descr == "|u1" { 1 } else { size };
            archive.add(array, descr, shape, (0..n * size).map(|_| [0])).unwrap();
        }
        archive.finish().unwrap();
        exchange::read(Format::Npz, &path).map_err(|err| err.to_string())
    };
    let alone = npz(&["positions"]).unwrap();
    assert_eq!((alone.descriptors, alone.poses.unwrap().len()), (None, 2));
    // One matrix of numbers is that of descriptors, whatever it is called.
    assert_eq!(npz(&["arr_0"]).unwrap().descriptors.unwrap().len(), 2);
    for (arrays, expected) in [
        (&["arr_0", "arr_1"][..], "several matrices are: arr_0, arr_1"),
        (&["descriptors", "orientations"], "no `positions`"),
        (&["descriptors", "names"], "no `name_offsets`"),
        (&["descriptors", "name_offsets"], "no `names`"),
        (&["descriptors", "positions", "orientations"], "length 0"),
    ] {
        let err = npz(arrays).unwrap_err();
        assert!(err.contains(expected), "{arrays:?}: {err}");
    }
}

#[test]
fn tensors_of_every_type_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.safetensors");
    let read = |dtype: &str, bytes: &[u8]| {
        let (n, length) = (bytes.len(), bytes.len() / 2);
        let length = if dtype == "BF16" || dtype == "F16" { length / 2 } else { length / 8 };
        let header =
            format!(r#"{{"x":{{"dtype":"{dtype}","shape":[2,{length}],"data_offsets":[0,{n}]}}}}"#);
        let size = (header.len() as u64).to_le_bytes();
        std::fs::write(&path, [&size, header.as_bytes(), bytes].concat()).unwrap();
        let parts = exchange::read(Format::Safetensors, &path).unwrap();
        let rows = parts.descriptors.unwrap().into_inner();
        (rows.iter().copied().collect::<Vec<f32>>(), parts.notes)
    };
    // 1.5 and −2, twice each.
    let brain: Vec<u8> = [0x3fc0_u16, 0xc000].iter().flat_map(|it| it.to_le_bytes()).collect();
    assert_eq!(read("BF16", &brain.repeat(2)), (vec![1.5, -2.0, 1.5, -2.0], vec![]));
    let half: Vec<u8> = [0x3e00_u16, 0xc000].iter().flat_map(|it| it.to_le_bytes()).collect();
    assert_eq!(read("F16", &half).0, [1.5, -2.0]);
    let doubles: Vec<u8> = [0.1_f64, 3.0].iter().flat_map(|it| it.to_le_bytes()).collect();
    let (rows, notes) = read("F64", &doubles);
    assert_eq!(rows, [0.1, 3.0]);
    assert!(notes[0].ends_with("`x` are float64, rounded to float32"), "{notes:?}");
    let whole: Vec<u8> = [-7_i64, 8].iter().flat_map(|it| it.to_le_bytes()).collect();
    assert_eq!(read("I64", &whole).0, [-7.0, 8.0]);
}

#[test]
fn a_table_beside_descriptors_must_fit_or_be_none() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("d.npy");
    exchange::write(Format::Npy, &path, &parts()).unwrap();
    let read = |text: &str| {
        std::fs::write(folder.path().join("d.csv"), text).unwrap();
        exchange::read(Format::Npy, &path)
    };
    let err = read("name,x,y\na,1,2\n").unwrap_err().to_string();
    assert!(err.ends_with("d.csv: rows: has 1 poses for the 7 descriptors beside it"), "{err}");
    let none = read("a,b\n1,2\n").unwrap();
    assert_eq!((none.names, none.poses), (None, None));
    assert!(
        none.notes[0].ends_with("d.csv: is no table of poses, and not used"),
        "{:?}",
        none.notes
    );
    // And it is not written over.
    let err = exchange::write(Format::Npy, &path, &parts()).unwrap_err().to_string();
    assert!(err.contains("d.csv"), "{err}");
}

#[test]
fn directions_are_named_only_where_files_leave_them_open() {
    let folder = tempfile::tempdir().unwrap();
    let (tum, kitti) = (folder.path().join("a.tum"), folder.path().join("a.kitti"));
    // At (1, 2, 3), turned by 90° about z; the files hold the inverse of that.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    std::fs::write(&tum, format!("0 -2 1 -3 0 0 {} {half}\n", -half)).unwrap();
    let reading = Reading { direction: Some(Direction::CameraFromWorld), ..Reading::default() };
    let read = exchange::read_with(Format::Tum, &tum, reading).unwrap();
    let expected = Pose::from_parts(
        [1.0, 2.0, 3.0].into(),
        UnitQuaternion::new(Vector3::z() * std::f64::consts::FRAC_PI_2),
    );
    assert_close(&read.poses.unwrap(), &Poses::SixDof(vec![expected]));
    std::fs::write(&kitti, "1 0 0 0 0 1 0 0 0 0 1 0\n").unwrap();
    let err = exchange::read_with(Format::Kitti, &kitti, reading).unwrap_err().to_string();
    assert!(err.contains("camera-from-world, of kitti"), "{err}");
}

#[test]
fn what_a_format_has_no_place_for_is_named() {
    let left_out = |format| exchange::left_out(format, &parts());
    assert_eq!(left_out(Format::Npz), Vec::<&str>::new());
    assert_eq!(left_out(Format::Npy), Vec::<&str>::new());
    assert_eq!(left_out(Format::HlocH5), ["poses"]);
    assert_eq!(left_out(Format::PoseCsv), ["descriptors"]);
    // Neither time stamps nor frames.
    assert_eq!(left_out(Format::Tum), ["descriptors", "names"]);
    assert_eq!(left_out(Format::SevenScenes), ["descriptors", "names"]);
    assert_eq!(left_out(Format::VprEval), ["poses", "names"]);
}

fn data(place: &str) -> Option<PathBuf> {
    let Some(root) = std::env::var_os("VPR_DATA") else {
        eprintln!("skipped: VPR_DATA is not set, real files are not read");
        return None;
    };
    Some(Path::new(&root).join(place))
}

#[test]
fn seven_scenes_pose_files_and_pose_lists_agree() {
    let (Some(sequence), Some(list)) =
        (data("7scenes/redkitchen/seq-01"), data("7scenes/poses/redkitchen_train.txt"))
    else {
        return;
    };
    let kinect = exchange::read(Format::SevenScenes, &sequence).unwrap();
    let pseudo = exchange::read(Format::HlocPoses, &list).unwrap();
    assert_eq!(kinect.names.as_ref().unwrap().len(), 1000);
    // Two reconstructions of the same frames: different numbers, the same directions and order.
    let names = pseudo.names.as_ref().unwrap();
    let rows: std::collections::HashMap<&str, usize> = names.iter().zip(0..).collect();
    let row_of = |name: &str| rows[format!("seq-01/{name}").as_str()];
    let [a, b] = [kinect.poses.as_ref().unwrap(), pseudo.poses.as_ref().unwrap()];
    let relative =
        |from: &Pose, to: &Pose| -> UnitQuaternion<f64> { (from.inverse() * to).rotation };
    let (a, b) = (a.six_dof().unwrap(), b.six_dof().unwrap());
    let kinect_names: Vec<&str> = kinect.names.as_ref().unwrap().iter().collect();
    for step in [100, 250, 499] {
        let (from, to) = (row_of(kinect_names[step]), row_of(kinect_names[step + 500]));
        let angle = relative(&a[step], &a[step + 500]).angle_to(&relative(&b[from], &b[to]));
        let distance =
            |from: &Pose, to: &Pose| (from.translation.vector - to.translation.vector).norm();
        let lengths = distance(&a[step], &a[step + 500]) - distance(&b[from], &b[to]);
        assert!(angle.to_degrees() < 3.0, "relative rotations differ by {}°", angle.to_degrees());
        assert!(lengths.abs() < 0.06, "distances of camera centres differ by {lengths} m");
    }
}
