//! Tables as people have them.

use super::*;
use crate::ZoneChoice;

fn read_with(text: &str, prefer: Prefer, reading: Reading) -> Read<Parts> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("poses.csv");
    std::fs::write(&path, text).unwrap();
    read(&path, prefer, reading)
}

fn parts(text: &str) -> Parts {
    read_with(text, Prefer::Metres, Reading::default()).unwrap()
}

/// Every problem, without the path.
fn reasons(text: &str) -> Vec<String> {
    let problems = read_with(text, Prefer::Metres, Reading::default()).unwrap_err();
    let reason = |err: &Error| err.to_string().split_once("poses.csv: ").unwrap().1.to_owned();
    problems.iter().map(reason).collect()
}

fn reason(text: &str) -> String {
    let reasons = reasons(text);
    assert_eq!(reasons.len(), 1, "{reasons:?}");
    reasons.into_iter().next().unwrap()
}

fn names(parts: &Parts) -> Vec<&str> {
    parts.names.as_ref().map(|names| names.iter().collect()).unwrap_or_default()
}

#[test]
fn one_table_in_many_shapes_is_one_table() {
    let expected = parts("name,x,y,z\na.jpg,1,2,3\nb.jpg,4,5,6\n");
    assert_eq!(expected.poses.as_ref().unwrap().position(1), Position::new(4.0, 5.0, 6.0));
    for text in [
        "z;y;x;name\n3;2;1;a.jpg\n6;5;4;b.jpg\n",
        "NAME\tX\tY\tZ\r\na.jpg\t1\t2\t3\r\nb.jpg\t4\t5\t6\r\n",
        "\u{feff}# of the survey\n\nImage , tx [m],ty [m] ,tz [m]\na.jpg, 1, 2, 3\n\nb.jpg,4,5,6\n",
        "# file: survey.bag\n# timestamp tx ty tz\na.jpg 1  2 3\nb.jpg 4 5 6\n",
        "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m]\na.jpg,1,2,3\nb.jpg,4,5,6\n",
        "\"file name\",pose.position.x,pose.position.y,pose.position.z\n\"a.jpg\",1,2,3\nb.jpg,4,5,6,\n",
        "filename x y z\na.jpg 1 2 3\nb.jpg 4 5 6",
    ] {
        let read = parts(text);
        assert_eq!((&read.names, &read.poses), (&expected.names, &expected.poses), "{text:?}");
        assert_eq!(read.notes, Vec::<String>::new(), "{text:?}");
    }
}

#[test]
fn planar_positions_go_by_several_titles() {
    for titles in
        ["easting,northing", "X,y", "utm_east,utm_north", "Utm_Easting,UTM_Northing", "tx,ty"]
    {
        let read = parts(&format!("name,{titles}\na,549678.37,4180874.6\n"));
        let expected = Poses::Planar(vec![PlanarPosition::new(549_678.37, 4_180_874.6)]);
        assert_eq!(read.poses, Some(expected), "{titles}");
    }
}

#[test]
fn mapillarys_tables_are_read_and_their_other_columns_named() {
    let read = parts(
        ",key,easting,northing,unique_cluster,night\n0,aa-1,349000.5,6173000.25,1,False\n\
         1,bb_2,349010.5,6173001.25,1,False\n",
    );
    assert_eq!(names(&read), ["aa-1", "bb_2"]);
    assert_eq!(read.poses.unwrap().position(1), Position::new(349_010.5, 6_173_001.25, 0.0));
    assert_eq!(read.notes.len(), 1);
    assert!(read.notes[0].ends_with("not used: unique_cluster, night"), "{:?}", read.notes);
    let raw = parts(",key,lon,lat,ca,pano\n0,aa-1,12.57,55.68,10.5,False\n");
    let zone = UtmZone { number: 33, south: false };
    assert_eq!(raw.about.coordinates, Some(Coordinates::Utm(zone)));
    let expected = LatLon { lat: 55.68, lon: 12.57 }.to_utm(zone);
    assert_eq!(raw.poses, Some(Poses::Planar(vec![expected])));
}

const EUROC: &str = "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], \
    q_RS_y [], q_RS_z [], v_RS_R_x [m s^-1], b_w_RS_S_x [rad s^-1]\n\
    1403636580838555648,4.5,-1.5,0.75,0.6,0,0,0.8,-0.02,-0.002\n";

