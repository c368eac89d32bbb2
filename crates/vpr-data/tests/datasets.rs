//! Datasets of the manifest open as they are; broken ones say what is broken.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a test fails by panicking and says what it skips"
)]
#![expect(
    clippy::unwrap_used,
    clippy::print_stderr,
    clippy::float_cmp,
    reason = "a test may, and numbers are read, not computed"
)]

use std::{
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
};

use vpr_data::{
    DataRoots, Dataset, Manifest, Problem, Severity,
    layout::vpr_bench::{GroundTruthFile, PublishedMatches, image_folder, read_areas, read_curves},
    validate,
};
use vpr_files::npy;

/// The data directory of the repository, which has the fixture.
fn own_data() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data")
}

fn own_roots() -> DataRoots {
    DataRoots::new([own_data()])
}

fn open(id: &str) -> Dataset {
    Dataset::open(Manifest::builtin().find(id).unwrap(), &own_roots()).unwrap()
}

/// A writable copy of the fixture's places.
fn places() -> tempfile::TempDir {
    let copy = tempfile::tempdir().unwrap();
    for folder in ["query", "ref", ""] {
        fs::create_dir_all(copy.path().join(folder)).unwrap();
        for entry in fs::read_dir(own_data().join("fixture/places").join(folder)).unwrap() {
            let path = entry.unwrap().path();
            if path.is_file() {
                fs::copy(&path, copy.path().join(folder).join(path.file_name().unwrap())).unwrap();
            }
        }
    }
    copy
}

/// Stands in for a decoder: takes what starts and ends as a JPEG does.
fn probe(path: &Path) -> Result<(u32, u32), String> {
    let bytes = fs::read(path).map_err(|cause| cause.to_string())?;
    if bytes.starts_with(b"\xff\xd8") && bytes.ends_with(b"\xff\xd9") {
        Ok((160, 120))
    } else {
        Err("is not a whole JPEG".to_owned())
    }
}

/// The problems as lines, with paths relative to the folder.
fn lines(folder: &Path, problems: &[Problem]) -> Vec<String> {
    let prefix = format!("{}/", folder.display());
    problems.iter().map(|problem| problem.to_string().replace(&prefix, "")).collect()
}

/// Writes a `ground_truth_new.npy` whose pickle is of protocol 0, from rows in Python's notation.
fn write_truth(path: &Path, rows: &[(i64, &[i64])]) {
    let mut pickle = format!(
        "cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\n(I0\ntS'b'\ntR(I1\n(I{}\nI2\nt\
         cnumpy\ndtype\n(S'O8'\nI0\nI1\ntR(I3\nS'|'\nNNNI-1\nI-1\nI63\ntbI00\n(",
        rows.len()
    );
    for (query, references) in rows {
        write!(pickle, "I{query}\n(").unwrap();
        references.iter().for_each(|index| writeln!(pickle, "I{index}").unwrap());
        pickle.push('l');
    }
    pickle += "ltb.";
    let header =
        format!("{{'descr': '|O', 'fortran_order': False, 'shape': ({}, 2), }}\n", rows.len());
    let len = u16::try_from(header.len()).unwrap().to_le_bytes();
    let bytes = [b"\x93NUMPY\x01\x00", len.as_slice(), header.as_bytes(), pickle.as_bytes()];
    fs::write(path, bytes.concat()).unwrap();
}

#[test]
fn the_fixture_opens() {
    let dataset = open("fixture");
    assert_eq!((dataset.queries.len(), dataset.references.len()), (12, 12));
    assert_eq!((dataset.truth.len(), dataset.n_clamped, dataset.truth.n_known()), (12, 0, 11));
    assert_eq!(dataset.truth.correct(0), [0, 1]);
    assert_eq!(dataset.truth.correct(4), [3, 4, 5]);
    assert!(dataset.truth.is_new_place(7));
    assert!(dataset.queries[10].ends_with("query/0000010.jpg"));
}

