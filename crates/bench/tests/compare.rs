//! `bench compare`: several methods on one dataset, from files and from images.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

use ndarray::Array2;
use serde_json::Value;
use vpr_files::npy;

/// A generated corridor of eight places, small enough for a test.
const WORLD: &str = "world/corridor?places=8&camera.width=80&camera.height=60&camera.focal=55.0";
/// How many queries the matrices have; the correct reference has the index of its query.
const N: usize = 60;

fn bench(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bench"));
    command.env("VPR_CACHE", Path::new(env!("CARGO_TARGET_TMPDIR")).join("bench-cli"));
    command.current_dir(folder).args(arguments).env_remove("VPR_DATA").output().unwrap()
}

fn success(output: &Output) -> String {
    let stderr = String::from_utf8(output.stderr.clone()).unwrap();
    assert_eq!(output.status.code(), Some(0), "{stderr}");
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn assert_refused(output: &Output, parts: &[&str]) {
    let text = String::from_utf8(output.stderr.clone()).unwrap();
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert_eq!(text.lines().count(), 1, "{text}");
    for part in parts {
        assert!(text.contains(part), "`{part}` is not in: {text}");
    }
}

/// Matrices of similarities: `good` errs on every twelfth query, `poor` on every second.
fn matrices() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, every) in [("good.npy", 12), ("poor.npy", 2)] {
        let scores = Array2::from_shape_fn((N, N), |(query, reference)| {
            let found = if query % every == 0 { (query + 1) % N } else { query };
            f64::from(u8::from(reference == found))
        });
        npy::write_f64(&folder.path().join(name), scores.view()).unwrap();
    }
    folder
}

#[test]
fn a_difference_is_tested_counted_and_planned() {
    let folder = matrices();
    let flags =
        ["compare", "A=good.npy", "B=poor.npy", "--same-index", "0", "--recall-values", "1"];
    let text = success(&bench(folder.path(), &flags));
    assert!(text.starts_with("A: R@1: 91.7, AUC-PR:"), "{text}");
    // 25 queries that only A gets right, none that only B does: mid-p is 2⁻²⁵.
    assert!(
        text.contains("A − B, R@1: +41.7 (25 wins, 0 losses), p < 0.001, corrected < 0.001"),
        "{text}"
    );
    assert!(text.contains("R@1: A is best and differs from all others"), "{text}");

    let json = success(&bench(folder.path(), &[&flags[..], &["--format", "json"]].concat()));
    let table: Value = serde_json::from_str(&json).unwrap();
    let cells = table["cells"].as_array().unwrap();
    let value = |row: &str, column: &str| {
        let cell = cells.iter().find(|it| it["row"] == row && it["column"] == column).unwrap();
        cell["value"].as_f64().unwrap()
    };
    let row = "A − B, R@1";
    assert!((value(row, "p") - 0.5_f64.powi(25)).abs() < 1e-12);
    assert_eq!((value(row, "wins"), value(row, "losses")), (25.0, 0.0));
    assert!((value(row, "difference") - 25.0 / 60.0).abs() < 1e-12);
    assert!(value(row, "power") > 0.99 && value(row, "queries for power 0.8") < 60.0);

    let exact = success(&bench(
        folder.path(),
        &[&flags[..], &["--test", "exact", "--format", "csv"]].concat(),
    ));
    assert!(exact.contains("McNemar, exact"), "{exact}");
}

#[test]
fn who_is_right_on_which_query_is_written() {
    let folder = matrices();
    let flags =
        ["compare", "good.npy", "poor.npy", "--same-index", "0", "--per-query", "queries.csv"];
    success(&bench(folder.path(), &flags));
    let text = fs::read_to_string(folder.path().join("queries.csv")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), N + 1);
    assert_eq!(
        lines[0],
        "query,known,good.npy right,good.npy reference,poor.npy right,poor.npy reference"
    );
    assert_eq!(lines[3], "2,1,1,2,0,3");
}

#[test]
fn techniques_and_files_stand_side_by_side_in_tables_and_reports() {
    let folder = matrices();
    let scores = Array2::<f64>::eye(8);
    npy::write_f64(&folder.path().join("mine.npy"), scores.view()).unwrap();
    let flags =
        ["compare", "hog", "cohog", "mine=mine.npy", "--dataset", WORLD, "--format", "table"];
    let text = success(&bench(folder.path(), &[&flags[..], &["--report", "report.html"]].concat()));
    for part in ["hog − cohog, R@1", "cohog − mine, AUC-PR", "p corrected", "is best"] {
        assert!(text.contains(part), "`{part}` is not in: {text}");
    }
    let html = fs::read_to_string(folder.path().join("report.html")).unwrap();
    assert!(html.contains("hog, cohog, mine on world/corridor"));
    // What `bench evaluate` says of one of them.
    let alone =
        success(&bench(folder.path(), &["evaluate", "--dataset", WORLD, "--recall-values", "1"]));
    let lines = success(&bench(folder.path(), &[&flags[..6], &["--recall-values", "1"]].concat()));
    assert!(lines.starts_with(&format!("hog: {},", alone.trim_end())), "{lines}{alone}");
}

#[test]
fn the_same_comparison_gives_the_same_bytes_for_any_number_of_threads() {
    let folder = matrices();
    let flags = [
        "compare",
        "good.npy",
        "poor.npy",
        "--same-index",
        "0",
        "--format",
        "csv",
        "--num-workers",
    ];
    let with = |threads| success(&bench(folder.path(), &[&flags[..], &[threads]].concat()));
    assert_eq!(with("1"), with("3"));
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let folder = matrices();
    let compare = |flags: &[&str]| bench(folder.path(), &[&["compare"], flags].concat());
    let same = ["--same-index", "0"];
    let run = |methods: &[&str]| compare(&[methods, &same].concat());
    assert_refused(&run(&["good.npy", "good.npy"]), &["two methods are called `good.npy`"]);
    assert_refused(&run(&["good.npy", "hog"]), &["`hog` is no file", "--dataset"]);
    npy::write_f64(&folder.path().join("few.npy"), Array2::<f64>::eye(5).view()).unwrap();
    assert_refused(&run(&["good.npy", "few.npy"]), &["few.npy", "5 queries", "60"]);
    assert_refused(&run(&["good.npy", "poor.npy", "--level", "5"]), &["level", "between 0 and 1"]);
    assert_refused(&run(&["good.npy", "poor.npy", "--recall-values", "0"]), &["recall-values"]);
    assert_refused(&compare(&["good.npy", "poor.npy"]), &["no positions"]);
}
