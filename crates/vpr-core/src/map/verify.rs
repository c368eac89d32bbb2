//! Everything that is wrong with a map on disk, not only the first thing.

use std::{collections::HashMap, path::Path};

use super::{
    Access, MapFile, Names, Opening, digest::image_list_digest, file::Strictness, layout,
    segments::Manifest,
};
use crate::{Error, Poses, Result};

/// So many rows of one kind are named; the rest is counted.
const MOST_ROWS: usize = 1000;

/// Lists every problem of a map file, or of a folder that holds a growing map.
///
/// Reads every byte: header, shapes, digests of all blocks, finiteness of descriptors and poses,
/// lengths of quaternions, names (empty, twice, not those of the stored list), origins. An empty list means
/// that the map is sound. Of each kind of problem the first thousand rows are named.
#[must_use]
pub fn verify(path: &Path) -> Vec<Error> {
    let mut problems = Vec::new();
    if path.is_dir() {
        match Manifest::read(path) {
            Err(err) => problems.push(err),
            Ok(manifest) => {
                for segment in manifest.segments {
                    problems.extend(segment.open(path, Opening::default()).err());
                    verify_file(&path.join(&segment.file), &mut problems);
                }
                // A segment that cannot be opened has just been named twice.
                let mut seen = std::collections::HashSet::new();
                problems.retain(|problem| seen.insert(problem.to_string()));
            }
        }
    } else {
        verify_file(path, &mut problems);
    }
    problems
}

fn verify_file(path: &Path, problems: &mut Vec<Error>) {
    let opening = Opening { access: Access::Read, trust: true };
    let Some(file) = MapFile::open_as(path, opening, &mut Strictness::Report(problems)) else {
        return;
    };
    verify_descriptors(&file, problems);
    report(problems, file.check_scales());
    for tensor in [layout::PADDING, layout::POSITIONS, layout::ORIENTATIONS] {
        report(problems, file.check_tensor_digest(tensor));
    }
    if let Some(poses) = report(problems, file.poses_unchecked()).flatten() {
        verify_poses(path, &poses, problems);
    }
    if let Some(lengths) = report(problems, file.orientation_lengths()) {
        verify_lengths(path, &lengths, problems);
    }
    if let Some(names) = report(problems, file.names()).flatten() {
        verify_names(&file, &names, problems);
    }
    report(problems, file.origins());
}

/// Keeps the value, or the problem.
fn report<T>(problems: &mut Vec<Error>, result: Result<T>) -> Option<T> {
    result.map_err(|err| problems.push(err)).ok()
}

/// Adds the first thousand problems and says how many there are more.
fn add_rows(path: &Path, what: &str, rows: impl Iterator<Item = Error>, problems: &mut Vec<Error>) {
    let mut rows = rows.fuse();
    problems.extend(rows.by_ref().take(MOST_ROWS));
    let more = rows.count();
    if more > 0 {
        problems.push(Error::format(path, what, format!("{more} more rows like these")));
    }
}

fn verify_descriptors(file: &MapFile, problems: &mut Vec<Error>) {
    let (path, rows) = (file.path(), file.rows());
    for block in 0..rows.n_blocks() {
        let range = rows.block(block);
        report(problems, file.check_digest(block));
        let mut not_finite = Vec::new();
        let read = file.with_stored(range.clone(), |bytes, _| {
            for (row, bytes) in range.zip(bytes.chunks_exact(rows.row_bytes())) {
                if let Some(column) = rows.row_type.first_not_finite(bytes) {
                    let place = format!("descriptors, row {row}, column {column}");
                    not_finite.push(Error::format(path, place, "is not a finite number"));
                }
            }
            Ok(())
        });
        report(problems, read);
        add_rows(path, "descriptors", not_finite.into_iter(), problems);
    }
}

fn verify_poses(path: &Path, poses: &Poses, problems: &mut Vec<Error>) {
    let rows = (0..poses.len()).filter_map(|row| {
        let column = poses.first_not_finite(row)?;
        let place = format!("poses, row {row}, column {column}");
        Some(Error::format(path, place, "is not a finite number"))
    });
    add_rows(path, "poses", rows, problems);
}

fn verify_lengths(path: &Path, lengths: &[f64], problems: &mut Vec<Error>) {
    let wrong = lengths.iter().enumerate().filter(|(_, length)| (*length - 1.0).abs() > 1e-6);
    let rows = wrong.map(|(row, length)| {
        let reason = format!("is a quaternion of length {length}, not 1");
        Error::format(path, format!("orientations, row {row}"), reason)
    });
    add_rows(path, "orientations", rows, problems);
}

