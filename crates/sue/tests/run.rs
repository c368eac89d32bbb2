//! `sue run` as a user meets it, on places small enough for a test.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use sue::study::Study;
use vpr_report::experiment;

const WORLD: &str = "world/corridor?places=12&camera.width=80&camera.height=60&camera.focal=55.0";

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

fn sue(arguments: &[&str], threads: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sue"))
        .current_dir(workspace())
        .args(arguments)
        .env_remove("VPR_DATA")
        .env("VPR_CACHE", Path::new(env!("CARGO_TARGET_TMPDIR")).join("sue-run"))
        .env("RAYON_NUM_THREADS", threads)
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// An experiment file in `dir`.
fn write(dir: &Path, id: &str, study: &str) -> String {
    let head = format!(
        "id = \"{id}\"\ntitle = \"a test\"\nsource = \"a test\"\nchapter = \"sue\"\nseed = 3\n\n[study]\n"
    );
    let path = dir.join(format!("{id}.toml"));
    fs::write(&path, head + study).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn every_experiment_of_the_chapter_can_be_read() {
    let mut n = 0;
    for entry in fs::read_dir(workspace().join("experiments")).unwrap() {
        let path = entry.unwrap().path();
        let is_of_chapter = || fs::read_to_string(&path).unwrap().contains("\nchapter = \"sue\"\n");
        if path.extension().is_some_and(|it| it == "toml") && is_of_chapter() {
            experiment::load::<Study>(&path).unwrap();
            n += 1;
        }
    }
    assert!(n >= 18, "{n} experiments");
}

#[test]
fn the_table_of_needs_is_the_committed_one() {
    let output = sue(&["run", "experiments/table-5.1.toml", "--check", "docs/results"], "2");
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
}

#[test]
fn estimators_are_compared_on_generated_places_the_same_for_any_number_of_threads() {
    let dir = tempfile::tempdir().unwrap();
    let study = format!(
        "kind = \"comparison\"\nsubjects = [{{ dataset = '{WORLD}', encoders = [\"hog\"], verify = [\"sift\", \"xfeat\"] }}]\n"
    );
    let path = write(dir.path(), "comparison", &study);
    let run = |threads| {
        let output = sue(&["run", &path, "--data", "data", "--format", "csv"], threads);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        text(&output.stdout)
    };
    let one = run("1");
    for part in ["SUE", "PA-Score", "SIFT-RANSAC", "generated", "Wilson, effective queries"] {
        assert!(one.contains(part), "`{part}` is not in: {one}");
    }
    let missing: Vec<&str> = one.lines().filter(|line| line.contains("XFeat-RANSAC")).collect();
    assert!(!missing.is_empty(), "{one}");
    assert!(missing.iter().all(|line| line.contains("xfeat.pt, are not at hand")), "{missing:?}");
    assert_eq!(one, run("2"));
}

#[test]
fn a_picture_is_drawn_beside_its_page() {
    let dir = tempfile::tempdir().unwrap();
    let study = format!(
        "kind = \"gallery\"\nsubject = {{ dataset = '{WORLD}', encoders = [\"hog\"] }}\nscene = \"ranked\"\n"
    );
    let path = write(dir.path(), "ranked", &study);
    let pages = dir.path().join("pages");
    let pages = pages.to_str().unwrap();
    let output = sue(&["run", &path, "--data", "data", "--write", pages], "2");
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let page = fs::read_to_string(dir.path().join("pages/ranked.md")).unwrap();
    assert!(page.contains("![ranked](ranked.png)"), "{page}");
    let picture = image::open(dir.path().join("pages/ranked.png")).unwrap();
    assert!(picture.width() > 100 && picture.height() > 50);
}

#[test]
fn an_experiment_of_another_chapter_or_with_a_wrong_key_is_refused_by_name() {
    let output = sue(&["run", "experiments/table-3.5.toml"], "2");
    assert_eq!(output.status.code(), Some(2));
    let dir = tempfile::tempdir().unwrap();
    let path = write(dir.path(), "wrong", "kind = \"needs\"\nlambdas = 3\n");
    let output = sue(&["run", &path], "2");
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("wrong.toml"), "{}", text(&output.stderr));
}
