//! Trajectories of the TUM RGB-D benchmark: `timestamp tx ty tz qx qy qz qw`, world from camera.

use std::{fmt::Write as _, path::Path};

use super::{
    Reading,
    convention::PoseConvention,
    parts::Parts,
    report::{Read, Report, content_lines, joined, number, numbers, read_text},
};
use vpr_core::{Poses, Result, map::Names};
use vpr_files::replace;

/// Names are the timestamps as they are written.
pub(super) fn read(path: &Path, reading: Reading) -> Read<Parts> {
    let convention = PoseConvention::TUM.directed(reading.direction);
    let text = read_text(path)?;
    let mut report = Report::new(path);
    let (mut names, mut poses) = (Names::default(), Vec::new());
    for (line, content) in content_lines(&text) {
        let (time, rest) = content.split_once(char::is_whitespace).unwrap_or((content, ""));
        let pose = number(time)
            .and_then(|_| numbers::<7>(rest.split_whitespace()))
            .and_then(|[x, y, z, i, j, k, w]| convention.pose([x, y, z], [i, j, k, w]));
        if let Some(pose) = report.keep(line, pose) {
            names.push(time);
            poses.push(pose);
        }
    }
    let poses = Some(Poses::SixDof(poses));
    report.finish(Parts { names: Some(names), poses, ..Parts::default() })
}

/// The names, if all are numbers and none stands twice.
pub(super) fn timestamps(parts: &Parts) -> Option<&Names> {
    let is_one = |names: &&Names| names.iter().all(|it| number(it).is_ok() && it.trim() == it);
    parts.names.as_ref().filter(|names| is_one(names) && names.repeated().is_none())
}

/// Names that are numbers are written as timestamps; if one is not, rows are counted instead.
pub(super) fn write(path: &Path, parts: &Parts) -> Result<()> {
    let poses = parts.six_dof()?;
    let named = timestamps(parts);
    let mut text = String::from("# timestamp tx ty tz qx qy qz qw\n");
    for (row, pose) in poses.iter().enumerate() {
        let (translation, xyzw) = PoseConvention::TUM.parts(pose);
        let (translation, xyzw) = (joined(&translation, " "), joined(&xyzw, " "));
        let time = named.and_then(|names| names.get(row)).map_or(row.to_string(), str::to_owned);
        let _ = writeln!(text, "{time} {translation} {xyzw}");
    }
    Ok(replace(path, text.as_bytes())?)
}
