//! NumPy's `.npy` with one descriptor per row, and poses and names as `.csv` beside it.

use std::path::{Path, PathBuf};

use super::{
    Beside, Reading,
    parts::Parts,
    pose_csv,
    report::{Read, first},
    rounded, table,
};
use vpr_core::{Descriptors, Error, Result};
use vpr_files::npy;

/// `descriptors.npy` has its poses in `descriptors.csv`, if that exists.
fn csv_of(path: &Path) -> PathBuf {
    path.with_extension("csv")
}

pub(super) fn read(path: &Path, reading: Reading) -> Read<Parts> {
    let parts = read_descriptors(path).map_err(|err| vec![err])?;
    let csv = csv_of(path);
    match beside(&csv, &parts, reading) {
        Ok(None) => Ok(parts),
        Ok(Some(beside)) => {
            let notes = [parts.notes, beside.notes].concat();
            Ok(Parts { descriptors: parts.descriptors, notes, ..beside })
        }
        Err(problems) if reading.beside == Beside::IfSound => {
            let note =
                format!("not used, though it lies beside {}: {}", path.display(), first(problems));
            Ok(Parts { notes: [parts.notes, vec![note]].concat(), ..parts })
        }
        Err(problems) => Err(problems),
    }
}

/// What a table beside descriptors says of them, if there is one that is asked for.
fn beside(csv: &Path, parts: &Parts, reading: Reading) -> Read<Option<Parts>> {
    if reading.beside == Beside::Ignored || !csv.is_file() {
        return Ok(None);
    }
    if !table::is_table(csv).map_err(|err| vec![err])? {
        let note = format!("{}: is no table of poses, and not used", csv.display());
        return Ok(Some(Parts { notes: vec![note], ..Parts::default() }));
    }
    let beside = pose_csv::read(csv, reading)?;
    let n = parts.descriptors.as_ref().map_or(0, Descriptors::len);
    match beside.poses.as_ref().map(vpr_core::Poses::len) {
        Some(n_poses) if n_poses != n => {
            let reason = format!("has {n_poses} poses for the {n} descriptors beside it");
            Err(vec![Error::format(csv, "rows", reason)])
        }
        _ => Ok(Some(beside)),
    }
}

/// A matrix of any numbers, as f32.
pub(super) fn read_descriptors(path: &Path) -> Result<Parts> {
    let (values, stored) = npy::read_f32_rounded(path)?;
    let notes = rounded::note(path, None, stored);
    let descriptors = Some(Descriptors::new(values)?);
    Ok(Parts { descriptors, notes: notes.into_iter().collect(), ..Parts::default() })
}

pub(super) fn write(path: &Path, parts: &Parts) -> Result<()> {
    let csv = csv_of(path);
    if parts.poses.is_some() && csv.exists() && !table::is_table(&csv)? {
        let reason = "is there and no table of poses: nothing is written in its place";
        return Err(Error::format(csv, "file", reason));
    }
    npy::write_f32(path, parts.descriptors()?.view())?;
    if parts.poses.is_some() { pose_csv::write(&csv, parts) } else { Ok(()) }
}
