//! One truth in every form, through `bench evaluate` and `bench validate`: the same numbers from all.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "../../vpr-data/tests/truth/files.rs"]
mod files;

use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

use ndarray::Array2;
use serde_json::Value;
use vpr_files::npy;

/// How far every query is from every reference: the best of query 0 and 2 is 1, that of 1 is 3.
const DISTANCES: [[f64; 4]; 3] = [[2.0, 1.0, 3.0, 4.0], [9.0, 8.0, 2.0, 1.0], [1.5, 0.5, 4.0, 3.0]];
const LINE: &str = "R@1: 33.3, R@2: 66.7\n";

fn bench(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bench"));
    command.current_dir(folder).args(arguments).env_remove("VPR_DATA").output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

fn success(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    text(&output.stdout)
}

/// Asserts exit code 2 and a one-line error that contains all of these.
fn assert_refused(output: &Output, parts: &[&str]) {
    let text = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert_eq!(text.lines().count(), 1, "{text}");
    for part in parts {
        assert!(text.contains(part), "`{part}` is not in: {text}");
    }
}

/// Descriptors whose distances rank as [`DISTANCES`] do, tables of positions, matrices
/// of scores, and small images in folders of places.
fn world() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let distances = Array2::from_shape_fn((3, 4), |(row, column)| DISTANCES[row][column]);
    // References are unit vectors: the nearest is the one whose axis the query is longest along.
    npy::write_f64(&at("q.npy"), distances.mapv(|it| 10.0 - it).view()).unwrap();
    npy::write_f32(&at("db.npy"), Array2::eye(4).view()).unwrap();
    npy::write_f64(&at("distances.npy"), distances.view()).unwrap();
    npy::write_f64(&at("similarities.npy"), distances.mapv(|it| -it).view()).unwrap();
    npy::write_f64(&at("scores_t.npy"), distances.mapv(|it| -it).t()).unwrap();
    let lines = distances.outer_iter().map(|row| {
        let numbers: Vec<String> = row.iter().map(f64::to_string).collect();
        numbers.join(" ") + "\n"
    });
    fs::write(at("distances.txt"), lines.collect::<String>()).unwrap();
    let table = |names: &[&str], eastings: &[f64]| {
        let lines = names.iter().zip(eastings).map(|(name, x)| format!("{name},{x},0\n"));
        "name,easting,northing\n".to_owned() + &lines.collect::<String>()
    };
    fs::write(at("q_poses.csv"), table(&files::QUERIES, &files::QUERY_EASTINGS)).unwrap();
    fs::write(at("db_poses.csv"), table(&files::REFERENCES, &files::REFERENCE_EASTINGS)).unwrap();
    for (index, name) in files::QUERIES.iter().chain(&files::REFERENCES).enumerate() {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        let grey =
            |x: usize, y: usize| u8::try_from((x * (index + 3) + y * index * 7) % 256).unwrap();
        let pixels = (0..32 * 32).flat_map(|at| [grey(at % 32, at / 32); 3]).collect();
        let size = vpr_vision::image::ImageSize { width: 32, height: 32 };
        // The content tells a PNG from a JPEG, not the name.
        let image = vpr_vision::image::from_pixels(size, pixels);
        vpr_vision::image::write_png(&image, &path).unwrap();
    }
    folder
}

fn evaluate(folder: &Path, flags: &[&str], more: &[String]) -> Output {
    let start = ["evaluate", "--recall-values", "1", "2"];
    let more = more.iter().map(String::as_str);
    let arguments: Vec<&str> = start.into_iter().chain(flags.iter().copied()).chain(more).collect();
    bench(folder, &arguments)
}

#[test]
fn every_form_of_the_truth_gives_the_same_line() {
    let world = world();
    let folder = world.path();
    let scores = ["--distances", "distances.npy"];
    let named =
        [&scores[..], &["--database-poses", "db_poses.csv", "--queries-poses", "q_poses.csv"]]
            .concat();
    let images = ["--database-folder", "database", "--queries-folder", "queries"];
    assert_eq!(success(&evaluate(folder, &named, &[])), LINE, "by distance of positions");
    let mut of_images = None;
    for case in files::write_all(folder) {
        let name = case.name;
        if !case.by_folder {
            let flags = if case.by_name { named.as_slice() } else { &scores };
            assert_eq!(success(&evaluate(folder, flags, &case.flags)), LINE, "{name}");
        }
        // The images of folders are in the order of their paths, which is not that of the truth.
        if case.by_name || case.by_folder {
            let line = success(&evaluate(folder, &images, &case.flags));
            assert_eq!(*of_images.get_or_insert(line.clone()), line, "{name}");
        }
        let validated = bench(
            folder,
            &[&["validate", "."], &case.flags.iter().map(String::as_str).collect::<Vec<_>>()[..]]
                .concat(),
        );
        let said = text(&validated.stdout);
        assert_eq!(validated.status.code(), Some(0), "{name}: {said}");
        assert!(said.contains("1 queries have no correct reference"), "{name}: {said}");
    }
}

