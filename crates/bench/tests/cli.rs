//! The program as a user meets it: output, exit codes, and what it says about wrong input.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use ndarray::array;
use serde_json::Value;
use vpr_files::npy;

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().expect("a workspace")
}

fn bench(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bench"));
    command.current_dir(workspace()).args(arguments).env_remove("VPR_DATA");
    command.env("VPR_CACHE", Path::new(env!("CARGO_TARGET_TMPDIR")).join("bench-cli"));
    command
}

/// A generated corridor of eight places, small enough for a test.
const WORLD: &str = "world/corridor?places=8&camera.width=80&camera.height=60&camera.focal=55.0";

/// An experiment of the workspace on these datasets only, in `dir`.
fn on_datasets(dir: &Path, id: &str, datasets: &[&str]) -> String {
    let text = fs::read_to_string(workspace().join(format!("experiments/{id}.toml"))).unwrap();
    let lines = text.lines().map(|line| match line.strip_prefix("datasets = ") {
        Some(_) => format!("datasets = {datasets:?}"),
        None => line.to_owned(),
    });
    let path = dir.join(format!("{id}.toml"));
    fs::write(&path, lines.collect::<Vec<_>>().join("\n") + "\n").unwrap();
    path.to_str().unwrap().to_owned()
}

fn run(arguments: &[&str]) -> Output {
    bench(arguments).output().expect("the program starts")
}

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).expect("UTF-8")
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).expect("UTF-8")
}

/// Asserts exit code 2 and a one-line error that contains all of these.
fn assert_refused(output: &Output, parts: &[&str]) {
    let text = stderr(output);
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(text.starts_with("error: "), "{text}");
    assert_eq!(text.lines().count(), 1, "{text}");
    for part in parts {
        assert!(text.contains(part), "`{part}` is not in: {text}");
    }
}

#[test]
fn techniques_are_listed() {
    let lines = [
        "NetVLAD     from stored matches",
        "RegionVLAD  from stored matches",
        "CoHOG       runs on images, and from stored matches",
        "HOG         runs on images, and from stored matches",
        "AlexNet     from stored matches",
        "AMOSNet     from stored matches",
        "HybridNet   from stored matches",
        "CALC        from stored matches",
        "AP-GeM      from stored matches",
        "DenseVLAD   runs on images, and from stored matches",
    ];
    assert_eq!(
        stdout(&run(&["list", "techniques"])).lines().map(str::trim_end).collect::<Vec<_>>(),
        lines
    );
}

