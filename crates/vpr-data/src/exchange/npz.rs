//! NumPy's `.npz` with the arrays of a map: descriptors, positions, orientations, names.

use std::{
    io::{BufWriter, Write as _},
    path::Path,
};

use nalgebra::{Isometry3, Point2, Point3};
use ndarray::{Array1, Array2};

use super::{
    convention::{Direction, PoseConvention, QuaternionOrder},
    parts::Parts,
    report::Read,
};
use vpr_core::{Descriptors, Error, Poses, Result, map::Names};
use vpr_files::{NewFile, npy::npz};

/// Our own: wxyz, world from camera.
const OURS: PoseConvention =
    PoseConvention { order: QuaternionOrder::Wxyz, direction: Direction::WorldFromCamera };

/// `descriptors` must be there; `positions`, `orientations`, `names` and `name_offsets` may be.
pub(super) fn read(path: &Path) -> Read<Parts> {
    read_parts(path).map_err(|err| vec![err])
}

fn read_parts(path: &Path) -> Result<Parts> {
    let arrays = npz::names(path)?;
    let has = |name: &str| arrays.iter().any(|array| array == name);
    let descriptors: Array2<f32> = npz::read(path, "descriptors")?;
    let wrong = |name: &str, reason: String| Error::format(path, format!("array `{name}`"), reason);
    let mut parts = Parts { descriptors: Some(Descriptors::new(descriptors)?), ..Parts::default() };
    if has("positions") {
        let positions: Array2<f64> = npz::read(path, "positions")?;
        let orientations: Option<Array2<f64>> =
            has("orientations").then(|| npz::read(path, "orientations")).transpose()?;
        let poses = poses_of(&positions, orientations.as_ref());
        parts.poses = Some(poses.map_err(|(array, reason)| wrong(array, reason))?);
    }
    if has("names") && has("name_offsets") {
        let text: Array1<u8> = npz::read(path, "names")?;
        let offsets: Array1<i64> = npz::read(path, "name_offsets")?;
        let names = Names::from_parts(text.to_vec(), &offsets.to_vec());
        parts.names = Some(names.map_err(|reason| wrong("names", reason))?);
    }
    parts.check()?;
    Ok(parts)
}

/// The poses of an `n × 2` or `n × 3` array of positions and an `n × 4` one of quaternions wxyz.
pub(super) fn poses_of(
    positions: &Array2<f64>,
    orientations: Option<&Array2<f64>>,
) -> Result<Poses, (&'static str, String)> {
    let rows = positions.rows().into_iter();
    let poses = match (positions.ncols(), orientations) {
        (2, None) => Poses::Planar(rows.map(|row| Point2::new(row[0], row[1])).collect()),
        (3, None) => Poses::Spatial(rows.map(|row| Point3::new(row[0], row[1], row[2])).collect()),
        (3, Some(wxyz)) if wxyz.dim() == (positions.nrows(), 4) => {
            let both = rows.zip(wxyz.rows()).enumerate().map(|(index, (xyz, q))| {
                let pose = OURS.pose([xyz[0], xyz[1], xyz[2]], [q[0], q[1], q[2], q[3]]);
                pose.map_err(|reason| ("orientations", format!("row {index}: {reason}")))
            });
            Poses::SixDof(both.collect::<Result<Vec<Isometry3<f64>>, _>>()?)
        }
        (_, Some(wxyz)) => {
            return Err(("orientations", format!("has shape {:?}", wxyz.dim())));
        }
        (width, None) => return Err(("positions", format!("has {width} columns, not 2 or 3"))),
    };
    poses.check_finite().map_err(|err| ("positions", err.to_string()))?;
    Ok(poses)
}

/// Positions, row after row, how many columns they have, and quaternions wxyz.
pub(super) fn arrays_of(poses: &Poses) -> (Vec<f64>, usize, Option<Vec<f64>>) {
    let width = if matches!(poses, Poses::Planar(_)) { 2 } else { 3 };
    let positions = (0..poses.len()).flat_map(|row| {
        let position = poses.position(row);
        [position.x, position.y, position.z].into_iter().take(width)
    });
    let orientations = match poses {
        Poses::SixDof(poses) => Some(poses.iter().flat_map(|pose| OURS.parts(pose).1).collect()),
        _ => None,
    };
    (positions.collect(), width, orientations)
}

pub(super) fn write(path: &Path, parts: &Parts) -> Result<()> {
    parts.check()?;
    let descriptors = parts.descriptors()?;
    let mut new = NewFile::create(path)?;
    let io_error = new.io_error();
    let mut archive = npz::Writer::new(BufWriter::new(new.file()));
    let written = (|| {
        let (n, dim) = (descriptors.len(), descriptors.dim());
        let values = descriptors.view();
        archive.add("descriptors", "<f4", &[n, dim], values.iter().map(|it| it.to_le_bytes()))?;
        if let Some(poses) = &parts.poses {
            let (positions, width, orientations) = arrays_of(poses);
            let bytes = positions.iter().map(|it| it.to_le_bytes());
            archive.add("positions", "<f8", &[n, width], bytes)?;
            if let Some(wxyz) = orientations {
                let bytes = wxyz.iter().map(|it| it.to_le_bytes());
                archive.add("orientations", "<f8", &[n, 4], bytes)?;
            }
        }
        if let Some((text, offsets)) = parts.names.as_ref().map(Names::to_parts) {
            archive.add("names", "|u1", &[text.len()], text.bytes().map(|byte| [byte]))?;
            let bytes = offsets.iter().map(|it| it.to_le_bytes());
            archive.add("name_offsets", "<i8", &[offsets.len()], bytes)?;
        }
        archive.finish()?.flush()
    })();
    written.map_err(io_error)?;
    Ok(new.commit()?)
}
