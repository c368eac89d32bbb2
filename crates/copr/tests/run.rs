//! `copr run` as a user meets it, on places small enough for a test.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a test fails by panicking and says what it skips"
)]

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use copr::study::Study;
use vpr_report::experiment;

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

fn copr(arguments: &[&str], threads: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_copr"))
        .current_dir(workspace())
        .args(arguments)
        .env_remove("VPR_DATA")
        .env("VPR_CACHE", Path::new(env!("CARGO_TARGET_TMPDIR")).join("copr-run"))
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
        "id = \"{id}\"\ntitle = \"a test\"\nsource = \"a test\"\nchapter = \"copr\"\nseed = 3\n\n[study]\n"
    );
    let path = dir.join(format!("{id}.toml"));
    fs::write(&path, head + study).unwrap();
    path.to_str().unwrap().to_owned()
}

const SCENE: &str = "scenes = [{ name = \"Heads\", key = \"heads\", references = [\"seq-02\"], \
                     queries = [\"seq-01\"], kept = \"seq-02\", span_m = [0.4, 0.4] }]\n";
const ROOMS: &str = "[study.rooms]\nplaces = 16\nquery_every = 4\nsettings = [\"camera.width=64\", \
                     \"camera.height=48\", \"camera.focal=58.5\", \"depth=false\"]\nevery = 4\n\
                     paths = [\"own\"]\nencoders = [\"hog\"]\n";

#[test]
fn every_experiment_of_the_chapter_can_be_read() {
    let mut n = 0;
    for entry in fs::read_dir(workspace().join("experiments")).unwrap() {
        let path = entry.unwrap().path();
        let is_of_chapter =
            || fs::read_to_string(&path).unwrap().contains("\nchapter = \"copr\"\n");
        if path.extension().is_some_and(|it| it == "toml") && is_of_chapter() {
            experiment::load::<Study>(&path).unwrap();
            n += 1;
        }
    }
    assert!(n >= 12, "{n} experiments");
}

#[test]
fn a_room_is_extrapolated_the_same_for_any_number_of_threads() {
    let dir = tempfile::tempdir().unwrap();
    let methods = "methods = [{ method = \"plane\", definition = \"corrected\" }, \
                   { method = \"network\", weights = \"models/none.safetensors\" }, \
                   { method = \"control\", control = \"random\" }]\n";
    let study =
        format!("kind = \"extrapolation\"\nevery = 4\nstep_m = 0.2\n{SCENE}{methods}{ROOMS}");
    let path = write(dir.path(), "extrapolation", &study);
    let run = |threads| {
        let output = copr(&["run", &path, "--data", "data", "--format", "csv"], threads);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        text(&output.stdout)
    };
    let one = run("1");
    for part in [
        "MTE, m: dense map, oracle",
        "MTE, m: sparse map / hog, room",
        "dense map, Lin. Reg. / hog, room",
        "models/none.safetensors is not at hand",
        "random rows",
        "generated",
        "paired bootstrap over queries",
        "7-Scenes poses: no poses at hand",
    ] {
        assert!(one.contains(part), "`{part}` is not in: {one}");
    }
    assert_eq!(one, run("2"));
}

#[test]
fn a_room_is_interpolated_as_released_and_as_it_should_be() {
    let dir = tempfile::tempdir().unwrap();
    let methods = "methods = [{ method = \"linear-interpolation\" }, \
                   { method = \"plane\", definition = \"published\" }]\n";
    let study = format!("kind = \"interpolation\"\nevery = 4\n{SCENE}{methods}{ROOMS}");
    let path = write(dir.path(), "interpolation", &study);
    let output = copr(&["run", &path, "--data", "data", "--format", "json"], "2");
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let out = text(&output.stdout);
    for part in ["ground-truth map", "Lin. Interp.", "published", "corrected", "sees its own"] {
        assert!(out.contains(part), "`{part}` is not in: {out}");
    }
}

const TWO: &str = "scenes = [\n\
    { name = \"Heads\", key = \"heads\", references = [\"seq-02\"], queries = [\"seq-01\"], \
    kept = \"seq-02\", span_m = [0.4, 0.4] },\n\
    { name = \"Fire\", key = \"fire\", references = [\"seq-01\"], queries = [\"seq-03\"], \
    kept = \"seq-01\", span_m = [0.4, 0.4] },\n]\n";
const PLANE: &str = "{ method = \"plane\", definition = \"corrected\" }";
const COPIED: &str = "{ method = \"control\", control = \"copied\" }";