#[test]
fn scores_and_descriptors_rank_alike() {
    let world = world();
    let truth = ["--ground-truth".to_owned(), "pairs.csv".to_owned()];
    files::write_all(world.path());
    for flags in [
        ["--distances", "distances.npy"].as_slice(),
        &["--distances", "distances.txt"],
        &["--similarities", "similarities.npy"],
        &["--similarities", "scores_t.npy", "--scores-transposed"],
        &["--database-descriptors", "db.npy", "--queries-descriptors", "q.npy"],
    ] {
        let line = success(&evaluate(world.path(), flags, &truth));
        assert_eq!(line, LINE, "{flags:?}");
    }
    let truth = ["--ground-truth".to_owned(), "padded.npy".to_owned()];
    let output = evaluate(world.path(), &["--similarities", "scores_t.npy"], &truth);
    assert_refused(&output, &["padded.npy", "--scores-transposed"]);
}

#[test]
fn indices_are_a_truth_of_aligned_traverses() {
    let world = world();
    let same = |n: &str| ["--same-index".to_owned(), n.to_owned()];
    let scores = ["--distances", "distances.npy"];
    assert_eq!(success(&evaluate(world.path(), &scores, &same("0"))), "R@1: 0.0, R@2: 33.3\n");
    assert_eq!(success(&evaluate(world.path(), &scores, &same("1"))), "R@1: 66.7, R@2: 100.0\n");
}

#[test]
fn truths_that_do_not_fit_are_refused_before_the_work() {
    let world = world();
    let folder = world.path();
    files::write_all(folder);
    let flags = ["--distances", "distances.npy", "--num-preds-to-save", "1"];
    let with = |truth: &[&str]| {
        let truth: Vec<String> = truth.iter().map(|&it| it.to_owned()).collect();
        evaluate(folder, &flags, &truth)
    };
    fs::write(folder.join("short.txt"), "0 1\n2\n").unwrap();
    assert_refused(
        &with(&["--ground-truth", "short.txt"]),
        &["short.txt", "2, but there are 3 queries"],
    );
    assert_refused(
        &with(&["--ground-truth", "GT.npz"]),
        &["GT.npz", "GThard, GTsoft", "--truth-key"],
    );
    assert_refused(&with(&["--ground-truth", "named.csv"]), &["named.csv", "line 2", "have none"]);
    assert_refused(&with(&["--labels", "labels.csv"]), &["labels.csv", "--queries-labels"]);
    assert_refused(&with(&[]), &["--ground-truth", "--labels", "--same-index"]);
    assert!(!folder.join("logs").exists(), "nothing was begun");
    fs::create_dir(folder.join("logs")).unwrap();
    fs::write(folder.join("logs/taken"), "").unwrap();
    let output = with(&["--ground-truth", "padded.npy", "--log-dir", "taken"]);
    assert_refused(&output, &["logs/taken"]);
    assert_eq!(text(&output.stdout), "", "before the work");
}