#[test]
fn eurocs_header_and_the_named_directions() {
    let read = |direction| {
        let reading = Reading { direction, ..Reading::default() };
        read_with(EUROC, Prefer::Metres, reading).unwrap()
    };
    let plain = read(None);
    assert_eq!(names(&plain), ["1403636580838555648"]);
    let pose = plain.poses.as_ref().unwrap().six_dof().unwrap()[0];
    // cos(θ/2) = 0.6, sin(θ/2) = 0.8: x becomes (0.36 − 0.64, 2 · 0.48, 0).
    let x = pose.rotation * nalgebra::Vector3::x();
    assert!((x - nalgebra::Vector3::new(-0.28, 0.96, 0.0)).norm() < 1e-12, "{x}");
    assert_eq!(plain.poses.unwrap().position(0), Position::new(4.5, -1.5, 0.75));
    let turned = read(Some(Direction::CameraFromWorldRotation)).poses.unwrap();
    assert_eq!(turned.position(0), Position::new(4.5, -1.5, 0.75));
    let x = turned.six_dof().unwrap()[0].rotation * nalgebra::Vector3::x();
    assert!((x - nalgebra::Vector3::new(-0.28, -0.96, 0.0)).norm() < 1e-12, "{x}");
    let moved = read(Some(Direction::CameraFromWorld)).poses.unwrap();
    // −Rᵀ t of t = (4.5, −1.5, 0.75).
    let expected = Position::new(0.28 * 4.5 + 0.96 * 1.5, 0.96 * 4.5 - 0.28 * 1.5, -0.75);
    assert!((moved.position(0) - expected).norm() < 1e-12, "{}", moved.position(0));
}

#[test]
fn quaternions_are_wxyz_by_title_wherever_they_stand() {
    // A quarter turn about z takes x to y.
    for text in [
        "name,x,y,z,qw,qx,qy,qz\na,1,0,0,0.70710678,0,0,0.70710678\n",
        "qx,qy,qz,qw,name,x,y,z\n0,0,0.70710678,0.70710678,a,1,0,0\n",
    ] {
        let moved = parts(text).poses.unwrap().six_dof().unwrap()[0] * Position::new(1.0, 0.0, 0.0);
        assert!((moved - Position::new(1.0, 1.0, 0.0)).norm() < 1e-8, "{moved}");
    }
}

#[test]
fn what_is_there_in_part_is_not_taken_for_absent() {
    for (titles, expected) in [
        ("name,x,y,z,qw,qx,qy", "there is part of a quaternion, but no `qz`"),
        ("name,x,y,z,qx,qy,qz", "there is part of a quaternion, but no `qw`"),
        ("name,x,y,qw,qx,qy,qz", "there is a column `qw`, but none called `z`"),
        ("name,easting", "there is a column `easting`, but none called `northing`"),
        ("name,lat", "there is a column `lat`, but none called `lon`"),
        (
            "name,x,y,easting,northing",
            "there are two positions: `easting`, `northing` and `x`, `y`",
        ),
        ("name,x,y,X", "columns 2 and 4 are both called `X`"),
        ("image,x,y,Image", "columns 1 and 4 are both called `Image`"),
        ("timestamp, device_id, qw, qx, qy, qz, tx, ty, tz", "looks like kapture's"),
        ("# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME", "looks like COLMAP's"),
    ] {
        let reason = reason(&format!("{titles}\n"));
        assert!(reason.starts_with(&format!("line 1: {expected}")), "{titles}: {reason}");
    }
}

#[test]
fn errors_name_line_and_column() {
    for (text, expected) in [
        ("name,x,y,z\na,1,2,3\nb,1,two,3\n", "line 3, column y: `two` is not a finite number"),
        ("name,x,y,z\na,1,2\n", "line 2, column z: 3 values for 4 columns"),
        ("name,x,y,z\na,1,2,3,4\n", "line 2, column after the last: 5 values for 4 columns"),
        ("name,x,y,z\na,1,2,inf\n", "line 2, column z: `inf` is not a finite number"),
        ("name;x;y;z\na;1,5;2;3\n", "line 2, column x: `1,5` is not a finite number"),
        ("name,x,y,z\n,1,2,3\n", "line 2, column name: is empty"),
        (
            "name,x,y,z\na,1,2,3\n\na,1,2,3\n",
            "line 4, column name: `a` appears twice, first on line 2",
        ),
        (
            "name,x,y,z,qw,qx,qy,qz\na,0,0,0,2,0,0,0\n",
            "line 2, column qw: the quaternion has length 2, not 1",
        ),
        (
            "name,lat,lon\na,91,0\n",
            "line 2, column lat: latitude 91, longitude 0 is no place on earth",
        ),
        ("name,x,y,z\n", "line 2: there is no pose"),
        ("# only,a,comment\n# name,x,y\n", "line 3: there is no pose"),
    ] {
        assert_eq!(reason(text), expected);
    }
    assert!(reason("a.jpg,1,2,3\n").starts_with("line 1: the header is `a.jpg,1,2,3`"));
    assert!(reason("").starts_with("line 1: the header is ``"));
    assert!(reason("epoch,loss\n1,0.5\n").starts_with("line 1: the header is `epoch,loss`"));
    assert_eq!(reasons("name,x,y\na,b,c\n").len(), 2, "every problem is listed");
}

