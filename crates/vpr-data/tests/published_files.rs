//! The readers against what NumPy reads in the files VPR-Bench published (`VPR_DATA`).

#![expect(clippy::unwrap_used, clippy::print_stderr, reason = "a test may")]

use std::path::{Path, PathBuf};

use vpr_data::layout::vpr_bench::{GroundTruthFile, PublishedMatches, read_areas, read_curves};

/// One row of `golden/published_files.csv`.
#[derive(Debug, serde::Deserialize)]
struct Expected {
    file: String,
    n_queries: usize,
    n_columns: Option<usize>,
    n_listed: Option<usize>,
    sum: f64,
    encode_s: Option<f64>,
    match_s: Option<f64>,
}

/// The rows whose file has this name, with the file; none, and why, without data.
fn expected(name: &str) -> Vec<(PathBuf, Expected)> {
    let Some(data) = std::env::var_os("VPR_DATA") else {
        eprintln!("skipped: VPR_DATA is not set");
        return Vec::new();
    };
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/published_files.csv");
    let rows = csv::Reader::from_path(golden).unwrap().into_deserialize();
    let rows: Vec<Expected> = rows.collect::<Result<_, _>>().unwrap();
    let named = rows.into_iter().filter(|row| row.file.ends_with(name));
    let found: Vec<_> = named.map(|row| (Path::new(&data).join(&row.file), row)).collect();
    assert!(!found.is_empty(), "no row for {name}");
    found
}

/// Sums of the same numbers in another order agree to rounding.
fn assert_same_sum(actual: f64, expected: &Expected, magnitude: f64) {
    assert!((actual - expected.sum).abs() <= 1e-13 * magnitude, "{actual} of {expected:?}");
}

#[test]
#[expect(clippy::float_cmp, reason = "times are read, not computed")]
fn stored_matches_are_what_numpy_reads() {
    for (path, row) in expected("precomputed_data_corrected.npy") {
        let matches = PublishedMatches::read(&path).unwrap();
        let scores = matches.similarities.view();
        assert_eq!(matches.query, (0..row.n_queries).collect::<Vec<_>>(), "{row:?}");
        assert_eq!(Some(scores.ncols()), row.n_columns, "{row:?}");
        assert_eq!(Some(matches.reference.iter().sum()), row.n_listed, "{row:?}");
        assert_eq!(Some(matches.encode_s), row.encode_s);
        assert_eq!(Some(matches.match_s), row.match_s);
        // CALC, CoHOG and NetVLAD are float32 in part; the golden sum widens them first, too.
        assert_same_sum(scores.sum(), &row, scores.mapv(f64::abs).sum());
        for (query, (&reference, &score)) in
            matches.reference.iter().zip(&matches.score).enumerate()
        {
            assert_eq!(scores[[query, reference]], score, "query {query} of {row:?}");
        }
    }
}

#[test]
fn ground_truths_are_what_numpy_reads() {
    for (path, row) in expected("ground_truth_new.npy") {
        let truth = GroundTruthFile::read(&path).unwrap();
        assert_eq!(truth.len(), row.n_queries, "{row:?}");
        assert_eq!(Some(truth.lists.iter().map(Vec::len).sum()), row.n_listed, "{row:?}");
        assert_same_sum(truth.lists.iter().flatten().sum::<i64>() as f64, &row, row.sum.abs());
    }
}

#[test]
fn gardens_point_and_17_places_point_past_their_references() {
    let n_clamped = |dataset: &str, n_references| {
        let rows = expected(&format!("{dataset}/ground_truth_new.npy"));
        rows.first().map(|(path, _)| {
            let (truth, n_clamped) =
                GroundTruthFile::read(path).unwrap().truth(n_references).unwrap();
            (truth.n_known(), n_clamped)
        })
    };
    if std::env::var_os("VPR_DATA").is_some() {
        assert_eq!(n_clamped("GardensPointWalking", 200), Some((200, 3)));
        assert_eq!(n_clamped("17places", 406), Some((406, 3)));
        assert_eq!(n_clamped("GardensPoint_TN", 200), Some((200, 0)));
        assert_eq!(n_clamped("corridor", 111), Some((111, 0)));
    }
}

#[test]
fn invariance_dictionaries_are_what_numpy_reads() {
    for (path, row) in expected("scores_dict.pkl") {
        let curves = read_curves(&path).unwrap();
        assert_eq!(curves.len(), row.n_queries, "{row:?}");
        assert!(curves.values().all(|curve| Some(curve.len()) == row.n_columns), "{row:?}");
        let values = curves.values().flatten();
        assert_same_sum(values.clone().sum(), &row, values.map(|score| score.abs()).sum());
    }
    for (path, row) in expected("ABC_dict.pkl") {
        let areas = read_areas(&path).unwrap();
        assert_eq!(areas.len(), row.n_queries, "{row:?}");
        assert_same_sum(areas.values().sum(), &row, row.sum);
    }
}
