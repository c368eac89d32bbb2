//! Writers killed at random moments: whoever opens the map sees the old one or the new one.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a test fails by panicking and says what it skips"
)]

use std::{
    env,
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use ndarray::Array2;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use vpr_core::{
    PlanarPosition, Poses,
    knn::RowSource as _,
    map::{About, GrowingMap, MapWriter, Names, OpenMap, Opening, RowType, verify},
};

/// Tells a copy of this program to be the writer, and where.
const WRITE_TO: &str = "VPR_TEST_WRITE_TO";
const APPEND_TO: &str = "VPR_TEST_APPEND_TO";

const DIM: usize = 64;
const ROWS: usize = 8192;
const SEGMENT_ROWS: usize = 512;
const KILLS: usize = 50;

/// Descriptors, poses and names that all say which version they are of.
fn content(n: usize, version: u16) -> (Array2<f32>, Poses, Names) {
    let descriptors = Array2::from_elem((n, DIM), f32::from(version));
    let position = |row: usize| PlanarPosition::new(row as f64, f64::from(version));
    let names = (0..n).map(|row| format!("{version}/{row}.jpg")).collect();
    (descriptors, Poses::Planar((0..n).map(position).collect()), names)
}

/// Not a test of its own: the process that is killed.
#[test]
fn writer_to_be_killed() {
    let first = |map: &OpenMap| map.descriptors().unwrap().view()[(map.len() - 1, 0)];
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small count")]
    let version =
        |path: &Path| OpenMap::open(path, Opening::default()).map_or(0, |map| first(&map) as u16);
    if let Some(path) = env::var_os(WRITE_TO).map(PathBuf::from) {
        for version in version(&path) + 1.. {
            let (descriptors, poses, names) = content(ROWS, version);
            let mut writer = MapWriter::create(&path, DIM, RowType::F32, About::default()).unwrap();
            writer.append(descriptors.view(), Some(&poses), Some(&names)).unwrap();
            writer.finish().unwrap();
        }
    }
    if let Some(folder) = env::var_os(APPEND_TO).map(PathBuf::from) {
        let mut map = GrowingMap::open(&folder, RowType::F32, About::default()).unwrap();
        for version in version(&folder) + 1.. {
            let (descriptors, poses, names) = content(SEGMENT_ROWS, version);
            map.append(descriptors.view(), Some(&poses), Some(&names)).unwrap();
        }
    }
}

/// Starts a writer.
fn start(variable: &str, path: &Path) -> Child {
    Command::new(env::current_exe().unwrap())
        .args(["--exact", "writer_to_be_killed"])
        .env(variable, path)
        .stdout(Stdio::null())
        .spawn()
        .unwrap()
}

fn kill(mut child: Child) {
    child.kill().unwrap();
    let status = child.wait().unwrap();
    assert_eq!(status.code(), None, "the writer ended by itself: {status}");
}

/// Runs a writer until it has written `file`; how long that took.
fn write_once(variable: &str, path: &Path, file: &Path) -> Duration {
    let start_time = Instant::now();
    let child = start(variable, path);
    while !file.exists() {
        assert!(start_time.elapsed() < Duration::from_mins(1), "nothing was written");
        thread::sleep(Duration::from_micros(200));
    }
    let duration = start_time.elapsed();
    kill(child);
    duration
}

/// Runs a writer and kills it at a random moment, up to three times as long as it takes to write.
fn kill_at_random(variable: &str, path: &Path, once: Duration, rng: &mut ChaCha8Rng) {
    let child = start(variable, path);
    thread::sleep(once.mul_f64(rng.random_range(0.1..3.0)));
    kill(child);
}

fn has_partial_files(folder: &Path) -> bool {
    let names = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
    names.into_iter().any(|name| name.to_string_lossy().ends_with(".partial"))
}

/// Every row of a sound map, checked: the versions of its pieces of `n` rows.
fn versions(path: &Path, n: usize) -> Vec<f32> {
    let problems = verify(path);
    assert!(problems.is_empty(), "{problems:?}");
    let map = OpenMap::open(path, Opening::default()).unwrap();
    let (poses, names) = (map.poses().unwrap().unwrap(), map.names().unwrap().unwrap());
    let mut scratch = Vec::new();
    let pieces = (0..map.len()).step_by(n).map(|start| {
        let rows = map.block(start..start + n, &mut scratch).unwrap();
        let version = rows[0];
        assert!(rows.iter().all(|&value| value == version), "a mixture of two maps");
        for row in start..start + n {
            assert_eq!(poses.position(row).y, f64::from(version));
            assert_eq!(names.get(row).unwrap(), format!("{version}/{}.jpg", row - start));
        }
        version
    });
    pieces.collect()
}

#[test]
fn fifty_kills_while_writing_leave_the_old_or_the_new_map() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.safetensors");
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let once = write_once(WRITE_TO, &path, &path);
    let (mut last, mut n_partial) = (1.0, 0);
    for _ in 0..KILLS {
        kill_at_random(WRITE_TO, &path, once, &mut rng);
        n_partial += usize::from(has_partial_files(folder.path()));
        let versions = versions(&path, ROWS);
        assert!(versions.len() == 1 && versions[0] >= last, "{versions:?} after {last}");
        last = versions[0];
    }
    eprintln!("{last} maps written, {n_partial} of {KILLS} kills in the middle of a file");
    assert!(last > 2.0 && n_partial > KILLS / 10, "the kills came at the wrong moments");
}

#[test]
fn fifty_kills_while_appending_leave_whole_segments() {
    let folder = tempfile::tempdir().unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let second = folder.path().join("segment-000002.safetensors");
    let once = write_once(APPEND_TO, folder.path(), &second);
    let (mut last, mut n_partial) = (1, 0);
    for _ in 0..KILLS {
        kill_at_random(APPEND_TO, folder.path(), once, &mut rng);
        n_partial += usize::from(has_partial_files(folder.path()));
        let versions = versions(folder.path(), SEGMENT_ROWS);
        let expected: Vec<f32> = (1..=versions.len()).map(|version| version as f32).collect();
        assert_eq!(versions, expected);
        assert!(versions.len() >= last, "segments were lost");
        last = versions.len();
    }
    eprintln!("{last} segments appended, {n_partial} of {KILLS} kills in the middle of a file");
    assert!(last > 2 && n_partial > KILLS / 10, "the kills came at the wrong moments");
}
