//! KITTI odometry poses: twelve numbers per line, the rows of a 3×4 world-from-camera matrix.

use std::{fmt::Write as _, path::Path};

use super::{
    convention::{pose_from_rows, rows_of_pose},
    parts::Parts,
    report::{Read, Report, content_lines, numbers, read_text},
};
use vpr_core::{Poses, Result};
use vpr_files::replace;

pub(super) fn read(path: &Path) -> Read<Parts> {
    let text = read_text(path)?;
    let mut report = Report::new(path);
    let mut poses = Vec::new();
    for (line, content) in content_lines(&text) {
        let pose = numbers::<12>(content.split_whitespace()).and_then(|rows| pose_from_rows(&rows));
        poses.extend(report.keep(line, pose));
    }
    report.finish(Parts { poses: Some(Poses::SixDof(poses)), ..Parts::default() })
}

pub(super) fn write(path: &Path, parts: &Parts) -> Result<()> {
    let mut text = String::new();
    for pose in parts.six_dof()? {
        let numbers = rows_of_pose(pose).map(|value| value.to_string());
        let _ = writeln!(text, "{}", numbers.join(" "));
    }
    Ok(replace(path, text.as_bytes())?)
}
