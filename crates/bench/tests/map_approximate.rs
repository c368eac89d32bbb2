//! `bench map build --approximate` and `search --approximate`.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a test fails by panicking and says what it skips"
)]

use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

use ndarray::Array2;
use vpr_files::npy;

fn bench_map(folder: &Path, args: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bench"));
    command.current_dir(folder).arg("map").args(args.split_whitespace()).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// The output of a command that succeeds, and what it told people.
fn success(folder: &Path, args: &str) -> (String, String) {
    let output = bench_map(folder, args);
    assert_eq!(output.status.code(), Some(0), "{args}: {}", text(&output.stderr));
    (text(&output.stdout), text(&output.stderr))
}

/// A spiral of 300 references, and queries between them.
fn spiral(file: &Path, n: usize, shift: f32) {
    let value = |(row, column): (usize, usize)| {
        let turn = (row as f32 + shift) * 300.0 / n as f32 * 0.2;
        if column == 0 { turn } else { (turn * column as f32).sin() * 3.0 }
    };
    npy::write_f32(file, Array2::from_shape_fn((n, 6), value).view()).unwrap();
}

#[test]
fn the_graph_of_a_map_finds_its_neighbours_and_of_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    spiral(&folder.join("refs.npy"), 300, 0.0);
    spiral(&folder.join("queries.npy"), 30, 0.3);
    let (_, note) = success(folder, "build --descriptors refs.npy --approximate m.safetensors");
    assert!(note.contains("recall@10 1.0000, of 200 of the references"), "{note}");
    let kept = fs::read_to_string(folder.join("m.safetensors.hnsw.json")).unwrap();
    assert!(kept.contains("\"n_queries\": 200"), "{kept}");
    let search = "search m.safetensors --queries queries.npy -k 5";
    let (exact, _) = success(folder, search);
    let (approximate, note) = success(folder, &format!("{search} --approximate"));
    assert_eq!(approximate, exact);
    assert!(note.contains("recall@10 was 1.0000"), "{note}");
    let other = bench_map(folder, &format!("{search} --approximate --metric cosine"));
    assert_eq!(other.status.code(), Some(2));
    spiral(&folder.join("refs.npy"), 300, 0.5);
    success(folder, "build --descriptors refs.npy m.safetensors");
    let stale = bench_map(folder, &format!("{search} --approximate"));
    assert_eq!(stale.status.code(), Some(2));
    assert!(text(&stale.stderr).contains("is of another map"), "{}", text(&stale.stderr));
}

#[test]
fn a_growing_map_has_one_graph_of_all_its_segments() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    spiral(&folder.join("refs.npy"), 300, 0.0);
    spiral(&folder.join("more.npy"), 300, 0.5);
    success(folder, "build --descriptors refs.npy --append grown");
    success(folder, "build --descriptors more.npy --append --approximate grown/");
    let search = "search grown --queries more.npy -k 3";
    let (exact, _) = success(folder, search);
    assert_eq!(success(folder, &format!("{search} --approximate")).0, exact);
}
