//! What is written is read: tests of an open map file.

use std::fs;

use ndarray::array;

use super::*;
use crate::{
    PlanarPosition, Pose, Poses,
    knn::{RowSource as _, SearchParams, search},
    map::{MapWriter, Names},
};

fn write(path: &Path, row_type: RowType, n: usize) -> Map {
    let descriptors = Array2::from_shape_fn((n, 5), |(row, column)| {
        f32::from(u16::try_from(row * 31 + column * 7).unwrap()).sin()
    });
    let poses = (0..n).map(|row| {
        let angle = row as f64 * 0.1;
        Pose::new([row as f64, 2.0, -1.5].into(), [0.1, angle, 0.3].into())
    });
    let map = Map::new(Descriptors::new(descriptors).unwrap(), Poses::SixDof(poses.collect()));
    let map = map.unwrap();
    let names: Names = (0..n).map(|row| format!("frame-{row:06}.png")).collect();
    let mut writer = MapWriter::create(path, 5, row_type, About::default()).unwrap();
    writer.append(map.descriptors().view(), Some(map.poses()), Some(&names)).unwrap();
    writer.finish().unwrap();
    map
}

#[test]
fn what_is_written_is_read_bit_by_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.safetensors");
    let map = write(&path, RowType::F32, 100);
    for access in [Access::Mapped, Access::Read] {
        let file = MapFile::open_with(&path, Opening { access, trust: false }).unwrap();
        assert_eq!(file.to_map().unwrap(), map);
        assert_eq!(file.names().unwrap().unwrap().get(99), Some("frame-000099.png"));
        assert_eq!(file.rows_in_place(0..1).unwrap().is_some(), access == Access::Mapped);
    }
}

#[test]
fn smaller_rows_stay_close() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.safetensors");
    for (row_type, tolerance) in [(RowType::F16, 1.0 / 2048.0), (RowType::I8, 0.5001 / 127.0)] {
        let map = write(&path, row_type, 33);
        let stored = MapFile::open(&path).unwrap().descriptors().unwrap();
        for (stored, exact) in stored.view().iter().zip(map.descriptors().view()) {
            assert!((stored - exact).abs() <= tolerance, "{row_type}: {exact} became {stored}");
        }
    }
}

#[test]
fn damage_is_found_when_it_is_touched_unless_trusted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.safetensors");
    write(&path, RowType::F32, 100);
    let mut bytes = fs::read(&path).unwrap();
    bytes[layout::ALIGNMENT + 70] ^= 1;
    fs::write(&path, &bytes).unwrap();
    let err = MapFile::open(&path).unwrap().descriptors().unwrap_err().to_string();
    assert!(err.contains("descriptors, rows 0..100: the bytes do not have the digest"), "{err}");
    let opening = Opening { trust: true, ..Opening::default() };
    MapFile::open_with(&path, opening).unwrap().descriptors().unwrap();
}

/// Ten rows of 256 KiB: a block with a digest has four.
fn write_wide(path: &Path) -> Descriptors {
    let value = |(row, column): (usize, usize)| ((row * 7 + column * 3) % 101) as f32;
    let rows = Array2::from_shape_fn((10, 65_536), value);
    let mut writer = MapWriter::create(path, 65_536, RowType::F32, About::default()).unwrap();
    writer.append(rows.view(), None, None).unwrap();
    writer.finish().unwrap();
    Descriptors::new(rows).unwrap()
}

#[test]
fn a_block_is_read_as_a_whole_until_it_has_been_checked() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.safetensors");
    let rows = write_wide(&path);
    let params = SearchParams { k: 10, block_rows: Some(3), ..SearchParams::default() };
    let expected = search(&rows, &rows, &params).unwrap();
    for access in [Access::Mapped, Access::Read] {
        let file = MapFile::open_with(&path, Opening { access, trust: false }).unwrap();
        assert_eq!([0, 5, 8].map(|start| file.piece_end(start, 1)), [4, 8, 10]);
        assert_eq!(search(&file, &rows, &params).unwrap(), expected);
        assert_eq!([0, 5, 8].map(|start| file.piece_end(start, 3)), [3, 8, 10]);
        let trusted = MapFile::open_with(&path, Opening { access, trust: true }).unwrap();
        assert_eq!(trusted.piece_end(5, 1), 6);
        assert_eq!(search(&trusted, &rows, &params).unwrap(), expected);
    }
}

#[test]
fn a_search_finds_damage_in_any_block_it_reads() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.safetensors");
    let rows = write_wide(&path);
    let mut bytes = fs::read(&path).unwrap();
    bytes[layout::ALIGNMENT + 5 * 262_144 + 3] ^= 1;
    fs::write(&path, &bytes).unwrap();
    for access in [Access::Mapped, Access::Read] {
        let file = MapFile::open_with(&path, Opening { access, trust: false }).unwrap();
        let err = search(&file, &rows, &SearchParams::default()).unwrap_err().to_string();
        assert!(err.contains("descriptors, rows 4..8: the bytes do not have"), "{err}");
    }
}

#[test]
fn an_open_map_stays_when_the_file_is_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.safetensors");
    let old = write(&path, RowType::F32, 10);
    let file = MapFile::open(&path).unwrap();
    write(&path, RowType::F32, 20);
    assert_eq!(file.to_map().unwrap(), old);
    assert_eq!(MapFile::open(&path).unwrap().len(), 20);
}

#[test]
fn descriptors_alone_are_a_map_file_without_poses() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.safetensors");
    let mut writer = MapWriter::create(&path, 2, RowType::F32, About::default()).unwrap();
    writer.append(array![[1.0, 2.0]].view(), None, None).unwrap();
    let poses = Poses::Planar(vec![PlanarPosition::origin()]);
    let err = writer.append(array![[1.0, 2.0]].view(), Some(&poses), None).unwrap_err();
    assert!(matches!(err, Error::Mismatch { .. }), "{err}");
    writer.finish().unwrap();
    let file = MapFile::open(&path).unwrap();
    assert_eq!((file.poses().unwrap(), file.names().unwrap()), (None, None));
    assert!(matches!(file.to_map(), Err(Error::PoseKind { .. })));
}