/// Runs a study; what it prints.
fn run_study(dir: &Path, id: &str, study: &str) -> String {
    let path = write(dir, id, study);
    let output = copr(&["run", &path, "--data", "data", "--format", "csv"], "2");
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    text(&output.stdout)
}

#[test]
fn figures_are_tables_too() {
    let dir = tempfile::tempdir().unwrap();
    let study = format!("kind = \"density\"\nsteps_m = [0.2, 0.4]\nmethod = {PLANE}\n{TWO}{ROOMS}");
    let out = run_study(dir.path(), "density", &study);
    // A span of 0.4 m holds three steps of 0.2 m both ways, and only itself at 0.4 m.
    assert!(out.contains("step 0.2 m") && out.contains("36 regressed rows"), "{out}");
    assert!(out.contains("step 0.4 m") && out.contains("4 regressed rows"), "{out}");
    let study = format!("kind = \"viewpoints\"\n{TWO}{ROOMS}");
    let out = run_study(dir.path(), "viewpoints", &study);
    assert!(out.contains("\"MTE, m: hog, room\",Fire,"), "{out}");
    let rooms = ROOMS.replace("[study.rooms]", "[study.looked.rooms.rooms]");
    let study = format!(
        "kind = \"matches\"\nclasses = {{ near_m = 0.2, middle_m = 0.4 }}\nmethods = [{PLANE}]\n\
         [study.looked.rooms]\nstep_m = 0.2\n{TWO}{rooms}"
    );
    let out = run_study(dir.path(), "matches", &study);
    for part in ["within 0.2 m", "0.2 to 0.4 m", "beyond 0.4 m", "oracle", "sparse map"] {
        assert!(out.contains(part), "`{part}` is not in: {out}");
    }
}

#[test]
fn strays_are_counted_over_all_queries() {
    let dir = tempfile::tempdir().unwrap();
    let study = format!("kind = \"stray\"\nmethods = [{PLANE}]\n{TWO}{ROOMS}");
    let out = run_study(dir.path(), "stray", &study);
    let share = |row: &str| -> f64 {
        let line = out.lines().find(|it| it.starts_with(row) && it.contains(",Heads,")).unwrap();
        line.rsplit("Heads,").next().unwrap().split(',').next().unwrap().parse().unwrap()
    };
    let before = share("\"strayed: sparse map");
    let after = share("\"strayed: dense map");
    let mended = share("\"no longer strayed: dense map");
    assert!((before - mended - after).abs() < 1e-9, "one more row of one's own never hurts: {out}");
}

#[test]
fn sizes_are_counted_and_times_come_on_request() {
    let dir = tempfile::tempdir().unwrap();
    let scene = TWO.lines().nth(1).unwrap().trim().trim_end_matches(',');
    let study = format!(
        "kind = \"footprint\"\nstep_m = 0.2\nplaces = []\nmethod = {PLANE}\nscene = {scene}\n{ROOMS}"
    );
    let out = run_study(dir.path(), "footprint", &study);
    // 16 images; 4 anchors × 3 × 3 targets.
    assert!(out.contains("\"map size, rows: dense map\",\"Heads, hog, room\",52.0,"), "{out}");
    assert!(out.contains("measured on request: --timings"), "{out}");
    let path = dir.path().join("footprint.toml");
    let path = path.to_str().unwrap();
    let output = copr(&["run", path, "--data", "data", "--format", "csv", "--timings"], "2");
    let out = text(&output.stdout);
    assert!(out.contains("t_enc + t_match") && !out.contains("on request"), "{out}");
}

#[test]
fn an_encoder_is_trained_on_rooms_and_found_by_its_name() {
    let dir = tempfile::tempdir().unwrap();
    let study = format!("kind = \"viewpoints\"\n{TWO}{}", ROOMS.replace("hog", "distance"));
    let path = write(dir.path(), "encoder", &study);
    let data = dir.path().join("data");
    let output = data.join("models/copr-encoder-distance.safetensors");
    fs::create_dir_all(output.parent().unwrap()).unwrap();
    let work = dir.path().join("work");
    let training = [
        "train",
        "encoder",
        "--loss",
        "distance",
        "--experiment",
        &path,
        "--steps",
        "4",
        "--batch",
        "4",
        "--validated-every",
        "2",
        "--variants",
        "1",
    ];
    let dry = copr(&[&training[..], &["--dry-run"]].concat(), "2");
    assert_eq!(text(&dry.stdout), "rooms: 2\ntraining images: 8\nvalidation images: 32\n");
    let (out, work) = (output.to_str().unwrap(), work.to_str().unwrap());
    let trained = copr(&[&training[..], &["--output", out, "--checkpoints", work]].concat(), "2");
    assert_eq!(trained.status.code(), Some(0), "{}", text(&trained.stderr));
    assert!(text(&trained.stderr).contains("4: loss"), "{}", text(&trained.stderr));
    let found = copr(&["run", &path, "--data", data.to_str().unwrap(), "--format", "csv"], "2");
    assert_eq!(found.status.code(), Some(0), "{}", text(&found.stderr));
    let found = text(&found.stdout);
    assert!(found.contains("distance, room\",Heads,0."), "{found}");
}