#[test]
fn the_fixture_with_positions_opens() {
    let dataset = open("fixture-utm");
    assert_eq!((dataset.queries.len(), dataset.references.len()), (3, 6));
    assert_eq!(dataset.truth.correct(0), [1]);
    assert_eq!(dataset.truth.correct(1), [4]);
    assert!(dataset.truth.is_new_place(2));
    let (queries, references) = dataset.poses.unwrap();
    assert_eq!((queries.len(), references.len()), (3, 6));
    assert_eq!(queries.planar().unwrap()[0].x, 549_634.0);
}

#[test]
fn the_fixture_s_matches_and_curves_are_read() {
    let manifest = Manifest::builtin();
    let matches = manifest.find("fixture").unwrap().published_matches(&own_roots()).unwrap();
    assert_eq!(matches.keys().collect::<Vec<_>>(), ["checkerboard", "coin-toss"]);
    for path in matches.values() {
        let matches = PublishedMatches::read(path).unwrap();
        assert_eq!(matches.query, (0..12).collect::<Vec<_>>());
        assert_eq!(matches.similarities.best().reference, matches.reference);
        assert_eq!(matches.similarities.best().confidence, matches.score);
        assert_eq!((matches.encode_s, matches.match_s), (0.01, 0.0001));
    }
    let folder = own_data().join("fixture/invariance_dict");
    for kind in ["viewpoint_variations", "illumination_variation"] {
        for series in ["varied", "mismatch"] {
            let curves =
                read_curves(&folder.join(format!("{kind}_{series}_scores_dict.pkl"))).unwrap();
            assert_eq!(curves.len(), 2);
            assert!(curves.values().all(|curve| curve.len() == 8));
        }
    }
    let areas = read_areas(&folder.join("viewpoint_variations_ABC_dict.pkl")).unwrap();
    assert_eq!(areas.keys().collect::<Vec<_>>(), ["checkerboard", "coin-toss"]);
    // An area is not a curve.
    let err =
        read_curves(&folder.join("viewpoint_variations_ABC_dict.pkl")).unwrap_err().to_string();
    assert!(
        err.ends_with("`checkerboard`: expected a vector of finite numbers, got a float"),
        "{err}"
    );
}

#[test]
fn a_missing_or_empty_folder_is_named() {
    let copy = places();
    let reference = copy.path().join("ref");
    fs::remove_dir_all(&reference).unwrap();
    assert!(image_folder(&reference).unwrap_err().to_string().ends_with("ref"));
    fs::create_dir(&reference).unwrap();
    assert!(
        image_folder(&reference).unwrap_err().to_string().ends_with("ref: folder: has no image")
    );
    let nowhere = DataRoots::new([copy.path().to_owned()]);
    let manifest = Manifest::builtin();
    let err = Dataset::open(manifest.find("tokyo-247").unwrap(), &nowhere).unwrap_err();
    assert!(err.to_string().ends_with("vpr-bench/datasets/Tokyo247"), "{err}");
    assert!(std::error::Error::source(&err).unwrap().to_string().starts_with("not found in"));
}

#[test]
fn images_are_sorted_by_number_and_misnamed_ones_refused() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["10.jpg", "9.png", "0100.JPEG", ".hidden"] {
        fs::write(folder.path().join(name), "").unwrap();
    }
    let names: Vec<_> = image_folder(folder.path()).unwrap();
    let names: Vec<_> =
        names.iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect();
    assert_eq!(names, ["9.png", "10.jpg", "0100.JPEG"]);
    fs::write(folder.path().join("00010.jpg"), "").unwrap();
    let err = image_folder(folder.path()).unwrap_err().to_string();
    assert!(err.ends_with("has the same number"), "{err}");
    fs::rename(folder.path().join("00010.jpg"), folder.path().join("ten.jpg")).unwrap();
    let err = image_folder(folder.path()).unwrap_err().to_string();
    assert!(err.ends_with("`ten.jpg`: is not named by an integer"), "{err}");
}

