//! One truth in every form, through `sue evaluate` and `sue calibrate`: the same numbers from all.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "../../vpr-data/tests/truth/files.rs"]
mod files;

mod program;

use std::{fs, path::Path};

use ndarray::array;
use program::{assert_refused, success};
use vpr_files::npy;

/// Descriptors without names, and tables of positions with names.
fn world() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let references = array![[1.0_f32, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]];
    npy::write_f32(&at("db.npy"), references.view()).unwrap();
    npy::write_f32(&at("q.npy"), array![[0.8_f32, 0.6], [-0.6, -0.8], [0.6, 0.8]].view()).unwrap();
    let table = |names: &[&str], eastings: &[f64]| {
        let lines = names.iter().zip(eastings).map(|(name, x)| format!("{name},{x},0\n"));
        "name,easting,northing\n".to_owned() + &lines.collect::<String>()
    };
    let queries = table(&files::QUERIES, &files::QUERY_EASTINGS);
    let references = table(&files::REFERENCES, &files::REFERENCE_EASTINGS);
    fs::write(at("q_poses.csv"), &queries).unwrap();
    fs::write(at("db_poses.csv"), &references).unwrap();
    // The same rows with names: tables beside them.
    fs::copy(at("q.npy"), at("named_q.npy")).unwrap();
    fs::copy(at("db.npy"), at("named_db.npy")).unwrap();
    fs::write(at("named_q.csv"), queries).unwrap();
    fs::write(at("named_db.csv"), references).unwrap();
    folder
}

fn sue(folder: &Path, arguments: &[&str]) -> String {
    success(&program::sue(folder, arguments))
}

#[test]
fn every_form_of_the_truth_gives_the_same_numbers() {
    let world = world();
    let folder = world.path();
    let evaluate = ["evaluate", "--estimator", "l2", "--resamples", "50", "--format", "csv"];
    let calibrate = ["calibrate", "--estimator", "l2", "--precision", "0.5"];
    let numbered = ["--map", "db.npy", "--map-poses", "db_poses.csv", "--queries", "q.npy"];
    let named = ["--map", "named_db.npy", "--queries", "named_q.npy"];
    let positions = [&numbered[..], &["--query-poses", "q_poses.csv"]].concat();
    let expected = [evaluate.as_slice(), &calibrate]
        .map(|command| sue(folder, &[command, positions.as_slice()].concat()));
    assert!(expected[0].contains("L2-distance"), "{}", expected[0]);
    let mut n = 0;
    for case in files::write_all(folder).iter().filter(|case| !case.by_folder) {
        let input = if case.by_name { named.as_slice() } else { &numbered };
        let flags: Vec<&str> = case.flags.iter().map(String::as_str).collect();
        for (command, expected) in [evaluate.as_slice(), &calibrate].iter().zip(&expected) {
            let said = sue(folder, &[command, input, &flags].concat());
            assert_eq!(said, *expected, "{}", case.name);
            n += 1;
        }
    }
    assert!(n > 50, "{n}");
}

#[test]
fn scores_give_the_numbers_of_the_descriptors_they_are_of() {
    let world = world();
    let folder = world.path();
    let read = |name: &str| npy::read_f64(&folder.join(name)).unwrap();
    let cosines = read("q.npy").dot(&read("db.npy").t());
    let distances = cosines.mapv(|it| (2.0 - 2.0 * it).max(0.0).sqrt());
    npy::write_f64(&folder.join("cosines.npy"), cosines.view()).unwrap();
    npy::write_f64(&folder.join("distances.npy"), distances.view()).unwrap();
    npy::write_f64(&folder.join("transposed.npy"), distances.t()).unwrap();
    let poses = ["--map-poses", "db_poses.csv", "-k", "3"];
    // Names and digits of single distances aside: to three places.
    let uncertainties = |flags: &[&str]| {
        let csv = sue(folder, &[&["estimate"], flags, poses.as_slice()].concat());
        let lines = csv.lines().skip(1).map(|line| {
            let fields: Vec<&str> = line.split(',').collect();
            let rounded = |at: usize| format!("{:.3}", fields[at].parse::<f64>().unwrap());
            (rounded(2), rounded(3))
        });
        lines.collect::<Vec<_>>()
    };
    let expected = uncertainties(&["--map", "db.npy", "--queries", "q.npy"]);
    assert_eq!(expected.len(), 3);
    for flags in [
        ["--distances", "distances.npy"].as_slice(),
        &["--similarities", "cosines.npy"],
        &["--distances", "transposed.npy", "--scores-transposed"],
    ] {
        assert_eq!(uncertainties(flags), expected, "{flags:?}");
    }
    let large = ["estimate", "--estimator", "l2", "--similarities", "large.txt"];
    fs::write(folder.join("large.txt"), "0.5 1\n7 0\n").unwrap();
    let said = ["large.txt: row 1: column 0 is 7", "--distances"];
    assert_refused(&program::sue(folder, &large), &said);
}
