//! 7-Scenes: `seq-NN/frame-NNNNNN.{color.png,pose.txt}`, the sequences of the map named in
//! `TrainSplit.txt`, those of the queries in `TestSplit.txt`.

use std::{
    fs,
    path::{Path, PathBuf},
};

use super::vpr_bench::is_image;
use crate::exchange::{self, Format};
use vpr_core::{Error, Poses, Result};

/// The images of one side, in the order of their names, with full poses, metres.
#[derive(Clone, Debug, PartialEq)]
pub struct Side {
    /// The images.
    pub images: Vec<PathBuf>,
    /// `world_from_camera`, six degrees of freedom.
    pub poses: Poses,
}

/// Queries and references of a scene.
///
/// A folder with one sequence and without split files is cut in half: the first half is the map,
/// the second the queries.
///
/// # Errors
///
/// [`Error::Io`] or [`Error::Format`] with the folder or file that is missing or malformed.
pub fn open(folder: &Path) -> Result<(Side, Side)> {
    let splits = (folder.join("TestSplit.txt"), folder.join("TrainSplit.txt"));
    if splits.0.exists() && splits.1.exists() {
        return Ok((of_split(folder, &splits.0)?, of_split(folder, &splits.1)?));
    }
    let entries = fs::read_dir(folder).map_err(Error::io(folder))?.flatten();
    let is_sequence = |name: &str| name.starts_with("seq-");
    let mut sequences = entries
        .filter(|entry| entry.file_name().to_str().is_some_and(is_sequence))
        .map(|entry| entry.path());
    match (sequences.next(), sequences.next()) {
        (Some(only), None) => {
            let whole = sequence(&only)?;
            let half = whole.images.len().div_ceil(2);
            Ok((whole.part(half..whole.images.len()), whole.part(0..half)))
        }
        (None, _) => Err(Error::format(folder, "sequences", "has no folder `seq-NN`")),
        (Some(_), Some(_)) => {
            let reason = "has several sequences, but no TrainSplit.txt and TestSplit.txt";
            Err(Error::format(folder, "sequences", reason))
        }
    }
}

impl Side {
    fn part(&self, range: std::ops::Range<usize>) -> Self {
        let poses = match &self.poses {
            Poses::Planar(poses) => Poses::Planar(poses[range.clone()].to_vec()),
            Poses::Spatial(poses) => Poses::Spatial(poses[range.clone()].to_vec()),
            Poses::SixDof(poses) => Poses::SixDof(poses[range.clone()].to_vec()),
        };
        Self { images: self.images[range].to_vec(), poses }
    }
}

/// The sequences that a split file names, one a line, as `sequence3`.
fn of_split(folder: &Path, split: &Path) -> Result<Side> {
    let text = fs::read_to_string(split).map_err(Error::io(split))?;
    let mut side: Option<Side> = None;
    for (index, line) in text.lines().map(str::trim).enumerate().filter(|(_, it)| !it.is_empty()) {
        let number = line.strip_prefix("sequence").and_then(|number| number.parse::<u32>().ok());
        let Some(number) = number else {
            let reason = "is not `sequence` and a number";
            return Err(Error::format(split, format!("line {}", index + 1), reason));
        };
        let more = sequence(&folder.join(format!("seq-{number:02}")))?;
        match &mut side {
            None => side = Some(more),
            Some(side) => {
                side.images.extend(more.images);
                side.poses.extend(&more.poses)?;
            }
        }
    }
    side.ok_or_else(|| Error::format(split, "sequences", "names none"))
}

/// The frames of one sequence, each with an image beside its pose.
fn sequence(folder: &Path) -> Result<Side> {
    let parts = exchange::read(Format::SevenScenes, folder)?;
    let (Some(names), Some(poses)) = (parts.names, parts.poses) else {
        return Err(Error::format(folder, "frames", "has no poses"));
    };
    let image = |name: &str| {
        let stem = name.strip_suffix("png").unwrap_or(name);
        let known =
            ["png", "jpg", "jpeg"].map(|extension| folder.join(format!("{stem}{extension}")));
        known.into_iter().find(|path| is_image(path) && path.is_file()).ok_or_else(|| {
            let reason = "has a pose, but no image";
            Error::format(folder, stem.trim_end_matches('.'), reason)
        })
    };
    let images = names.iter().map(image).collect::<Result<_>>()?;
    Ok(Side { images, poses })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sequence of frames along x.
    fn write(folder: &Path, name: &str, xs: std::ops::Range<usize>) {
        let folder = folder.join(name);
        fs::create_dir(&folder).unwrap();
        for (frame, x) in xs.enumerate() {
            let text = format!("1 0 0 {x}\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
            fs::write(folder.join(format!("frame-{frame:06}.pose.txt")), text).unwrap();
            fs::write(folder.join(format!("frame-{frame:06}.color.jpg")), "").unwrap();
        }
    }

    fn xs(side: &Side) -> Vec<f64> {
        (0..side.poses.len()).map(|row| side.poses.position(row).x).collect()
    }

    #[test]
    fn one_sequence_is_cut_in_half() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), "seq-01", 0..5);
        let (queries, references) = open(folder.path()).unwrap();
        assert_eq!((xs(&queries), xs(&references)), (vec![3.0, 4.0], vec![0.0, 1.0, 2.0]));
        assert!(queries.images[0].ends_with("seq-01/frame-000003.color.jpg"));
        fs::remove_file(&queries.images[0]).unwrap();
        let err = open(folder.path()).unwrap_err().to_string();
        assert!(err.contains("frame-000003.color: has a pose, but no image"), "{err}");
    }

    #[test]
    fn split_files_say_which_sequence_is_which() {
        let folder = tempfile::tempdir().unwrap();
        for (name, range) in [("seq-01", 0..2), ("seq-02", 2..3), ("seq-03", 3..4)] {
            write(folder.path(), name, range);
        }
        assert!(open(folder.path()).unwrap_err().to_string().contains("several sequences"));
        fs::write(folder.path().join("TrainSplit.txt"), "sequence3\nsequence1\n").unwrap();
        fs::write(folder.path().join("TestSplit.txt"), "sequence2\n").unwrap();
        let (queries, references) = open(folder.path()).unwrap();
        assert_eq!((xs(&queries), xs(&references)), (vec![2.0], vec![3.0, 0.0, 1.0]));
        fs::write(folder.path().join("TestSplit.txt"), "sequence2\nseq4\n").unwrap();
        assert!(open(folder.path()).unwrap_err().to_string().contains("line 2"));
    }
}
