//! Poses as CSV: `name,easting,northing`, `name,x,y,z` or `name,x,y,z,qw,qx,qy,qz`; read as any table.

use std::{fmt::Write as _, path::Path};

use super::{Reading, csv_field, held, parts::Parts, report::Read, table};
use vpr_core::{Poses, Result};
use vpr_files::replace;

/// Columns are found by their titles, see [`table`].
pub(super) fn read(path: &Path, reading: Reading) -> Read<Parts> {
    table::read(path, table::Prefer::Metres, reading)
}

pub(super) fn write(path: &Path, parts: &Parts) -> Result<()> {
    held::Names::Quoted.check_all(path, parts)?;
    let poses = parts.poses()?;
    let titles = match poses {
        Poses::Planar(_) => "name,easting,northing",
        Poses::Spatial(_) => "name,x,y,z",
        Poses::SixDof(_) => "name,x,y,z,qw,qx,qy,qz",
    };
    let mut text = format!("{titles}\n");
    for row in 0..poses.len() {
        let position = poses.position(row);
        let mut fields = vec![csv_field(&parts.name(row)).into_owned()];
        let width = if matches!(poses, Poses::Planar(_)) { 2 } else { 3 };
        fields.extend(position.iter().take(width).map(f64::to_string));
        if let Poses::SixDof(poses) = poses {
            let q = poses[row].rotation.quaternion();
            fields.extend([q.w, q.i, q.j, q.k].map(|value| value.to_string()));
        }
        let _ = writeln!(text, "{}", fields.join(","));
    }
    Ok(replace(path, text.as_bytes())?)
}
