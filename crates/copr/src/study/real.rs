//! The published camera paths of 7-Scenes.

use std::{
    ops::Range,
    path::{Path, PathBuf},
};

use vpr_core::{Error as CoreError, Pose, Poses, map::Names};
use vpr_data::exchange::{self, Format};
use vpr_study::Sources;

use super::Scene;
use crate::{Result, sequences};

/// Where the lists lie in a data folder.
pub(super) const FOLDER: &str = "7scenes/poses";

/// Where one side of a scene was taken.
pub(super) struct Path6 {
    /// In the order of their names.
    pub(super) poses: Vec<Pose>,
    /// Sequences with their names.
    pub(super) sequences: Vec<(String, Range<usize>)>,
}

/// The two sides of a scene.
pub(super) struct RealScene {
    pub(super) queries: Path6,
    pub(super) references: Path6,
}

impl RealScene {
    /// `None` if the lists are not at hand.
    pub(super) fn open(scene: &Scene, sources: &Sources<'_>) -> Result<Option<Self>> {
        let list = |split: &str| {
            sources.locate(&Path::new(FOLDER).join(format!("{}_{split}.txt", scene.key)))
        };
        let (Some(queries), Some(references)) = (list("test")?, list("train")?) else {
            return Ok(None);
        };
        let scene = Self { queries: read(&queries)?, references: read(&references)? };
        Ok(Some(scene))
    }
}

impl Path6 {
    /// All poses.
    pub(super) fn all(&self) -> Poses {
        Poses::SixDof(self.poses.clone())
    }

    /// The poses of the sequence of this name.
    pub(super) fn sequence(&self, name: &str) -> Result<&[Pose]> {
        let found = self.sequences.iter().find(|it| it.0 == name);
        let (_, rows) = found.ok_or_else(|| {
            let known: Vec<&str> = self.sequences.iter().map(|it| it.0.as_str()).collect();
            let (name, known) = (name.to_owned(), known.join(", "));
            CoreError::Unknown { kind: "sequence", name, known }
        })?;
        Ok(&self.poses[rows.clone()])
    }
}

/// A list, its images in the order of their names.
fn read(path: &PathBuf) -> Result<Path6> {
    let parts = exchange::read(Format::HlocPoses, path)?;
    let none = || CoreError::Empty("poses").in_file(path);
    let (names, poses) = (parts.names.ok_or_else(none)?, parts.poses.ok_or_else(none)?);
    let mut rows: Vec<(&str, Pose)> = names.iter().zip(poses.six_dof()?.iter().copied()).collect();
    rows.sort_by(|a, b| a.0.cmp(b.0));
    let names: Names = rows.iter().map(|row| row.0).collect();
    let with_name = |rows: Range<usize>| {
        let name = names.get(rows.start).unwrap_or_default();
        (name.split('/').next().unwrap_or_default().to_owned(), rows)
    };
    let sequences = sequences(Some(&names), names.len()).into_iter().map(with_name).collect();
    Ok(Path6 { poses: rows.iter().map(|row| row.1).collect(), sequences })
}
