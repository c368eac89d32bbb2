//! Whatever happens to a render, later runs trust complete worlds only.
#![cfg(all(feature = "cli", unix))]
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    thread::sleep,
    time::{Duration, Instant},
};

const WORLD: [&str; 10] = [
    "render",
    "world/campus",
    "--set",
    "places=8",
    "--set",
    "camera.width=96",
    "--set",
    "camera.height=72",
    "--set",
    "depth=true",
];

fn render(cache: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_worlds"));
    command.args(WORLD).arg("--cache").arg(cache).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// The stamp of the world that a render prints.
fn stamp(cache: &Path) -> String {
    let output = render(cache).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let folder = String::from_utf8(output.stdout).unwrap();
    fs::read_to_string(Path::new(folder.trim()).join("world.json")).unwrap()
}

fn folders(cache: &Path) -> Vec<String> {
    let entries = fs::read_dir(cache).unwrap();
    entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect()
}

/// The folder of a render that is not finished.
fn partial(cache: &Path) -> Option<PathBuf> {
    let paths = fs::read_dir(cache).into_iter().flatten().map(|entry| entry.unwrap().path());
    let name = |path: &Path| path.file_name().unwrap().to_string_lossy().into_owned();
    paths.filter(|path| path.is_dir()).find(|path| name(path).starts_with(".partial-"))
}

/// A render that has begun to write, and its folder; it goes on for long.
#[expect(clippy::zombie_processes, reason = "a test that fails leaves its child to the system")]
fn begun(cache: &Path) -> (Child, PathBuf) {
    let child = render(cache).args(["--set", "places=400"]).spawn().unwrap();
    let limit = Instant::now() + Duration::from_mins(1);
    loop {
        assert!(Instant::now() < limit, "nothing was written");
        if let Some(folder) = partial(cache)
            && folder.join("ref").is_dir()
        {
            return (child, folder);
        }
        sleep(Duration::from_millis(5));
    }
}

#[test]
fn what_a_killed_render_leaves_is_removed_by_the_next_of_any_world() {
    let cache = tempfile::tempdir().unwrap();
    let (mut child, left) = begun(cache.path());
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(left.is_dir());
    // Another world: it has fewer places.
    stamp(cache.path());
    assert!(!left.exists());
    assert_eq!(folders(cache.path()).len(), 1, "{:?}", folders(cache.path()));
}

#[test]
fn what_a_living_render_holds_is_left_to_it() {
    let cache = tempfile::tempdir().unwrap();
    let (mut child, held) = begun(cache.path());
    // Stopped, it cannot finish meanwhile; it lives all the same.
    let signal = |name: &str| {
        let status = Command::new("kill").args([name, &child.id().to_string()]).status();
        assert!(status.unwrap().success());
    };
    signal("-STOP");
    stamp(cache.path());
    let is_left = held.join("ref").is_dir();
    signal("-CONT");
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(is_left);
}

#[test]
fn a_render_killed_at_any_moment_leaves_nothing_that_is_trusted() {
    let clean = tempfile::tempdir().unwrap();
    let begun = Instant::now();
    let expected = stamp(clean.path());
    let whole = begun.elapsed();
    let mut n_killed = 0;
    for moment in 0..12 {
        let cache = tempfile::tempdir().unwrap();
        let mut child = render(cache.path()).spawn().unwrap();
        // From the first to the last moment, the later ones during and after the renaming.
        sleep(whole * moment / 10);
        child.kill().unwrap();
        n_killed += usize::from(!child.wait().unwrap().success());
        for name in folders(cache.path()) {
            let is_partial = name.starts_with(".partial-");
            assert!(is_partial || cache.path().join(&name).join("world.json").exists(), "{name}");
        }
        assert_eq!(stamp(cache.path()), expected, "killed after {moment} tenths");
        assert_eq!(partial(cache.path()), None, "killed after {moment} tenths");
    }
    assert!(n_killed >= 3, "only {n_killed} of 12 renders were killed in time");
}

#[test]
fn a_full_disk_is_an_error_that_names_the_file_and_leaves_no_world() {
    let cache = tempfile::tempdir().unwrap();
    // Files end after two blocks of 1024 bytes, as on a disk that is full.
    let script = "trap '' XFSZ; ulimit -f 2; exec \"$0\" \"$@\"";
    let mut command = Command::new("bash");
    command.args(["-c", script, env!("CARGO_BIN_EXE_worlds")]).args(WORLD);
    let output = command.arg("--cache").arg(cache.path()).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains(".jpg") || message.contains(".png"), "{message}");
    assert!(output.stdout.is_empty());
    assert!(folders(cache.path()).is_empty(), "{:?}", folders(cache.path()));
    assert!(stamp(cache.path()).contains("generated"));
}

#[test]
fn what_a_killed_render_left_long_ago_is_removed() {
    let cache = tempfile::tempdir().unwrap();
    let old = cache.path().join(".partial-old");
    fs::create_dir(&old).unwrap();
    let now = std::time::SystemTime::now();
    let day_before_yesterday = now - Duration::from_hours(48);
    fs::File::open(&old).unwrap().set_modified(day_before_yesterday).unwrap();
    let recent = cache.path().join(".partial-recent");
    fs::create_dir(&recent).unwrap();
    stamp(cache.path());
    assert!(!old.exists() && recent.exists());
}