fn verify_names(file: &MapFile, names: &Names, problems: &mut Vec<Error>) {
    let path = file.path();
    let mut first_with = HashMap::new();
    let rows = names.iter().enumerate().filter_map(|(row, name)| {
        let reason = if name.is_empty() {
            "is empty".to_owned()
        } else {
            let first = *first_with.entry(name).or_insert(row);
            if first == row {
                return None;
            }
            format!("`{}` is also the name of row {first}", vpr_files::shorten(name))
        };
        Some(Error::format(path, format!("names, row {row}"), reason))
    });
    add_rows(path, "names", rows, problems);
    let stored = file.header().metadata.get(layout::IMAGE_LIST);
    let actual = image_list_digest(&names.iter().collect::<Vec<_>>());
    if stored.is_some_and(|stored| *stored != actual) {
        let place = format!("metadata `{}`", layout::IMAGE_LIST);
        problems.push(Error::format(path, place, "is not the digest of the names"));
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use ndarray::Array2;

    use super::*;
    use crate::{
        PlanarPosition,
        map::{About, GrowingMap, MapWriter, RowType},
    };

    fn write(path: &Path, names: &[&str]) {
        let n = names.len();
        let mut writer = MapWriter::create(path, 2, RowType::F32, About::default()).unwrap();
        let poses = Poses::Planar(vec![PlanarPosition::new(1.0, 2.0); n]);
        let names: Names = names.iter().collect();
        writer.append(Array2::ones((n, 2)).view(), Some(&poses), Some(&names)).unwrap();
        writer.finish().unwrap();
    }

    fn messages(path: &Path) -> Vec<String> {
        let prefix = format!("{}: ", path.display());
        verify(path).iter().map(|err| err.to_string().replace(&prefix, "")).collect()
    }

    #[test]
    fn a_sound_map_has_no_problem() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map.safetensors");
        write(&path, &["a", "b", "c"]);
        assert_eq!(messages(&path), [""; 0]);
    }

    #[test]
    fn every_problem_is_listed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map.safetensors");
        write(&path, &["a", "b", "a", ""]);
        let mut bytes = fs::read(&path).unwrap();
        let at = layout::ALIGNMENT;
        bytes[at + 8..at + 12].copy_from_slice(&f32::NAN.to_le_bytes());
        bytes[at + 28..at + 32].copy_from_slice(&f32::INFINITY.to_le_bytes());
        bytes[at + 32 + 8..at + 32 + 16].copy_from_slice(&f64::NAN.to_le_bytes());
        fs::write(&path, bytes).unwrap();
        let damaged = super::super::touch::damaged();
        assert_eq!(
            messages(&path),
            [
                format!("descriptors, rows 0..4: {damaged}"),
                "descriptors, row 1, column 0: is not a finite number".to_owned(),
                "descriptors, row 3, column 1: is not a finite number".to_owned(),
                format!("tensor `positions`, bytes 4128..4192: {damaged}"),
                "poses, row 0, column 1: is not a finite number".to_owned(),
                "names, row 2: `a` is also the name of row 0".to_owned(),
                "names, row 3: is empty".to_owned(),
            ]
        );
    }

    #[test]
    fn every_bit_of_a_map_is_covered() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map.safetensors");
        // Nine bytes of descriptors: there is padding, too.
        let mut writer = MapWriter::create(&path, 3, RowType::I8, About::default()).unwrap();
        let poses = Poses::Planar(vec![PlanarPosition::new(1.0, 2.0); 3]);
        let names: Names = ["a", "b", "c"].into_iter().collect();
        writer.append(Array2::ones((3, 3)).view(), Some(&poses), Some(&names)).unwrap();
        writer.finish().unwrap();
        let sound = fs::read(&path).unwrap();
        for byte in (0..sound.len()).filter(|byte| byte % 7 == 0 || *byte >= 4096) {
            let mut bytes = sound.clone();
            bytes[byte] ^= 1 << (byte % 8);
            fs::write(&path, bytes).unwrap();
            assert!(!verify(&path).is_empty(), "a flipped bit in byte {byte} went unnoticed");
        }
    }

    #[test]
    fn segments_are_checked_one_by_one() {
        let folder = tempfile::tempdir().unwrap();
        for _ in 0..3 {
            let mut map = GrowingMap::open(folder.path(), RowType::F32, About::default()).unwrap();
            map.append(Array2::ones((2, 2)).view(), None, None).unwrap();
        }
        assert_eq!(messages(folder.path()), [""; 0]);
        let damaged = folder.path().join("segment-000001.safetensors");
        let bytes = fs::read(&damaged).unwrap();
        fs::write(&damaged, &bytes[..bytes.len() - 1]).unwrap();
        fs::remove_file(folder.path().join("segment-000003.safetensors")).unwrap();
        assert_eq!(verify(folder.path()).len(), 2, "{:?}", verify(folder.path()));
    }
}