#[test]
fn numbers_come_with_intervals_and_all_digits() {
    let world = world();
    let folder = world.path();
    files::write_all(folder);
    let with = |format: &str| {
        let flags = ["--distances", "distances.npy", "--auc-pr", "--format", format];
        evaluate(folder, &flags, &["--ground-truth".to_owned(), "pairs.csv".to_owned()])
    };
    let line = success(&with("line"));
    assert_eq!(line.lines().next(), LINE.lines().next());
    assert!(line.contains("AUC-PR: "), "{line}");
    let table = success(&with("table"));
    assert!(table.starts_with(LINE) && table.contains(".33 (.1–.8)"), "{table}");
    let json = with("json");
    let value: Value = serde_json::from_str(&success(&json)).unwrap();
    assert!(text(&json.stderr).contains(LINE.trim_end()), "the line stays visible");
    let cells = value["cells"].as_array().unwrap();
    assert_eq!(cells[0]["row"], "R@1");
    assert_eq!(cells[0]["value"], 1.0 / 3.0);
    // Wilson's interval of one in three.
    assert!(
        (cells[0]["interval"]["low"].as_f64().unwrap() - 0.061_492).abs() < 1e-5,
        "{}",
        cells[0]
    );
    assert_eq!(cells.iter().filter(|cell| cell["row"] == "AUC-PR").count(), 2);
    let csv = success(&with("csv"));
    assert!(csv.contains("R@2,value,0.6666666666666666,"), "{csv}");
    let flags = ["--distances", "distances.npy", "--num-preds-to-save", "1"];
    success(&evaluate(folder, &flags, &["--ground-truth".to_owned(), "pairs.csv".to_owned()]));
    let run = fs::read_dir(folder.join("logs/default")).unwrap().next().unwrap().unwrap().path();
    assert!(fs::read_to_string(run.join("metrics.csv")).unwrap().contains("R@1,value,0.333333"));
}

#[test]
fn images_that_cannot_be_decoded_are_left_out_if_asked() {
    let world = world();
    let folder = world.path();
    files::write_all(folder);
    let images = ["--database-folder", "database", "--queries-folder", "queries"];
    let truth = ["--labels".to_owned(), "folders".to_owned()];
    fs::write(folder.join("database/stairs/2.jpg"), b"no image").unwrap();
    fs::write(folder.join("queries/attic/c.jpg"), b"").unwrap();
    assert_refused(&evaluate(folder, &images, &truth), &["queries/attic/c.jpg"]);
    let output =
        evaluate(folder, &[&images[..], &["--skip-bad", "--format", "json"]].concat(), &truth);
    let value: Value = serde_json::from_str(&success(&output)).unwrap();
    assert_eq!(value["cells"][0]["n"], 2, "two queries are left");
    let said = text(&output.stderr);
    for part in
        ["skipped ", "database/stairs/2.jpg", "queries/attic/c.jpg", "1 queries lost their last"]
    {
        assert!(said.contains(part), "`{part}` is not in: {said}");
    }
    let validated = bench(folder, &["validate", ".", "--labels", "folders"]);
    assert_eq!(validated.status.code(), Some(1));
    assert!(text(&validated.stdout).contains("queries/attic/c.jpg"));
}

/// The fixture's truth without its last two queries, where a study finds it.
fn truncated(folder: &Path) {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/fixture");
    let mut folders = vec![data.clone()];
    while let Some(from) = folders.pop() {
        let to = folder.join("fixture").join(from.strip_prefix(&data).unwrap());
        fs::create_dir_all(&to).unwrap();
        for entry in fs::read_dir(&from).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                fs::copy(&path, to.join(path.file_name().unwrap())).unwrap();
            }
        }
    }
    let lists: Vec<Vec<i64>> = (0..10).map(|query| vec![query]).collect();
    let lists: Vec<&[i64]> = lists.iter().map(Vec::as_slice).collect();
    let truth = folder.join("fixture/places/ground_truth_new.npy");
    fs::write(truth, files::vpr_bench(&lists)).unwrap();
}

#[test]
fn a_truncated_truth_fails_every_study_that_rests_on_it() {
    let data = tempfile::tempdir().unwrap();
    truncated(data.path());
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let flags = ["--data", data.path().to_str().unwrap(), "--check", "docs/results"];
    for id in ["table-3.2", "table-3.5"] {
        let text = fs::read_to_string(workspace.join(format!("experiments/{id}.toml"))).unwrap();
        let lines = text.lines().map(|line| match line.strip_prefix("datasets = ") {
            Some(_) => "datasets = [\"fixture\"]\n".to_owned(),
            None => format!("{line}\n"),
        });
        let path = data.path().join(format!("{id}.toml"));
        fs::write(&path, lines.collect::<String>()).unwrap();
        let output = bench(&workspace, &[&["run", path.to_str().unwrap()], &flags[..]].concat());
        assert_refused(&output, &["ground_truth_new.npy", "number of rows: 10", "12"]);
    }
    let places = data.path().join("fixture/places");
    let validated = bench(&workspace, &["validate", places.to_str().unwrap()]);
    assert_eq!(validated.status.code(), Some(1));
    assert!(text(&validated.stdout).contains("number of rows: 10, but query/ has 12 images"));
}
