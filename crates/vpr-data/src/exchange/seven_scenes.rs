//! A 7-Scenes sequence: `frame-XXXXXX.pose.txt`, a 4×4 camera-to-world matrix in metres per frame.

use std::{collections::HashMap, ffi::OsString, fmt::Write as _, fs, path::Path};

use super::{
    convention::{pose_from_rows, rows_of_pose},
    parts::Parts,
    report::{Read, Report, content_lines, numbers, read_text},
};
use vpr_core::{Error, Pose, Poses, Result, map::Names};
use vpr_files::replace;

const POSE: &str = ".pose.txt";
const IMAGE: &str = ".color.png";

/// Frames in the order of their names; an image is called after its frame, `frame-000000.color.png`.
pub(super) fn read(folder: &Path) -> Read<Parts> {
    let entries = fs::read_dir(folder).map_err(|source| vec![Error::io(folder)(source)])?;
    let names = entries.map(|entry| entry.map(|entry| entry.file_name()));
    let names: Vec<OsString> =
        names.collect::<Result<_, _>>().map_err(|source| vec![Error::io(folder)(source)])?;
    let names = names.iter().filter_map(|name| name.to_str());
    let mut frames: Vec<String> =
        names.filter_map(|name| name.strip_suffix(POSE).map(str::to_owned)).collect();
    frames.sort();
    let mut report = Report::new(folder);
    if frames.is_empty() {
        report.file(format!("has no file that ends in `{POSE}`"));
    }
    let (mut names, mut poses) = (Names::default(), Vec::new());
    for frame in frames {
        match read_pose(&folder.join(format!("{frame}{POSE}"))) {
            Ok(pose) => {
                names.push(&format!("{frame}{IMAGE}"));
                poses.push(pose);
            }
            Err(problems) => report.errors(problems),
        }
    }
    let poses = Some(Poses::SixDof(poses));
    report.finish(Parts { names: Some(names), poses, ..Parts::default() })
}

fn read_pose(path: &Path) -> Read<Pose> {
    let text = read_text(path)?;
    let wrong = |reason: String| vec![Error::format(path, "matrix", reason)];
    let fields = content_lines(&text).flat_map(|(_, line)| line.split_whitespace());
    let rows = numbers::<16>(fields).map_err(wrong)?;
    let (Some(top), [.., 0.0, 0.0, 0.0, 1.0]) = (rows.first_chunk::<12>(), rows) else {
        return Err(wrong("does not end in the row 0 0 0 1".to_owned()));
    };
    pose_from_rows(top).map_err(wrong)
}

/// Whether all names are those of frames.
pub(super) fn are_frames(names: &Names) -> bool {
    names.iter().all(|name| frame_of(name).is_some())
}

fn frame_of(name: &str) -> Option<&str> {
    name.strip_suffix(IMAGE).filter(|name| !name.contains(['/', '\\']))
}

/// Writes one pose file per image; an image that is not called like a frame gets a number.
pub(super) fn write(folder: &Path, parts: &Parts) -> Result<()> {
    let poses = parts.six_dof()?;
    fs::create_dir_all(folder).map_err(Error::io(folder))?;
    let frame = |row: usize| {
        let name = parts.name(row);
        frame_of(&name).map_or_else(|| format!("frame-{row:06}"), str::to_owned)
    };
    let mut row_of = HashMap::new();
    for row in 0..poses.len() {
        if let Some(first) = row_of.insert(frame(row), row) {
            let place = format!("name `{}`", vpr_files::shorten(&parts.name(row)));
            let reason = format!("is the frame of two images, in rows {first} and {row}");
            return Err(Error::format(folder, place, reason));
        }
    }
    for (row, pose) in poses.iter().enumerate() {
        let mut text = String::new();
        for row in rows_of_pose(pose).as_chunks::<4>().0 {
            let _ = writeln!(text, "{} {} {} {}", row[0], row[1], row[2], row[3]);
        }
        text.push_str("0 0 0 1\n");
        replace(&folder.join(frame(row) + POSE), text.as_bytes())?;
    }
    Ok(())
}
