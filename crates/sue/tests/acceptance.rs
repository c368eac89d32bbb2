//! From descriptors as people have them to accepted matches: lengths, ties, thresholds that one
//! command writes and the next reads, and sets of any size.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod program;

use std::{fs, path::PathBuf, process::Output};

use ndarray::{Array2, array};
use program::{assert_refused, stderr, success, sue};
use serde_json::Value;
use tempfile::TempDir;
use vpr_core::{
    Descriptors, Map, PlanarPosition, Poses,
    knn::Metric,
    map::{self, About},
};
use vpr_files::npy;

/// Places along a road, 5 m apart, and queries in front of them.
struct Road {
    folder: TempDir,
}

/// Rows that look alike where places are near; `shift` moves along the road.
fn rows(n: usize, shift: f32) -> Array2<f32> {
    Array2::from_shape_fn((n, 6), |(row, column)| {
        ((row as f32 + shift) * 0.15 * (1 + column) as f32 + column as f32).sin()
    })
}

impl Road {
    fn new(n: usize) -> Self {
        let road = Self { folder: tempfile::tempdir().unwrap() };
        road.write("map.npy", &Descriptors::new(rows(n, 0.0)).unwrap().normalized());
        road.write("queries.npy", &Descriptors::new(rows(n, 0.3)).unwrap().normalized());
        let lines: Vec<String> = (0..n).map(|i| format!("{i},{},0\n", 5 * i)).collect();
        fs::write(road.path("poses.csv"), "name,easting,northing\n".to_owned() + &lines.concat())
            .unwrap();
        road
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, descriptors: &Descriptors) {
        npy::write_f32(&self.path(name), descriptors.view()).unwrap();
    }

    /// The same directions, seven to nine times as long.
    fn lengthen(&self) {
        for (file, long) in [("map.npy", "long-map.npy"), ("queries.npy", "long-queries.npy")] {
            let mut values = npy::read_f32(&self.path(file)).unwrap();
            for (row, mut of) in values.outer_iter_mut().enumerate() {
                of *= 7.0 + (row % 3) as f32;
            }
            npy::write_f32(&self.path(long), values.view()).unwrap();
        }
    }

    fn sue(&self, arguments: &str) -> Output {
        sue(self.folder.path(), &arguments.split_whitespace().collect::<Vec<_>>())
    }

    /// `command` on `map` and `queries` with their poses, then these arguments.
    fn on(&self, command: &str, map: &str, queries: &str, more: &str) -> Output {
        let truth = if command == "estimate" { "" } else { "--query-poses poses.csv" };
        self.sue(&format!(
            "{command} --map {map} --map-poses poses.csv --queries {queries} {truth} -k 3 {more}"
        ))
    }
}

/// A column of CSV as numbers.
fn column(csv: &str, name: &str) -> Vec<f64> {
    let mut lines = csv.lines();
    let place = lines.next().unwrap().split(',').position(|it| it == name).unwrap();
    lines.map(|line| line.split(',').nth(place).unwrap().parse().unwrap()).collect()
}

#[test]
fn descriptors_of_any_length_are_prepared_as_the_studies_do() {
    let road = Road::new(40);
    road.lengthen();
    let unit = success(&road.on("estimate", "map.npy", "queries.npy", ""));
    let long = road.on("estimate", "long-map.npy", "long-queries.npy", "");
    let warning = stderr(&long);
    for part in ["long-map.npy: descriptors are 7.000 to 9.000 long", "long-queries.npy", "scaled"]
    {
        assert!(warning.contains(part), "`{part}` is not in: {warning}");
    }
    let long = success(&long);
    for name in ["distance", "uncertainty"] {
        let (unit, long) = (column(&unit, name), column(&long, name));
        assert_eq!(unit.len(), 40);
        for (unit, long) in unit.iter().zip(&long) {
            assert!((unit - long).abs() < 1e-4 * (1.0 + unit), "{name}: {unit} {long}");
        }
    }
    let asked = road.on("estimate", "long-map.npy", "long-queries.npy", "--normalize");
    assert!(!stderr(&asked).contains("long, not 1"), "{}", stderr(&asked));
    assert_eq!(success(&asked), long);
    for command in ["evaluate", "calibrate"] {
        let [unit, long] = [("map.npy", "queries.npy"), ("long-map.npy", "long-queries.npy")]
            .map(|(map, queries)| road.on(command, map, queries, "--estimator pa"));
        assert!(!stderr(&unit).contains("warning"), "{}", stderr(&unit));
        let warning = stderr(&long);
        assert!(warning.contains("7.000 to 9.000"), "{warning}");
        assert!(warning.contains("they are taken as they are"), "{warning}");
        success(&long);
    }
}

