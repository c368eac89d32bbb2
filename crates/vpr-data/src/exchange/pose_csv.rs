//! Poses as CSV: `name,easting,northing`, `name,x,y,z` or `name,x,y,z,qw,qx,qy,qz`.

use std::path::Path;

use super::{parts::Parts, report::Read};
use crate::layout::pose_csv::PoseTable;
use vpr_core::{Error, Poses, Result};
use vpr_files::replace;

pub(super) fn read(path: &Path) -> Read<Parts> {
    let table = PoseTable::read(path).map_err(|err| vec![err])?;
    let names = Some(table.names.iter().collect());
    Ok(Parts { names, poses: Some(table.poses), ..Parts::default() })
}

pub(super) fn write(path: &Path, parts: &Parts) -> Result<()> {
    let mut out = csv::Writer::from_writer(Vec::new());
    let in_memory = |_: csv::Error| Error::Empty("room in memory");
    let poses = parts.poses()?;
    let titles: &[&str] = match poses {
        Poses::Planar(_) => &["name", "easting", "northing"],
        Poses::Spatial(_) => &["name", "x", "y", "z"],
        Poses::SixDof(_) => &["name", "x", "y", "z", "qw", "qx", "qy", "qz"],
    };
    out.write_record(titles).map_err(in_memory)?;
    for row in 0..poses.len() {
        let position = poses.position(row);
        let mut fields = vec![parts.name(row)];
        let width = if matches!(poses, Poses::Planar(_)) { 2 } else { 3 };
        fields.extend(position.iter().take(width).map(f64::to_string));
        if let Poses::SixDof(poses) = poses {
            let q = poses[row].rotation.quaternion();
            fields.extend([q.w, q.i, q.j, q.k].map(|value| value.to_string()));
        }
        out.write_record(fields).map_err(in_memory)?;
    }
    Ok(replace(path, &out.into_inner().unwrap_or_default())?)
}