/// Oracle rows follow from the published camera paths alone.
#[test]
fn oracle_rows_of_real_poses_are_those_of_an_independent_computation() {
    let Some(data) = std::env::var_os("VPR_DATA").map(PathBuf::from) else {
        println!("skipped: VPR_DATA is not set");
        return;
    };
    if !data.join("7scenes/poses").is_dir() {
        println!("skipped: VPR_DATA has no 7scenes/poses");
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    for (id, expected) in [
        ("table-6.1", [0.0846, 0.0729, 0.0337, 0.0729, 0.0757, 0.2156, 0.1184]),
        ("table-6.3", [0.1094, 0.1905, 0.0974, 0.1198, 0.1159, 0.1309, 0.1384]),
    ] {
        // Without the generated rooms.
        let file = fs::read_to_string(workspace().join(format!("experiments/{id}.toml"))).unwrap();
        let bare = |line: &str| {
            let is_list = line.starts_with("encoders = ");
            if is_list { "encoders = []".to_owned() } else { line.to_owned() }
        };
        let file: Vec<String> = file.lines().map(bare).collect();
        let file = file.join("\n");
        let path = dir.path().join(format!("{id}.toml"));
        fs::write(&path, file).unwrap();
        let data = data.to_str().unwrap();
        let path = path.to_str().unwrap();
        let output = copr(&["run", path, "--data", data, "--format", "json"], "2");
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let table: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let cells = table["cells"].as_array().unwrap();
        let scenes = ["Chess", "Fire", "Heads", "Office", "Pumpkin", "Redkitchen", "Stairs"];
        for (scene, expected) in scenes.iter().zip(expected) {
            let cell = cells.iter().find(|it| {
                it["row"] == "MTE, m: dense map, oracle"
                    && it["column"] == *scene
                    && it["definition"] != "corrected"
            });
            let value = cell.unwrap()["value"].as_f64().unwrap();
            assert!((value - expected).abs() < 6e-5, "{id}, {scene}: {value}, not {expected}");
        }
    }
}

/// An H of two halves of the rooms of [`TWO`], as `copr train regressor` makes it.
fn trained(dir: &Path, path: &str, more: &[&str]) -> (PathBuf, String) {
    let output = dir.join("data/models/copr-default-held-out.safetensors");
    fs::create_dir_all(output.parent().unwrap()).unwrap();
    let (out, work) = (output.to_str().unwrap(), dir.join("work"));
    let training = "train regressor --held-out --near 9,180 --steps 4 --batch 4 \
                    --validated-every 2 --layers 1 --experiment";
    let mut words: Vec<&str> = training.split_whitespace().collect();
    words.extend([path, "--output", out, "--checkpoints", work.to_str().unwrap()]);
    words.extend(more);
    let trained = copr(&words, "2");
    assert_eq!(trained.status.code(), Some(0), "{}", text(&trained.stderr));
    (output.clone(), text(&trained.stdout))
}

/// Two sequences of each room, one of them kept.
const SEQUENCES: &str = "scenes = [\n\
    { name = \"Heads\", key = \"heads\", references = [\"seq-02\", \"seq-03\"], \
    queries = [\"seq-01\"], kept = \"seq-02\", span_m = [0.4, 0.4] },\n\
    { name = \"Fire\", key = \"fire\", references = [\"seq-01\", \"seq-02\"], \
    queries = [\"seq-03\"], kept = \"seq-01\", span_m = [0.4, 0.4] },\n]\n";

#[test]
fn what_is_held_out_is_learned_from_and_compared() {
    let dir = tempfile::tempdir().unwrap();
    let held_out =
        "{ method = \"network\", weights = \"models/copr-{encoder}-held-out.safetensors\" }";
    let study = format!(
        "kind = \"variants\"\nstep_m = 0.2\n{SEQUENCES}\
         plain = {{ name = \"plain\", method = {held_out} }}\nvariants = [\n\
         {{ name = \"a\", method = {held_out}, keep = {{ share = 0.5, least = \"disagreement\" }} }},\n\
         {{ name = \"b\", method = {held_out}, keep = {{ share = 0.5, least = \"variance\" }} }},\n\
         {{ name = \"c\", method = {held_out}, keep = {{ share = 1.0, least = \"outside\" }} }},\n\
         {{ name = \"d\", method = {{ method = \"network\", weights = \"models/none\" }} }},\n]\n\
         {}",
        ROOMS.replace("hog", "default")
    );
    let path = write(dir.path(), "variants", &study);
    // Eight images of a room are left out, all near each other: 2 · 8 · 7 pairs, or half without one.
    let (_, dry) = trained(dir.path(), &path, &["--dry-run"]);
    assert!(dry.contains("training pairs: 112\nvalidation pairs: 112\n"), "{dry}");
    let (_, dry) = trained(dir.path(), &path, &["--dry-run", "--without", "fire"]);
    assert!(dry.contains("training pairs: 56\n"), "{dry}");
    trained(dir.path(), &path, &[]);
    let data = dir.path().join("data");
    let output = copr(&["run", &path, "--data", data.to_str().unwrap(), "--format", "csv"], "2");
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let out = text(&output.stdout);
    // Two anchors × 3 × 3 targets.
    for (row, part) in [
        ("MTE, m: plain", "18 regressed rows"),
        ("MTE, m: a", "9 regressed rows"),
        ("MTE, m: b", "9 regressed rows"),
        ("MTE, m, minus that of plain: a", "paired bootstrap over queries"),
        ("MTE, m: d", "is not at hand"),
    ] {
        let line = out.lines().find(|it| it.starts_with(&format!("\"{row} /"))).unwrap_or_default();
        assert!(line.contains(part), "`{row}`, `{part}`: {out}");
    }
    let same = out.lines().filter(|it| it.starts_with("\"MTE, m, minus that of plain: c /"));
    assert!(same.filter(|it| it.contains(",0.0,") || it.contains(",0,")).count() >= 2, "{out}");
}

#[test]
fn a_retrieval_is_refined_by_the_pose_between_two_descriptors() {
    let dir = tempfile::tempdir().unwrap();
    let study = format!(
        "kind = \"coarse-to-fine\"\nstep_m = 0.2\n{SEQUENCES}method = {COPIED}\n\
         poses = [\"models/copr-{{encoder}}-held-out.safetensors\", \"models/none\"]\n{}",
        ROOMS.replace("hog", "default")
    );
    let path = write(dir.path(), "fine", &study);
    trained(dir.path(), &path, &["--gives", "pose"]);
    let data = dir.path().join("data");
    let output = copr(&["run", &path, "--data", data.to_str().unwrap(), "--format", "csv"], "2");
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let out = text(&output.stdout);
    for row in [
        "MTE, m: dense map, coarse",
        "MRE, °: dense map, fine",
        "MTE, m, minus that of the coarse pose: sparse map, fine",
        "MTE, m, minus that of the sparse map's fine one: dense map, fine",
    ] {
        assert!(out.contains(&format!("\"{row} /")), "`{row}`: {out}");
    }
    assert!(out.contains("models/none is not at hand"), "{out}");
}

#[test]
fn maps_are_thinned_and_places_are_drawn() {
    let dir = tempfile::tempdir().unwrap();
    let study = format!(
        "kind = \"thinned\"\nevery = [2, 4]\nmethods = [{{ method = \"linear-interpolation\" }}]\n\
         {SEQUENCES}{ROOMS}"
    );
    let out = run_study(dir.path(), "thinned", &study);
    // Eight images of each of two sequences: 0, 2, 4, 6 and 7 stay.
    assert!(out.contains("10 of 16 images") && out.contains("6 of 16 images"), "{out}");
    let regressed = "MTE, m, minus that of all images: one image in 4, dense map, Lin. Interp.";
    assert!(out.contains(regressed), "{out}");
    let study = format!("kind = \"setup\"\nstep_m = 0.2\n{SEQUENCES}{ROOMS}");
    let out = run_study(dir.path(), "setup", &study);
    assert!(out.contains("targets,\"Heads, extrapolation\",18.0,"), "{out}");
    assert!(out.contains("targets,\"Heads, interpolation\",5.0,"), "{out}");
    let rooms = ROOMS.replace("[study.rooms]", "[study.looked.interpolated.rooms]");
    let study = format!(
        "kind = \"matches\"\nclasses = {{ near_m = 0.2, middle_m = 0.4 }}\nmethods = [{PLANE}]\n\
         [study.looked.interpolated]\n{SEQUENCES}{rooms}"
    );
    let out = run_study(dir.path(), "interpolated", &study);
    assert!(out.contains("ground-truth map") && out.contains("oracle"), "{out}");
}