#[test]
fn descriptors_that_stay_long_are_warned_of() {
    let road = Road::new(40);
    road.lengthen();
    let output =
        road.on("estimate", "long-map.npy", "long-queries.npy", "--no-normalize --threshold 0.5");
    let warnings = stderr(&output);
    assert!(warnings.contains("7.000 to 9.000 long, not 1: lambda, and thresholds"), "{warnings}");
    assert!(warnings.contains("weighs a thousand times as much"), "{warnings}");
    let distances = column(&success(&output), "distance");
    assert!(distances.iter().all(|&it| it > 0.1), "{distances:?}");
    let quiet = road.on("estimate", "map.npy", "queries.npy", "--lambda 1");
    assert_eq!(stderr(&quiet), "");
    let both = road.on("estimate", "map.npy", "queries.npy", "--normalize --no-normalize");
    assert_eq!(both.status.code(), Some(2));
}

#[test]
fn the_metric_of_a_map_decides_what_may_be_scaled() {
    let road = Road::new(40);
    road.lengthen();
    let write = |name: &str, metric| {
        let rows = Descriptors::new(npy::read_f32(&road.path("long-map.npy")).unwrap()).unwrap();
        let places = (0..40).map(|i| PlanarPosition::new(5.0 * f64::from(i), 0.0)).collect();
        let map = Map::new(rows, Poses::Planar(places)).unwrap();
        let about = About { metric: Some(metric), ..About::default() };
        map::write(&road.path(name), &map, None, about).unwrap();
    };
    write("cosine.safetensors", Metric::Cosine);
    write("product.safetensors", Metric::InnerProduct);
    let cosine = road.on("estimate", "cosine.safetensors", "long-queries.npy", "--lambda 1");
    assert_eq!(stderr(&cosine), "", "a map for cosines says nothing of lengths");
    let scaled = road.on("estimate", "long-map.npy", "long-queries.npy", "--normalize --lambda 1");
    assert_eq!(success(&cosine), success(&scaled));
    assert_refused(
        &road.on("estimate", "product.safetensors", "long-queries.npy", ""),
        &["inner-product", "--normalize"],
    );
    success(&road.on("estimate", "product.safetensors", "long-queries.npy", "--normalize"));
}

#[test]
fn right_matches_of_equal_uncertainty_are_accepted() {
    // Every query is its reference: all distances are 0, all matches right.
    let road = Road::new(200);
    let words = success(&road.on("calibrate", "map.npy", "map.npy", "--estimator l2"));
    assert!(words.starts_with("Accept every match"), "{words}");
    assert!(words.contains("200 of 200 were accepted, 200 of them correct"), "{words}");
    assert!(
        words.contains("Of all calibration sets at most a share of 0.1 breaks this"),
        "{words}"
    );
}