#[test]
fn a_fresh_clone_computes_generated_cells_and_says_what_is_absent() {
    let dir = tempfile::tempdir().unwrap();
    let path = on_datasets(dir.path(), "table-3.5", &["spedtest", "fixture", WORLD]);
    let output = run(&["run", &path, "--format", "json"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let table: Value = serde_json::from_str(&stdout(&output)).expect("JSON");
    assert_eq!(table["id"], "table-3.5");
    let cells = table["cells"].as_array().expect("cells");
    let of = |provenance: &str| {
        cells.iter().filter(|it| it["provenance"] == provenance).cloned().collect::<Vec<_>>()
    };
    let of_hand = of("generated")
        .iter()
        .filter(|it| it["column"].as_str().is_some_and(|column| column.contains("HOG")))
        .count();
    assert_eq!(of_hand, 12, "two definitions of three techniques on two datasets");
    assert_eq!(of("published").len() + of("measured").len(), 0);
    let absent = of("absent");
    assert!(absent.iter().all(|it| it["value"].is_null()));
    // The other rows of the thesis are of datasets that this experiment leaves out.
    let named: Vec<_> = absent.iter().filter(|it| it["row"] == "SPEDTest").collect();
    assert_eq!(named.len(), 10, "one per technique");
    assert!(named.iter().all(|it| it["note"].as_str().is_some_and(|note| note.contains("origin"))));
    let keys: Vec<&String> = cells[0].as_object().expect("a cell").keys().collect();
    assert_eq!(
        keys,
        ["column", "definition", "interval", "n", "note", "provenance", "row", "thesis", "value"]
    );
}

#[test]
fn the_same_command_gives_the_same_bytes_for_any_number_of_threads() {
    let dir = tempfile::tempdir().unwrap();
    let table = on_datasets(dir.path(), "table-3.5", &["fixture", WORLD]);
    let figure = dir.path().join("figure-3.19.toml");
    let text = fs::read_to_string(workspace().join("experiments/figure-3.19.toml")).unwrap();
    let (before, stages) = text.split_once("stages = [").unwrap();
    fs::write(&figure, before.to_owned() + stages.split_once("\n]\n").unwrap().1).unwrap();
    for experiment in [table.as_str(), figure.to_str().unwrap()] {
        let with = |threads: &str| {
            let mut command = bench(&["run", experiment, "--format", "csv"]);
            command.env("RAYON_NUM_THREADS", threads).output().expect("the program starts").stdout
        };
        let once = with("1");
        assert!(!once.is_empty());
        assert_eq!(once, with("1"));
        assert_eq!(once, with("2"));
        assert_eq!(once, with("5"));
    }
}

#[test]
fn a_number_that_is_off_exits_with_1() {
    let dir = tempfile::tempdir().unwrap();
    let path = on_datasets(dir.path(), "table-3.5", &["fixture"]);
    let text = fs::read_to_string(&path).unwrap();
    let wrong = "\n[[expect]]\ndefinition = \"published\"\nprovenance = \"generated\"\ntolerance = 1e-6\n\
                 [expect.grid]\ncolumns = [\"HOG\"]\nrows = [{ name = \"Generated fixture\", values = [0.123] }]\n";
    fs::write(&path, text + wrong).unwrap();
    let output = run(&["run", &path, "--check", "docs/results"]);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(stderr(&output).contains("expected 0.123"), "{}", stderr(&output));
}

#[test]
fn folders_with_positions_give_the_result_line() {
    let output = run(&[
        "evaluate",
        "--database_folder",
        "data/fixture/utm/database",
        "--queries-folder",
        "data/fixture/utm/queries",
        "--recall-values",
        "1",
        "5",
    ]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(stdout(&output).trim_end(), "R@1: 66.7, R@5: 66.7");
}

#[test]
fn a_report_is_written_beside_the_result_line() {
    let dir = tempfile::tempdir().unwrap();
    let report = dir.path().join("out.html");
    let output = run(&[
        "evaluate",
        "--database-folder",
        "data/fixture/utm/database",
        "--queries-folder",
        "data/fixture/utm/queries",
        "--report",
        report.to_str().unwrap(),
    ]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(stdout(&output).starts_with("R@1: 66.7"), "{}", stdout(&output));
    let html = fs::read_to_string(&report).unwrap();
    // Provenance, a number of the result line, a map and pictures.
    for part in ["--report", "within 25 m", "<td>0.667 <small>", "id=\"map\"", "data:image/jpeg"] {
        assert!(html.contains(part), "{part}");
    }
    let missing = dir.path().join("nowhere").join("out.html");
    let output = run(&[
        "evaluate",
        "--database-folder",
        "data/fixture/utm/database",
        "--queries-folder",
        "data/fixture/utm/queries",
        "--report",
        missing.to_str().unwrap(),
    ]);
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(stderr(&output).contains("nowhere"), "{}", stderr(&output));
}

/// A folder with two descriptor files and their poses.
fn descriptors() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let references = array![[1.0_f32, 0.0], [0.0, 1.0], [-1.0, 0.0]];
    npy::write_f32(&at("r.npy"), references.view()).unwrap();
    npy::write_f32(&at("q.npy"), array![[0.9_f32, 0.1], [0.8, 0.9]].view()).unwrap();
    fs::write(at("r.csv"), "name,easting,northing\na,0,0\nb,100,0\nc,200,0\n").unwrap();
    fs::write(at("q.csv"), "name,easting,northing\nx,25,0\ny,230,0\n").unwrap();
    dir
}

fn evaluate(dir: &Path, extra: &[&str]) -> Output {
    let at = |name: &str| dir.join(name).to_str().unwrap().to_owned();
    let (references, queries) = (at("r.npy"), at("q.npy"));
    let mut arguments =
        vec!["evaluate", "--database-descriptors", &references, "--queries-descriptors", &queries];
    arguments.extend(extra);
    bench(&arguments).current_dir(dir).output().unwrap()
}

#[test]
fn descriptor_files_give_the_result_line_with_an_inclusive_radius() {
    let dir = descriptors();
    let poses =
        ["--database-poses", "r.csv", "--queries-poses", "q.csv", "--recall-values", "1", "3"];
    assert_eq!(stdout(&evaluate(dir.path(), &poses)).trim_end(), "R@1: 50.0, R@3: 50.0");
}

#[test]
fn predictions_are_saved_as_the_field_has_them() {
    let dir = descriptors();
    let output = evaluate(
        dir.path(),
        &[
            "--database-poses",
            "r.csv",
            "--queries-poses",
            "q.csv",
            "--num_preds_to_save",
            "2",
            "--log_dir",
            "x",
        ],
    );
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let run = fs::read_dir(dir.path().join("logs/x")).unwrap().next().unwrap().unwrap().path();
    let text = fs::read_to_string(run.join("preds/000.txt")).unwrap();
    assert_eq!(text, "Query path:\nx\n\nPredictions paths:\na\nb\n\nPositives paths:\na\n");
}

#[test]
fn wrong_descriptors_are_refused_by_file_and_place() {
    let dir = descriptors();
    let labels = ["--no-labels"];
    npy::write_f32(&dir.path().join("q.npy"), array![[0.9_f32, f32::NAN]].view()).unwrap();
    assert_refused(&evaluate(dir.path(), &labels), &["q.npy", "row 0", "column 1", "NaN"]);
    npy::write_f32(&dir.path().join("q.npy"), array![[1.0_f32], [1.0]].view()).unwrap();
    assert_refused(&evaluate(dir.path(), &labels), &["q.npy", "expected 2, got 1"]);
    let whole = fs::read(dir.path().join("r.npy")).unwrap();
    fs::write(dir.path().join("q.npy"), &whole[..whole.len() - 3]).unwrap();
    assert_refused(&evaluate(dir.path(), &labels), &["q.npy"]);
    fs::remove_file(dir.path().join("q.npy")).unwrap();
    assert_refused(&evaluate(dir.path(), &labels), &["q.npy", "No such file"]);
}

#[test]
fn poses_must_be_as_many_as_descriptors() {
    let dir = descriptors();
    fs::write(dir.path().join("q.csv"), "name,easting,northing\nx,25,0\n").unwrap();
    let poses = ["--database-poses", "r.csv", "--queries-poses", "q.csv"];
    assert_refused(&evaluate(dir.path(), &poses), &["q.csv", "expected 2, got 1"]);
}

#[test]
fn a_hostile_pickle_is_refused_not_executed() {
    let dir = descriptors();
    let marker = dir.path().join("executed");
    let payload = format!("cos\nsystem\n(S'touch {}'\ntR.", marker.display());
    let header = "{'descr': '|O', 'fortran_order': False, 'shape': (2, 2), }";
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend(118_u16.to_le_bytes());
    bytes.extend(format!("{header:<117}\n").bytes());
    bytes.extend(payload.bytes());
    fs::write(dir.path().join("gt.npy"), bytes).unwrap();
    assert_refused(
        &evaluate(dir.path(), &["--ground-truth", "gt.npy"]),
        &["gt.npy", "os", "system"],
    );
    assert!(!marker.exists());
}

/// Copies the fixture's places into a folder of the given name.
fn copy_places(to: &Path) {
    for part in ["query", "ref"] {
        fs::create_dir_all(to.join(part)).unwrap();
        for entry in fs::read_dir(workspace().join("data/fixture/places").join(part)).unwrap() {
            let path = entry.unwrap().path();
            fs::copy(&path, to.join(part).join(path.file_name().unwrap())).unwrap();
        }
    }
    let truth = "ground_truth_new.npy";
    fs::copy(workspace().join("data/fixture/places").join(truth), to.join(truth)).unwrap();
}

/// Runs a study on places of the user's own, laid out where the manifest looks for Corridor.
fn study_of(places: &Path) -> Output {
    let data = places.ancestors().nth(3).unwrap().to_str().unwrap().to_owned();
    let dir = tempfile::tempdir().unwrap();
    let path = on_datasets(dir.path(), "figure-3.11", &["corridor"]);
    run(&["run", &path, "--data", &data])
}

#[test]
fn damaged_images_are_refused_by_path() {
    let dir = tempfile::tempdir().unwrap();
    let places = dir.path().join("places");
    copy_places(&places);
    let (queries, references) = (places.join("query"), places.join("ref"));
    let (queries, references) = (queries.to_str().unwrap(), references.to_str().unwrap());
    let folders = ["--database-folder", references, "--queries-folder", queries];
    let retrieve = || run(&[&["evaluate", "--no-labels"], folders.as_slice()].concat());
    assert_eq!(retrieve().status.code(), Some(0));

    let image = places.join("query/0000003.jpg");
    let whole = fs::read(&image).unwrap();
    fs::write(&image, &whole[..whole.len() / 2]).unwrap();
    assert_refused(&retrieve(), &["query/0000003.jpg"]);
    fs::write(&image, b"not an image").unwrap();
    assert_refused(&retrieve(), &["query/0000003.jpg"]);
    for position in (0..whole.len()).step_by(whole.len() / 12) {
        let mut damaged = whole.clone();
        damaged[position] ^= 0x10;
        fs::write(&image, damaged).unwrap();
        let code = retrieve().status.code();
        assert!(matches!(code, Some(0 | 2)), "byte {position}: {code:?}");
    }
}

#[test]
fn missing_and_empty_folders_are_refused_by_name() {
    let dir = tempfile::tempdir().unwrap();
    let places = dir.path().join("vpr-bench/datasets/corridor");
    copy_places(&places);
    fs::remove_dir_all(places.join("ref")).unwrap();
    assert_refused(&study_of(&places), &["corridor/ref"]);
    fs::create_dir(places.join("ref")).unwrap();
    assert_refused(&study_of(&places), &["corridor/ref"]);
    assert_refused(
        &run(&["run", "experiments/table-3.5.toml", "--data", "no/such/folder"]),
        &["no/such/folder"],
    );
}

#[test]
fn a_truth_that_points_past_the_references_is_clamped_and_counted() {
    let dir = tempfile::tempdir().unwrap();
    let places = dir.path().join("vpr-bench/datasets/corridor");
    copy_places(&places);
    fs::remove_file(places.join("ref/0000011.jpg")).unwrap();
    let output = study_of(&places);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(stdout(&output).contains("entries of the ground truth point past the references"));
}

#[test]
fn an_at_sign_in_a_folder_name_does_no_harm() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("me@home@1@2");
    for part in ["database", "queries"] {
        fs::create_dir_all(folder.join(part)).unwrap();
        for entry in fs::read_dir(workspace().join("data/fixture/utm").join(part)).unwrap() {
            let path = entry.unwrap().path();
            fs::copy(&path, folder.join(part).join(path.file_name().unwrap())).unwrap();
        }
    }
    let (database, queries) = (folder.join("database"), folder.join("queries"));
    let output = run(&[
        "evaluate",
        "--database-folder",
        database.to_str().unwrap(),
        "--queries-folder",
        queries.to_str().unwrap(),
        "--recall-values",
        "1",
    ]);
    assert_eq!(stdout(&output), "R@1: 66.7\n", "{}", stderr(&output));
}

#[test]
fn validating_says_everything_at_once() {
    assert_eq!(run(&["validate", "data/fixture/places"]).status.code(), Some(0));
    let dir = tempfile::tempdir().unwrap();
    let places = dir.path().join("places");
    copy_places(&places);
    fs::write(places.join("query/0000000.jpg"), b"broken").unwrap();
    fs::write(places.join("ref/0000001.jpg"), b"").unwrap();
    fs::write(places.join("ref/notes.jpg"), b"x").unwrap();
    let output = run(&["validate", places.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(1));
    for part in ["query/0000000.jpg", "ref/0000001.jpg", "ref/notes.jpg"] {
        assert!(stdout(&output).contains(part), "{}", stdout(&output));
    }
    assert_refused(&run(&["validate", "no/such/folder"]), &["no/such/folder"]);
}

#[test]
fn a_misspelled_experiment_is_refused_by_line() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("table-3.5.toml");
    fs::write(&path, "id = \"table-3.5\"\ntitel = \"x\"\n").unwrap();
    assert_refused(&run(&["run", path.to_str().unwrap()]), &["table-3.5.toml", "line 2", "titel"]);
}

#[test]
fn several_experiments_run_in_one_process_and_the_worst_code_counts() {
    let dir = tempfile::tempdir().unwrap();
    let first = on_datasets(dir.path(), "table-3.1", &["fixture", WORLD]);
    let second = on_datasets(dir.path(), "figure-3.11", &["fixture", WORLD]);
    let output = run(&["run", &first, &second, "--format", "csv"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let alone =
        [run(&["run", &first, "--format", "csv"]), run(&["run", &second, "--format", "csv"])];
    assert_eq!(stdout(&output), stdout(&alone[0]) + &stdout(&alone[1]));
    let pages = dir.path().join("pages");
    let pages = pages.to_str().unwrap();
    assert_eq!(run(&["run", &first, "--write", pages]).status.code(), Some(0));
    let check = run(&["run", &first, &second, "--check", pages]);
    assert_eq!(check.status.code(), Some(1), "the second has no page: {}", stderr(&check));
}

#[test]
fn generated_places_go_by_name_wherever_a_dataset_does() {
    let recall = run(&["evaluate", "--dataset", WORLD, "--recall-values", "1", "8"]);
    assert_eq!(recall.status.code(), Some(0), "{}", stderr(&recall));
    assert!(stdout(&recall).ends_with("R@8: 100.0\n"), "{}", stdout(&recall));
    let small = "places=3&camera.width=32&camera.height=24";
    for layout in ["vpr-bench", "utm", "seven-scenes"] {
        let name = format!("world/street?{small}&layout=\"{layout}\"");
        let output = run(&["validate", &name]);
        assert_eq!(output.status.code(), Some(0), "{layout}: {}", stdout(&output));
    }
    assert_refused(&run(&["evaluate", "--dataset", "world/strete"]), &["strete", "known: street,"]);
    assert_refused(&run(&["evaluate", "--dataset", "spedtest"]), &["SPEDTest", "origin"]);
    assert_refused(&run(&["validate", "world/street?places=0"]), &["places"]);
}
