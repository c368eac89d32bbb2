//! Memory does not grow with the descriptors that are regressed. A program of its own, so that no other
//! test counts.

#![expect(clippy::print_stdout, reason = "a test says what it skips")]

use copr::{Anchors, LinearInterpolation, Options, Targets, densify, sequences};
use ndarray::Array2;
use vpr_core::{
    Descriptors, Map, Pose, Poses,
    map::{About, MapWriter, OpenMap, Opening, RowType},
};

const DIM: usize = 128;
/// Between every two of eleven anchors.
const BETWEEN: usize = 100_000;

/// The largest resident memory so far, bytes; `None` where the system does not say.
fn peak() -> Option<usize> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(1024 * line.trim().trim_end_matches(" kB").parse::<usize>().ok()?)
}

#[test]
fn a_million_rows_go_to_the_disk_as_they_come() {
    let Some(before) = peak() else {
        println!("skipped: the system does not say how much memory was used");
        return;
    };
    let poses: Vec<Pose> = (0..11).map(|at| Pose::translation(f64::from(at), 0.0, 0.0)).collect();
    let rows = Array2::from_shape_fn((11, DIM), |(row, column)| (row * DIM + column) as f32 / 1e3);
    let map = Map::new(Descriptors::new(rows).unwrap(), Poses::SixDof(poses.clone())).unwrap();
    let anchors = Anchors::every(&poses, &sequences(None, 11), 1).unwrap();
    let targets = Targets::between(&anchors, BETWEEN).unwrap();
    assert_eq!(targets.len(), 1_000_000);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("dense.safetensors");
    let mut writer = MapWriter::create(&path, DIM, RowType::F16, About::default()).unwrap();
    writer.append(map.descriptors().view(), Some(map.poses()), None).unwrap();
    densify(&map, &targets, &LinearInterpolation, Options::default(), false, &mut writer).unwrap();
    writer.finish().unwrap();
    let grown = peak().unwrap() - before;
    // As stored 256 MB, as regressed 512 MB. What is small per row may be held: pose and anchors.
    let stored = 2 * DIM * targets.len();
    assert!(grown < stored, "{grown} bytes for {stored} of descriptors");
    let dense = OpenMap::open(&path, Opening::default()).unwrap();
    assert_eq!(dense.len(), 1_000_011);
    assert!(std::fs::metadata(&path).unwrap().len() > stored as u64);
}
