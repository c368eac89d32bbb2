//! Rigs, records and what is missing between them.

use nalgebra::{UnitQuaternion, Vector3};
use vpr_core::Position;

use super::*;

fn write_files(files: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("sensors")).unwrap();
    for (name, text) in files {
        fs::write(folder.path().join("sensors").join(name), text).unwrap();
    }
    folder
}

fn read_files(files: &[(&str, &str)]) -> Read<Parts> {
    read(write_files(files).path())
}

fn reasons(files: &[(&str, &str)]) -> Vec<String> {
    let problems = read_files(files).unwrap_err();
    problems
        .iter()
        .map(|err| err.to_string().rsplit_once("sensors/").unwrap().1.to_owned())
        .collect()
}

fn names(parts: &Parts) -> Vec<&str> {
    parts.names.as_ref().unwrap().iter().collect()
}

const RECORDS: (&str, &str) = (
    "records_camera.txt",
    "# timestamp, device_id, image_path\n0, left, l/0.jpg\n0, right, r/0.jpg\n1, left, l/1.jpg\n",
);

#[test]
fn a_sensor_is_where_its_rig_carries_it() {
    // The rig stands at (−10, 0, 0)… in its own frame the world is moved by 10: at world (−10, 0, 0).
    // The right camera sits half a metre to the rig's right and looks the same way.
    let parts = read_files(&[
        ("trajectories.txt", "0, rig, 1, 0, 0, 0, 10, 0, 0\n1, rig, 1, 0, 0, 0, 11, 0, 0\n"),
        ("rigs.txt", "rig, left, 1, 0, 0, 0, 0, 0, 0\nrig, right, 1, 0, 0, 0, -0.5, 0, 0\n"),
        RECORDS,
    ])
    .unwrap();
    assert_eq!(names(&parts), ["l/0.jpg", "r/0.jpg", "l/1.jpg"]);
    let poses = parts.poses.as_ref().unwrap();
    let at = |row| poses.position(row);
    assert_eq!(at(0), Position::new(-10.0, 0.0, 0.0));
    assert_eq!(at(1), Position::new(-9.5, 0.0, 0.0));
    assert_eq!(at(2), Position::new(-11.0, 0.0, 0.0));
    assert_eq!(parts.notes, Vec::<String>::new());
}

#[test]
fn nested_rigs_compose_as_kapture_composes_them() {
    // camera from world = camera from head · head from car · car from world, checked by matrices.
    let turn = |axis: [f64; 3], angle: f64| UnitQuaternion::new(Vector3::from(axis) * angle);
    let car = Pose::from_parts([1.0, -2.0, 0.5].into(), turn([0.0, 0.0, 1.0], 0.7));
    let head = Pose::from_parts([0.1, 0.2, 1.5].into(), turn([1.0, 0.0, 0.0], -0.3));
    let camera = Pose::from_parts([0.05, 0.0, -0.1].into(), turn([0.0, 1.0, 0.0], 1.1));
    let text = |pose: &Pose| {
        let q = pose.rotation.quaternion();
        let t = pose.translation.vector;
        format!("{}, {}, {}, {}, {}, {}, {}", q.w, q.i, q.j, q.k, t.x, t.y, t.z)
    };
    let parts = read_files(&[
        ("trajectories.txt", &format!("7, car, {}\n", text(&car))),
        ("rigs.txt", &format!("head, left, {}\ncar, head, {}\n", text(&camera), text(&head))),
        ("records_camera.txt", "007, left, a.jpg\n"),
    ])
    .unwrap();
    let expected = camera.to_homogeneous() * head.to_homogeneous() * car.to_homogeneous();
    let found = parts.poses.unwrap().six_dof().unwrap()[0].inverse().to_homogeneous();
    assert!((found - expected).amax() < 1e-12, "{found} {expected}");
}

#[test]
fn images_without_a_pose_and_poses_without_an_image_are_said() {
    let parts = read_files(&[
        (
            "trajectories.txt",
            "0, left, 1, 0, 0, 0, 1, 2, 3\n0, right, , , , , 1, 2, 3\n0, lidar, 1, 0, 0, 0, 0, 0, 0\n",
        ),
        RECORDS,
    ])
    .unwrap();
    assert_eq!(names(&parts), ["l/0.jpg"]);
    assert_eq!(parts.notes.len(), 2);
    assert!(parts.notes[0].ends_with("1 poses are of no image and not used"), "{:?}", parts.notes);
    assert!(
        parts.notes[1].ends_with("2 images have no pose, such as `r/0.jpg`"),
        "{:?}",
        parts.notes
    );
}

#[test]
fn without_records_images_are_called_by_time_and_device() {
    let parts = read_files(&[
        ("trajectories.txt", "0, rig, 1, 0, 0, 0, 0, 0, 0\n1, cam, 1, 0, 0, 0, 0, 0, 0\n"),
        ("rigs.txt", "rig, cam, 1, 0, 0, 0, 0, 0, -0.5\n"),
    ])
    .unwrap();
    assert_eq!(names(&parts), ["0/cam", "1/cam"]);
    assert_eq!(parts.poses.as_ref().unwrap().position(0), Position::new(0.0, 0.0, 0.5));
    assert!(parts.notes[0].contains("called time/device"), "{:?}", parts.notes);
}

#[test]
fn what_contradicts_itself_is_refused_by_line() {
    let both = "0, rig, 1, 0, 0, 0, 0, 0, 0\n0, left, 1, 0, 0, 0, 0, 0, 3\n";
    let rigs = ("rigs.txt", "rig, left, 1, 0, 0, 0, 0, 0, 0\n");
    let found = reasons(&[("trajectories.txt", both), rigs, RECORDS]);
    assert_eq!(found, ["trajectories.txt: line 1: places `l/0.jpg` elsewhere than line 2 does"]);
    let twice = "0, left, 1, 0, 0, 0, 0, 0, 0\n00, left, 1, 0, 0, 0, 0, 0, 1\n";
    let found = reasons(&[("trajectories.txt", twice), RECORDS]);
    assert_eq!(
        found,
        ["trajectories.txt: line 2: a second pose of `left` at time 00, as on line 1"]
    );
    let fine = ("trajectories.txt", "0, left, 1, 0, 0, 0, 0, 0, 0\n");
    let records = ("records_camera.txt", "0, left, a.jpg\n0, left, b.jpg\n1, left, a.jpg\n");
    assert_eq!(
        reasons(&[fine, records]),
        [
            "records_camera.txt: line 2: a second image of `left` at time 0, as on line 1",
            "records_camera.txt: line 3: `a.jpg` is the image on line 1, too"
        ]
    );
    let circle = ("rigs.txt", "a, b, 1, 0, 0, 0, 0, 0, 0\nb, a, 1, 0, 0, 0, 0, 0, 0\n");
    assert!(reasons(&[fine, circle, RECORDS])[0].contains("is on itself"));
    let short = ("rigs.txt", "rig, left, 1, 0, 0, 0\n");
    assert_eq!(reasons(&[fine, short]), ["rigs.txt: line 1: has 4 numbers, expected 7"]);
}

#[test]
fn names_with_commas_have_no_place() {
    let parts = Parts {
        names: Some(["a, b.jpg"].into_iter().collect()),
        poses: Some(Poses::SixDof(vec![Pose::identity()])),
        ..Parts::default()
    };
    let folder = tempfile::tempdir().unwrap();
    let err = write(folder.path(), &parts).unwrap_err().to_string();
    assert!(err.contains("`a, b.jpg`: has a comma"), "{err}");
}
