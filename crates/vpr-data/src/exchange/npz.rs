//! NumPy's `.npz` with the arrays of a map: descriptors, positions, orientations, names.

use std::{
    io::{BufWriter, Write as _},
    path::Path,
};

use nalgebra::{Isometry3, Point2, Point3};
use ndarray::{Array1, Array2};

use super::{convention::PoseConvention, parts::Parts, report::Read, rounded};
use vpr_core::{Descriptors, Error, Poses, Result, map::Names};
use vpr_files::{NewFile, npy::npz, shorten};

const DESCRIPTORS: &str = "descriptors";
const POSITIONS: &str = "positions";
const ORIENTATIONS: &str = "orientations";
const OFFSETS: &str = "name_offsets";
/// Arrays of names: ours, and what others call theirs.
const NAMES: [&str; 8] =
    ["names", "name", "image_names", "images", "filenames", "files", "paths", "keys"];
/// `NumPy`'s names of the types that may be texts.
const TEXTS: [&str; 3] = ["str", "bytes", "object"];

/// Descriptors are the array `descriptors`, or the only matrix of numbers, if there are any;
/// `positions`, `orientations` and names (texts, objects, or bytes with `name_offsets`) may be there.
pub(super) fn read(path: &Path) -> Read<Parts> {
    read_parts(path).map_err(|err| vec![err])
}

fn read_parts(path: &Path) -> Result<Parts> {
    let arrays = npz::names(path)?;
    let has = |name: &str| arrays.iter().any(|array| array == name);
    let wrong = |name: &str, reason: String| Error::format(path, format!("array `{name}`"), reason);
    let (mut parts, mut used) = (Parts::default(), Vec::new());
    if let Some(rows) = descriptors_in(path, &arrays)? {
        let (descriptors, stored) = npz::read_f32_rounded(path, &rows)?;
        parts.descriptors = Some(Descriptors::new(descriptors)?);
        parts.notes.extend(rounded::note(path, Some(&rows), stored));
        used.push(rows);
    }
    if has(POSITIONS) {
        let positions: Array2<f64> = npz::read(path, POSITIONS)?;
        let orientations: Option<Array2<f64>> =
            has(ORIENTATIONS).then(|| npz::read(path, ORIENTATIONS)).transpose()?;
        let poses = poses_of(&positions, orientations.as_ref());
        parts.poses = Some(poses.map_err(|(array, reason)| wrong(array, reason))?);
        used.extend([POSITIONS, ORIENTATIONS].map(str::to_owned));
    } else if has(ORIENTATIONS) {
        return Err(wrong(ORIENTATIONS, format!("is there, but no `{POSITIONS}`")));
    }
    match names_array(path, &arrays)? {
        Some(name) => {
            parts.names = Some(names_in(path, name, has(OFFSETS))?);
            used.extend([name, OFFSETS].map(str::to_owned));
        }
        None if has(OFFSETS) => {
            return Err(wrong(OFFSETS, "is there, but no `names`".to_owned()));
        }
        None => {}
    }
    let unused: Vec<&str> = arrays.iter().filter(|it| !used.contains(it)).map(|it| &**it).collect();
    if !unused.is_empty() {
        let unused = shorten(&unused.join(", "));
        parts.notes.push(format!("{}: arrays that are not used: {unused}", path.display()));
    }
    parts.check()?;
    Ok(parts)
}

/// The array of descriptors; `None` if there are only positions.
fn descriptors_in(path: &Path, arrays: &[String]) -> Result<Option<String>> {
    let has = |name: &str| arrays.iter().any(|array| array == name);
    if has(DESCRIPTORS) {
        return Ok(Some(DESCRIPTORS.to_owned()));
    }
    let mut matrices = Vec::new();
    for array in arrays.iter().filter(|it| ![POSITIONS, ORIENTATIONS].contains(&it.as_str())) {
        let (element, shape) = npz::describe(path, array)?;
        if shape.len() == 2 && element != "bool" && !TEXTS.contains(&element) {
            matrices.push(array.clone());
        }
    }
    let known = || shorten(&arrays.join(", "));
    let reason = match matrices.as_slice() {
        [one] => return Ok(Some(one.clone())),
        [] if has(POSITIONS) => return Ok(None),
        [] => format!("is not there, nor any matrix of numbers; known: {}", known()),
        _ => format!("is not there, but several matrices are: {}", shorten(&matrices.join(", "))),
    };
    Err(Error::format(path, format!("array `{DESCRIPTORS}`"), reason))
}

/// The array of names: `names`, whatever is in it, or texts under another title.
fn names_array(path: &Path, arrays: &[String]) -> Result<Option<&'static str>> {
    for name in NAMES.into_iter().filter(|name| arrays.iter().any(|array| array == name)) {
        if name == NAMES[0] || TEXTS.contains(&npz::describe(path, name)?.0) {
            return Ok(Some(name));
        }
    }
    Ok(None)
}

/// Names as texts, or as one text of bytes with offsets.
fn names_in(path: &Path, name: &str, has_offsets: bool) -> Result<Names> {
    let wrong = |reason: String| Error::format(path, format!("array `{name}`"), reason);
    match (npz::describe(path, name)?.0, has_offsets) {
        ("uint8", true) => {
            let text: Array1<u8> = npz::read(path, name)?;
            let offsets: Array1<i64> = npz::read(path, OFFSETS)?;
            Names::from_parts(text.to_vec(), &offsets.to_vec()).map_err(wrong)
        }
        ("uint8", false) => Err(wrong(format!("has bytes of names, but there is no `{OFFSETS}`"))),
        (texts, _) if TEXTS.contains(&texts) => {
            Ok(npz::read_texts(path, name)?.into_iter().collect())
        }
        (other, _) => Err(wrong(format!("has {other}, not names"))),
    }
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
                let pose =
                    PoseConvention::TABLE.pose([xyz[0], xyz[1], xyz[2]], [q[0], q[1], q[2], q[3]]);
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
        Poses::SixDof(poses) => {
            Some(poses.iter().flat_map(|pose| PoseConvention::TABLE.parts(pose).1).collect())
        }
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
