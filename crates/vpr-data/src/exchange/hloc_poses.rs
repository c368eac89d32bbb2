//! Pose lists of COLMAP, hloc and the 7-Scenes pseudo ground truth: `name qw qx qy qz tx ty tz [f]`.

use std::{fmt::Write as _, path::Path};

use super::{
    convention::PoseConvention,
    held,
    parts::Parts,
    report::{Read, Report, content_lines, joined, numbers, read_text},
};
use vpr_core::{Poses, Result, map::Names};
use vpr_files::replace;

pub(super) fn read(path: &Path) -> Read<Parts> {
    let text = read_text(path)?;
    let mut report = Report::new(path);
    let (mut names, mut poses) = (Names::default(), Vec::new());
    for (line, content) in content_lines(&text) {
        let (name, rest) = content.split_once(char::is_whitespace).unwrap_or((content, ""));
        // A focal length may follow; it is no part of the pose.
        let fields: Vec<&str> = rest.split_whitespace().collect();
        let fields = if fields.len() == 8 { &fields[..7] } else { &fields[..] };
        let pose = numbers::<7>(fields.iter().copied())
            .and_then(|[w, i, j, k, x, y, z]| PoseConvention::HLOC.pose([x, y, z], [w, i, j, k]));
        if let Some(pose) = report.keep(line, pose) {
            names.push(name);
            poses.push(pose);
        }
    }
    let poses = Some(Poses::SixDof(poses));
    report.finish(Parts { names: Some(names), poses, ..Parts::default() })
}

pub(super) fn write(path: &Path, parts: &Parts) -> Result<()> {
    held::Names::Words.check_all(path, parts)?;
    let mut text = String::new();
    for (row, pose) in parts.six_dof()?.iter().enumerate() {
        let (translation, wxyz) = PoseConvention::HLOC.parts(pose);
        let (translation, wxyz) = (joined(&translation, " "), joined(&wxyz, " "));
        let _ = writeln!(text, "{} {wxyz} {translation}", parts.name(row));
    }
    Ok(replace(path, text.as_bytes())?)
}