#[test]
fn a_ground_truth_past_the_references_is_clamped_and_counted() {
    let copy = places();
    let path = copy.path().join("ground_truth_new.npy");
    write_truth(&path, &[(1, &[2, 12, 13]), (0, &[-1])]);
    let file = GroundTruthFile::read(&path).unwrap();
    assert_eq!(file.lists, [vec![-1], vec![2, 12, 13]]);
    let (truth, n_clamped) = file.truth(12).unwrap();
    assert_eq!((truth.correct(0), truth.correct(1), n_clamped), ([].as_slice(), [2].as_slice(), 2));

    write_truth(&path, &[(0, &[1, -1])]);
    let err = GroundTruthFile::read(&path).unwrap().truth(12).unwrap_err().to_string();
    assert!(err.ends_with("query 0: -1 is not a reference; a new place is [-1]"), "{err}");
    write_truth(&path, &[(0, &[1]), (0, &[2])]);
    let err = GroundTruthFile::read(&path).unwrap_err().to_string();
    assert!(err.ends_with("ground_truth_new.npy: row 1: query 0 has a row already"), "{err}");
    write_truth(&path, &[(0, &[1]), (2, &[2])]);
    let err = GroundTruthFile::read(&path).unwrap_err().to_string();
    assert!(err.ends_with("row 1: query 2: there are only 2 rows"), "{err}");
}

#[test]
fn counts_of_stored_matches_are_held_against_each_other() {
    let path =
        own_data().join("fixture/published_matches/coin-toss/precomputed_data_corrected.npy");
    let bytes = fs::read(path).unwrap();
    // The 12 × 12 scores become 11 × 12 of which one row is missing, or 12 queries become 11.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("matches.npy");
    let shape = bytes.windows(5).position(|it| it == b"K\x0cK\x0c\x86").unwrap();
    let mut lie = bytes.clone();
    lie[shape + 1] = 11;
    fs::write(&path, lie).unwrap();
    let err = PublishedMatches::read(&path).unwrap_err().to_string();
    assert!(err.contains("an array of [11, 12] float64 cannot have 1152 bytes"), "{err}");

    // 9 × 16 has as many bytes, but is not a row per query.
    let mut lie = bytes.clone();
    (lie[shape + 1], lie[shape + 3]) = (9, 16);
    fs::write(&path, lie).unwrap();
    let err = PublishedMatches::read(&path).unwrap_err().to_string();
    assert!(
        err.ends_with("rows of scores (part 3): 9, but there are 12 query indices (part 0)"),
        "{err}"
    );
    assert!(npy::read_objects(&path).is_ok());
    assert!(GroundTruthFile::read(&path).unwrap_err().to_string().contains("got shape [6]"));
}

#[test]
fn a_sound_dataset_has_no_error() {
    let problems = validate(&own_data().join("fixture/places"), &probe);
    assert_eq!(problems.len(), 1, "{problems:?}");
    assert_eq!(problems[0].severity, Severity::Warning);
    assert_eq!(problems[0].reason, "1 queries are new places ([-1])");
    assert_eq!(validate(&own_data().join("fixture/utm"), &probe), []);
}

#[test]
fn everything_wrong_is_reported_at_once() {
    let copy = places();
    let at = |name: &str| copy.path().join(name);
    fs::rename(at("query/0000003.jpg"), at("query/three.jpg")).unwrap();
    fs::copy(at("query/0000005.jpg"), at("query/5.jpg")).unwrap();
    fs::write(at("ref/0000000.jpg"), b"\xff\xd8 truncated").unwrap();
    fs::write(at("ref/notes.txt"), "").unwrap();
    write_truth(&at("ground_truth_new.npy"), &[(0, &[12]), (1, &[2, 1]), (2, &[-5]), (3, &[])]);
    assert_eq!(
        lines(copy.path(), &validate(copy.path(), &probe)),
        [
            "error: query/three.jpg: is not named by an integer",
            "error: query/5.jpg: `query/0000005.jpg` has number 5, too",
            "warning: query: after 2, before 4: numbers are missing in between; indices are positions, not numbers",
            "warning: ref/notes.txt: is no .jpg, .jpeg or .png image, and not looked at",
            "error: ref/0000000.jpg: is not a whole JPEG",
            "error: ground_truth_new.npy: number of rows: 4, but query/ has 12 images",
            "warning: ground_truth_new.npy: query 0: reference 12 does not exist, of 12; dropped",
            "warning: ground_truth_new.npy: query 1: not ascending without repetition: 2 before 1",
            "error: ground_truth_new.npy: query 2: -5 is not a reference; a new place is [-1]",
            "warning: ground_truth_new.npy: query 3: has no reference; a new place is [-1]",
        ]
    );
}

