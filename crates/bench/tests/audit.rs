//! `bench audit` on a generated corridor whose faults are known, because they were planted.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

/// A corridor at a size that SIFT can read.
const WORLD: &str =
    "world/corridor?places=40&camera.width=240&camera.height=180&camera.focal=170.0";
const N: usize = 40;
/// Queries whose truth is moved this far along the corridor.
const SHIFTED: [usize; 4] = [3, 11, 24, 35];
const SHIFT: usize = 12;
/// Queries whose images change places.
const SWAPPED: (usize, usize) = (7, 29);
/// References of which there is a copy.
const COPIED: [usize; 3] = [2, 18, 33];

fn bench(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bench"));
    command.env("VPR_CACHE", cache()).current_dir(folder).args(arguments);
    command.env_remove("VPR_DATA").output().unwrap()
}

fn cache() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("bench-audit-corridor")
}

fn success(output: &Output) -> String {
    let stderr = String::from_utf8(output.stderr.clone()).unwrap();
    assert_eq!(output.status.code(), Some(0), "{stderr}");
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// Where the images of the corridor are, once `bench` has rendered it.
fn rendered() -> PathBuf {
    let folder = tempfile::tempdir().unwrap();
    success(&bench(folder.path(), &["evaluate", "--dataset", WORLD]));
    let entries = fs::read_dir(cache()).unwrap().map(|it| it.unwrap().path());
    entries.into_iter().find(|it| it.join("world.json").is_file()).unwrap()
}

fn name(index: usize) -> String {
    format!("{index:07}.jpg")
}

/// The corridor in two folders with a truth of names; planted or as it is.
fn dataset(planted: bool) -> tempfile::TempDir {
    let (world, folder) = (rendered(), tempfile::tempdir().unwrap());
    let at = |path: &str| folder.path().join(path);
    fs::create_dir_all(at("queries")).unwrap();
    fs::create_dir_all(at("database")).unwrap();
    let mut pairs = "query,reference\n".to_owned();
    for index in 0..N {
        let shown = match index {
            it if planted && it == SWAPPED.0 => SWAPPED.1,
            it if planted && it == SWAPPED.1 => SWAPPED.0,
            it => it,
        };
        let copy = |from: PathBuf, to: PathBuf| fs::copy(from, to).unwrap();
        copy(world.join("query").join(name(shown)), at("queries").join(name(index)));
        copy(world.join("ref").join(name(index)), at("database").join(name(index)));
        if planted && COPIED.contains(&index) {
            let path = at("database").join(format!("copy-of-{}", name(index)));
            copy(world.join("ref").join(name(index)), path);
        }
        let place = if planted && SHIFTED.contains(&index) { (index + SHIFT) % N } else { index };
        for reference in place.saturating_sub(1)..=(place + 1).min(N - 1) {
            let mut named = vec![name(reference)];
            if planted && COPIED.contains(&reference) {
                named.push(format!("copy-of-{}", name(reference)));
            }
            let line = |it: String| format!("queries/{},database/{it}\n", name(index));
            pairs.extend(named.into_iter().map(line));
        }
    }
    fs::write(at("pairs.csv"), pairs).unwrap();
    folder
}

fn audit(folder: &Path) -> (String, BTreeSet<(String, String, String)>) {
    let flags = [
        "audit",
        "hog",
        "--database-folder",
        "database",
        "--queries-folder",
        "queries",
        "--ground-truth",
        "pairs.csv",
        "--findings",
        "findings.csv",
    ];
    let text = success(&bench(folder, &flags));
    let findings = fs::read_to_string(folder.join("findings.csv")).unwrap();
    let finding = |line: &str| {
        let fields: Vec<&str> = line.split(',').collect();
        (fields[0].to_owned(), fields[1].to_owned(), fields[2].to_owned())
    };
    (text, findings.lines().skip(1).map(finding).collect())
}

/// File names of the queries or references of one kind of finding.
fn of_kind(all: &BTreeSet<(String, String, String)>, kind: &str, query: bool) -> BTreeSet<String> {
    let side = |it: &(String, String, String)| if query { it.1.clone() } else { it.2.clone() };
    let file = |path: String| path.rsplit('/').next().unwrap_or_default().to_owned();
    all.iter().filter(|it| it.0 == kind).map(|it| file(side(it))).collect()
}

#[test]
fn planted_faults_are_found_and_little_else() {
    let folder = dataset(true);
    let (text, findings) = audit(folder.path());
    let planted: BTreeSet<String> =
        SHIFTED.into_iter().chain([SWAPPED.0, SWAPPED.1]).map(name).collect();
    let suspects = of_kind(&findings, "looks right", true);
    let found = suspects.intersection(&planted).count();
    // Recall 1, precision 6/7 or better.
    assert_eq!(found, planted.len(), "{text}");
    assert!(suspects.len() <= planted.len() + 1, "{text}");
    // Each copy beside its original, and nothing else.
    let copies: BTreeSet<String> =
        COPIED.iter().flat_map(|&it| [name(it), format!("copy-of-{}", name(it))]).collect();
    assert_eq!(of_kind(&findings, "duplicate", false), copies, "{text}");
}

#[test]
fn a_sound_truth_is_not_accused() {
    let folder = dataset(false);
    let (text, findings) = audit(folder.path());
    assert!(of_kind(&findings, "looks right", true).len() <= 1, "{text}");
    assert!(of_kind(&findings, "duplicate", false).is_empty(), "{text}");
    assert!(of_kind(&findings, "no positive", true).is_empty(), "{text}");
    assert!(text.contains("queries without a correct reference: 0"), "{text}");
}