#[test]
fn rows_that_are_commented_out_are_counted() {
    let read = parts("name,x,y\na,1,2\n#b,3,4\n# a remark\nc,5,6\n");
    assert_eq!(names(&read), ["a", "c"]);
    assert!(read.notes[0].ends_with("1 look like poses"), "{:?}", read.notes);
}

#[test]
fn without_names_rows_are_taken_in_their_order_and_that_is_said() {
    let read = parts("photo,x,y\na,1,2\n");
    assert_eq!(read.names, None);
    assert!(read.notes[0].ends_with("not used: photo"), "{:?}", read.notes);
    assert!(read.notes[1].contains("no column has names"), "{:?}", read.notes);
}

#[test]
fn metres_come_before_degrees_unless_these_are_asked_for() {
    let text = "name,lat,lon,utm_east,utm_north\na,52.0116,4.3571,593139.5,5763197.8\n";
    let metres = parts(text);
    assert_eq!(metres.poses.unwrap().position(0).x, 593_139.5);
    assert_eq!(metres.about.coordinates, None);
    let degrees = read_with(text, Prefer::Degrees, Reading::default()).unwrap();
    assert!((degrees.poses.unwrap().position(0).x - 593_139.469).abs() < 1e-3);
    assert_eq!(degrees.about.coordinates, Some(Coordinates::Utm("31N".parse().unwrap())));
    let err = read_with("name,x,y\na,1,2\n", Prefer::Degrees, Reading::default()).unwrap_err();
    assert!(err[0].to_string().contains("expected titles such as `name,lat,lon`"), "{}", err[0]);
}

#[test]
fn a_column_of_zones_must_say_one() {
    let zone = |values: &str| {
        let (first, second) = values.split_once(' ').unwrap();
        let text = format!("name,x,y,zone\na,1,2,{first}\nb,1,3,{second}\n");
        let read = read_with(&text, Prefer::Metres, Reading::default());
        read.map(|parts| parts.about.coordinates.map(|it| it.to_string()))
    };
    assert_eq!(zone("18T 18T").unwrap(), Some("utm 18N".to_owned()));
    // S is a band or a hemisphere; both are written.
    assert_eq!(zone("18S 18S").unwrap(), None);
    assert_eq!(zone("18 18").unwrap(), None);
    for wrong in ["18T 19T", "18I 18I", "61N 61N"] {
        assert!(zone(wrong).unwrap_err()[0].to_string().contains("zone"), "{wrong}");
    }
}

#[test]
fn degrees_in_two_zones_need_a_choice() {
    let text = "key,lon,lat\na,-0.0005,51.4779\nb,0.0005,51.4779\n";
    let err = reason(text);
    assert!(err.contains("30N (1, line 2), 31N (1, line 3)") && err.contains("--zone"), "{err}");
    let zone = ZoneChoice::Given("30N".parse().unwrap());
    let read = read_with(text, Prefer::Metres, Reading { zone, ..Reading::default() }).unwrap();
    assert_eq!(read.about.coordinates, Some(Coordinates::Utm("30N".parse().unwrap())));
    let poses = read.poses.unwrap();
    let apart = (poses.position(0) - poses.position(1)).norm();
    // A thousandth of a degree at this latitude is 69.47 m.
    assert!((apart - 69.48).abs() < 0.02, "{apart}");
    assert!(
        read.notes[0].contains("1 of 2 positions") && read.notes[0].contains("line 3"),
        "{:?}",
        read.notes
    );
}

#[test]
fn positions_alone_have_no_direction() {
    let reading = Reading { direction: Some(Direction::CameraFromWorld), ..Reading::default() };
    let err = read_with("name,x,y,z\na,1,2,3\n", Prefer::Metres, reading).unwrap_err();
    assert!(err[0].to_string().contains("needs orientations"), "{}", err[0]);
}

#[test]
fn what_is_no_table_is_told_from_what_is_damaged() {
    let folder = tempfile::tempdir().unwrap();
    let is_table = |bytes: &[u8]| {
        let path = folder.path().join("beside.csv");
        std::fs::write(&path, bytes).unwrap();
        is_table(&path).unwrap()
    };
    assert!(is_table(b"name,x,y\na,one,2\n"));
    assert!(is_table(b"name,x,y,qw\na,one,2\n"));
    assert!(is_table(b"name,x,y\n\xff,1,2\n"));
    assert!(!is_table(b"epoch,loss\n1,0.5\n"));
    assert!(!is_table(b"query,rank,reference,distance\n0,1,a.jpg,0.1\n"));
    assert!(!is_table(b""));
}
