//! Images or rows of one side, with names and poses.

use std::path::{Path, PathBuf};

use vpr_core::{
    Descriptors, Error, Poses,
    map::{Coordinates, Names},
};
use vpr_data::{
    exchange::{Beside, Parts, Side, comparable},
    layout::{folder::Listing, numbered::images_in_order, utm_names::UtmFolder},
};
use vpr_report::cli;
use vpr_study::reading::{PoseArgs, ReadingArgs};

/// Images of one side by name, with their poses if known.
pub(super) struct Named {
    pub(super) names: Vec<PathBuf>,
    pub(super) poses: Option<Poses>,
    /// What the numbers of the poses mean, if that is said.
    pub(super) coordinates: Option<Coordinates>,
    /// Where the poses are from.
    pub(super) place: PathBuf,
}

impl Named {
    /// Images of a folder: with the poses of a file by their names, with those in their `@` names,
    /// or in order of their numbers if positions are not asked for.
    pub(super) fn folder(
        folder: &Path,
        poses: Option<&Path>,
        reading: PoseArgs,
        needs_positions: bool,
    ) -> anyhow::Result<Self> {
        let place = poses.unwrap_or(folder).to_owned();
        if needs_positions && poses.is_none() {
            let opened = UtmFolder::open_in(folder, reading.zone.unwrap_or_default())?;
            say(&opened.notes);
            let (poses, coordinates) = (Some(opened.poses()), opened.zone.map(Coordinates::Utm));
            return Ok(Self { names: opened.images, poses, coordinates, place });
        }
        let Listing { images, notes } = images_in_order(folder)?;
        say(&notes);
        let mut parts = Parts::default();
        if let Some(poses) = poses.filter(|_| needs_positions) {
            parts.names = Some(names_in(folder, &images));
            parts = reading.join(parts, poses)?;
        }
        Ok(Self { names: images, poses: parts.poses, coordinates: parts.about.coordinates, place })
    }

    /// Rows of a file of descriptors, with poses and names from another file if there is one, and
    /// else as far as its own says them.
    pub(super) fn rows(
        descriptors: &Path,
        poses: Option<&Path>,
        reading: ReadingArgs,
        needs_positions: bool,
    ) -> anyhow::Result<(Self, Descriptors)> {
        let beside = if needs_positions { Beside::Used } else { Beside::IfSound };
        let parts = reading.read_both(descriptors, poses, beside)?;
        let none = || Error::Empty("descriptors").in_file(descriptors);
        let rows = parts.descriptors.ok_or_else(none)?;
        let names = match &parts.names {
            Some(names) => names.iter().map(PathBuf::from).collect(),
            None => (0..rows.len()).map(|row| PathBuf::from(row.to_string())).collect(),
        };
        let place = poses.unwrap_or(descriptors).to_owned();
        let coordinates = parts.about.coordinates;
        Ok((Self { names, poses: parts.poses, coordinates, place }, rows))
    }

    /// Checks that distances to the positions of the other side mean something, and says so if only
    /// one side says where its are.
    pub(super) fn check_comparable(&self, references: &Self) -> anyhow::Result<()> {
        if let (Some(queries), Some(references)) = (self.side(), references.side()) {
            say(comparable(queries, references)?.as_slice());
        }
        Ok(())
    }

    fn side(&self) -> Option<Side<'_>> {
        let poses = self.poses.as_ref()?;
        Some(Side { place: &self.place, poses, coordinates: self.coordinates })
    }
}

/// What images are called within their folder.
pub(super) fn names_in(folder: &Path, images: &[PathBuf]) -> Names {
    images.iter().map(|path| path.strip_prefix(folder).unwrap_or(path).to_string_lossy()).collect()
}

/// Says what is to be said of files, on stderr.
pub(super) fn say(notes: &[String]) {
    for note in notes {
        cli::note(&format!("note: {note}"));
    }
}
