//! NumPy's `.npy` with one descriptor per row, and poses and names as `.csv` beside it.

use std::path::{Path, PathBuf};

use super::{parts::Parts, pose_csv, report::Read};
use vpr_core::{Descriptors, Result};
use vpr_files::npy;

/// `descriptors.npy` has its poses in `descriptors.csv`, if that exists.
fn csv_of(path: &Path) -> PathBuf {
    path.with_extension("csv")
}

pub(super) fn read(path: &Path) -> Read<Parts> {
    let descriptors = read_descriptors(path).map_err(|err| vec![err])?;
    let csv = csv_of(path);
    let poses = if csv.exists() { pose_csv::read(&csv)? } else { Parts::default() };
    let parts = Parts { descriptors: Some(descriptors), ..poses };
    parts.check().map_err(|err| vec![err])?;
    Ok(parts)
}

/// A matrix of f32, or one of f64 that is narrowed.
pub(super) fn read_descriptors(path: &Path) -> Result<Descriptors> {
    let values = npy::read_f32_rounded(path)?.0;
    Descriptors::new(values)
}

pub(super) fn write(path: &Path, parts: &Parts) -> Result<()> {
    npy::write_f32(path, parts.descriptors()?.view())?;
    if parts.poses.is_some() { pose_csv::write(&csv_of(path), parts) } else { Ok(()) }
}