#[test]
fn missing_parts_are_reported_together() {
    let copy = places();
    fs::remove_dir_all(copy.path().join("query")).unwrap();
    fs::remove_dir_all(copy.path().join("ref")).unwrap();
    fs::create_dir(copy.path().join("ref")).unwrap();
    fs::write(copy.path().join("ground_truth_new.npy"), "cos\nsystem\n").unwrap();
    let lines = lines(copy.path(), &validate(copy.path(), &probe));
    assert_eq!(lines.len(), 3, "{lines:?}");
    assert!(lines[0].starts_with("error: query: "), "{lines:?}");
    assert_eq!(lines[1], "error: ref: is empty");
    assert_eq!(lines[2], "error: ground_truth_new.npy: byte 0: does not start with `\\x93NUMPY`");
    let nothing = validate(&copy.path().join("nowhere"), &probe);
    assert_eq!(nothing[0].reason, "is not a folder");
}

#[test]
fn misnamed_positions_are_all_reported() {
    let folder = tempfile::tempdir().unwrap();
    for name in
        ["queries/@1@2@.jpg", "queries/x.jpg", "database/a@b/@x@1@.jpg", "database/@1@2@.jpg"]
    {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, b"\xff\xd8\xff\xd9").unwrap();
    }
    assert_eq!(
        lines(folder.path(), &validate(folder.path(), &probe)),
        [
            "error: queries/x.jpg: file name: `x.jpg` does not have the form @utm_east@utm_north@…",
            "error: database/a@b/@x@1@.jpg: file name: easting `x` of `@x@1@.jpg` is not a finite number",
        ]
    );
}

#[test]
fn the_real_datasets_open() {
    let Some(data) = std::env::var_os("VPR_DATA") else {
        return eprintln!("skipped: VPR_DATA is not set");
    };
    let roots = DataRoots::new([PathBuf::from(data), own_data()]);
    let manifest = Manifest::builtin();
    let open = |id: &str| Dataset::open(manifest.find(id).unwrap(), &roots);
    for id in ["corridor", "gardens-point-thumbs", "essex3in1-thumbs"] {
        let (dataset, entry) = (open(id).unwrap(), manifest.find(id).unwrap());
        assert_eq!(Some(dataset.queries.len()), entry.queries, "{id}");
        assert_eq!(Some(dataset.references.len()), entry.references, "{id}");
        assert_eq!((dataset.truth.n_known(), dataset.n_clamped), (dataset.truth.len(), 0), "{id}");
    }
    let err = open("spedtest").unwrap_err().to_string();
    assert!(err.ends_with("SPEDTEST/query"), "{err}");

    // Every ground truth is there, has as many queries as table 3.1, and only two point too far.
    for entry in manifest.datasets[..12].iter().chain(manifest.find("gardens-point-tn")) {
        let file = entry.ground_truth(&roots).unwrap();
        assert_eq!(Some(file.len()), entry.queries, "{}", entry.id);
        let (truth, n_clamped) = file.truth(entry.references.unwrap()).unwrap();
        let expected =
            if matches!(entry.id.as_str(), "gardens-point" | "17-places") { 3 } else { 0 };
        assert_eq!(n_clamped, expected, "{}", entry.id);
        let n_new = if entry.id == "gardens-point-tn" { 200 } else { 0 };
        assert_eq!(truth.len() - truth.n_known(), n_new, "{}", entry.id);
    }
    for id in ["corridor", "spedtest"] {
        assert_eq!(manifest.find(id).unwrap().published_matches(&roots).unwrap().len(), 10, "{id}");
    }
}