#[test]
fn what_calibrate_writes_estimate_reads() {
    let road = Road::new(200);
    // Half of the queries are where the map says, the others look away from everything.
    let mut values = npy::read_f32(&road.path("map.npy")).unwrap();
    for mut row in values.outer_iter_mut().skip(1).step_by(2) {
        row.mapv_inplace(|it| -it);
    }
    npy::write_f32(&road.path("mixed.npy"), values.view()).unwrap();
    let save = |name: &str, queries: &str, more: &str| {
        let more = format!("--json {more}");
        let json = success(&road.on("calibrate", "map.npy", queries, &more));
        fs::write(road.path(name), &json).unwrap();
        serde_json::from_str::<Value>(&json).unwrap()
    };
    let accepted = |threshold: &str, more: &str| {
        let more = format!("--threshold {threshold} {more}");
        let csv = success(&road.on("estimate", "map.npy", "mixed.npy", &more));
        csv.lines().filter(|line| line.ends_with(",true")).count()
    };
    let everything = save("everything.json", "map.npy", "--estimator l2");
    assert_eq!(everything["threshold"], "everything");
    for given in ["everything.json", "@everything.json", "everything", "inf"] {
        assert_eq!(accepted(given, "--estimator l2"), 200, "{given}");
    }
    let nothing = save("nothing.json", "map.npy", "--estimator l2 --precision 0.999");
    assert_eq!(nothing["threshold"], "nothing");
    assert_eq!(accepted("nothing.json", "--estimator l2"), 0);
    assert_eq!(accepted("nothing", "--estimator l2"), 0);

    let number = save("number.json", "mixed.npy", "--estimator l2");
    assert!(number["threshold"].as_f64().is_some_and(|it| it > 0.0), "{number}");
    // The right half, and the few of the others that the precision leaves room for.
    let n_accepted = number["n_accepted"].as_u64().unwrap();
    assert!((100..=105).contains(&n_accepted), "{number}");
    assert_eq!(accepted("number.json", "--estimator l2") as u64, n_accepted);
    fs::write(road.path("own.json"), r#"{"threshold": 1e-9}"#).unwrap();
    assert_eq!(accepted("own.json", "--estimator l2"), 100);
    assert_eq!(accepted("1e-9", "--estimator l2"), 100);
    save("lambda.json", "map.npy", "--lambda 5");

    let refused = |arguments: &str, parts: &[&str]| {
        assert_refused(&road.on("estimate", "map.npy", "queries.npy", arguments), parts);
    };
    refused("--threshold everything.json", &["calibrated for `l2`", "--estimator l2"]);
    refused("--threshold lambda.json", &["lambda was 5.0, is 350.0"]);
    // Scaled or of length 1 already is the same; other lengths are not.
    road.lengthen();
    let estimate = |more: &str| {
        let more = format!("--estimator l2 --threshold everything.json {more}");
        road.on("estimate", "long-map.npy", "long-queries.npy", &more)
    };
    success(&estimate("--normalize"));
    let text = stderr(&estimate("--no-normalize"));
    assert!(
        text.contains("error: everything.json: calibrated with descriptors of length 1"),
        "{text}"
    );
    fs::write(road.path("typo.json"), r#"{"threshold": 1, "estimator": "l3"}"#).unwrap();
    refused("--threshold typo.json --estimator l2", &["typo.json", "`l3`"]);
    refused("--threshold all", &["all", "`everything`"]);
    refused("--threshold poses.csv", &["poses.csv", "calibrate --json"]);
    npy::write_f32(&road.path("v.npy"), Array2::from_elem((200, 1), 0.5).view()).unwrap();
    refused("--variances v.npy --threshold lambda.json", &["not for variances"]);
}

#[test]
fn uncertainties_print_in_few_digits() {
    let road = Road::new(40);
    road.lengthen();
    let output = road.on("estimate", "long-map.npy", "long-queries.npy", "--no-normalize");
    let csv = success(&output);
    assert!(column(&csv, "uncertainty").iter().any(|&it| it > 0.0 && it < 1e-30), "{csv}");
    for line in csv.lines() {
        assert!(line.len() < 80, "{line}");
    }
}

#[test]
fn nothing_is_printed_before_an_error() {
    let road = Road::new(5);
    // Only when the first batch is searched is it known that there are too few references.
    for format in ["csv", "json"] {
        let output = road.sue(&format!(
            "estimate --map map.npy --map-poses poses.csv --queries queries.npy -k 6 --format {format}"
        ));
        assert_refused(&output, &["needs 6 neighbours"]);
    }
}

#[test]
fn sets_of_any_size_are_evaluated_and_calibrated() {
    let road = Road::new(20);
    let [one, far] = [("one", "3,15,0\n"), ("far", "3,9000,0\n")];
    for (name, line) in [one, far] {
        fs::write(road.path(&format!("{name}.csv")), "name,easting,northing\n".to_owned() + line)
            .unwrap();
    }
    let query = npy::read_f32(&road.path("queries.npy")).unwrap();
    npy::write_f32(&road.path("q.npy"), query.slice(ndarray::s![3..4, ..])).unwrap();
    let run = |command: &str, poses: &str, more: &str| {
        road.sue(&format!(
            "{command} --map map.npy --map-poses poses.csv --queries q.npy --query-poses {poses} -k 3 {more}"
        ))
    };
    // One right match: an area of 1 of which nothing is known.
    let json = success(&run("evaluate", "one.csv", "--format json --resamples 50"));
    let table: Value = serde_json::from_str(&json).unwrap();
    let cell = |column: &str| {
        let cells = table["cells"].as_array().unwrap();
        cells.iter().find(|it| it["column"] == column).unwrap().clone()
    };
    let area = cell("AUC-PR, published");
    assert_eq!(area["value"], 1.0);
    assert_eq!(area["interval"]["method"], "Wilson, effective queries");
    assert!(area["interval"]["low"].as_f64().unwrap() < 0.2, "{area}");
    assert_eq!(area["interval"]["high"], 1.0);
    assert_eq!(cell("AUC-PR minus first")["interval"]["method"], "paired bootstrap over queries");
    // One wrong match: no area, and why.
    let text = success(&run("evaluate", "far.csv", "--format csv --resamples 50"));
    assert!(text.contains("AUC-PR, published") && text.contains("undefined"), "{text}");
    for poses in ["one.csv", "far.csv"] {
        let words = success(&run("calibrate", poses, ""));
        assert!(words.contains("from these 1 calibration queries"), "{words}");
    }
    assert_refused(
        &run("calibrate", "one.csv", "--false-acceptance 0.1"),
        &["no calibration match is wrong"],
    );
    npy::write_f32(&road.path("q.npy"), array![[0.0, 1.0, f32::NAN, 0.0, 0.0, 0.0]].view())
        .unwrap();
    for command in ["evaluate", "calibrate"] {
        assert_refused(&run(command, "one.csv", ""), &["row 0, column 2"]);
    }
}
