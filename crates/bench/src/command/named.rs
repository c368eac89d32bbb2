//! Images or rows of one side, with names and poses.

use std::path::{Path, PathBuf};

use vpr_core::{
    Descriptors, Error, Poses,
    map::{Coordinates, Names},
};
use vpr_data::{
    exchange::{self, Beside, Parts, comparable},
    layout::{folder::Listing, numbered::images_in_order, utm_names::UtmFolder},
    truth,
};
use vpr_report::cli;
use vpr_study::reading::{PoseArgs, ReadingArgs};

/// Images of one side by name, with their poses if known.
#[derive(Clone)]
pub(super) struct Named {
    /// Files of images, names of rows, or their numbers.
    pub(super) names: Vec<PathBuf>,
    pub(super) poses: Option<Poses>,
    /// What the numbers of the poses mean, if that is said.
    coordinates: Option<Coordinates>,
    /// Where the poses are from.
    place: PathBuf,
    /// Whether the names are more than numbers.
    has_names: bool,
    /// The folder that images lie in.
    folder: Option<PathBuf>,
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
        let place = poses.unwrap_or(folder);
        if needs_positions && poses.is_none() {
            let opened = UtmFolder::open_in(folder, reading.zone.unwrap_or_default())?;
            say(&opened.notes);
            let (poses, coordinates) = (Some(opened.poses()), opened.zone.map(Coordinates::Utm));
            let named = Self::images(opened.images, poses, place);
            return Ok(Self { coordinates, folder: Some(folder.to_owned()), ..named });
        }
        let Listing { images, notes } = images_in_order(folder)?;
        say(&notes);
        let mut parts = Parts::default();
        if let Some(poses) = poses.filter(|_| needs_positions) {
            parts.names = Some(names_in(folder, &images));
            parts = reading.join(parts, poses)?;
        }
        let coordinates = parts.about.coordinates;
        let named = Self::images(images, parts.poses, place);
        Ok(Self { coordinates, folder: Some(folder.to_owned()), ..named })
    }

    /// Image files, with poses from a place.
    pub(super) fn images(names: Vec<PathBuf>, poses: Option<Poses>, place: &Path) -> Self {
        let place = place.to_owned();
        Self { names, poses, coordinates: None, place, has_names: true, folder: None }
    }

    /// These rows under the files of the images that they describe, in the same order.
    ///
    /// Rows that have names must have those of the images.
    pub(super) fn of_images(self, images: &Self, method: &str) -> anyhow::Result<Self> {
        if self.has_names {
            let mut rows = self.names.iter().zip(&images.names).enumerate();
            if let Some((row, (name, image))) =
                rows.find(|(_, (name, image))| !image.ends_with(name))
            {
                anyhow::bail!(
                    "`{method}`: row {row} is of {}, and image {row} is {}; the rows must be in the order of the \
                     images",
                    name.display(),
                    image.display()
                );
            }
        }
        Ok(images.clone())
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
        let mut parts = reading.read_both(descriptors, poses, beside)?;
        let none = || Error::Empty("descriptors").in_file(descriptors);
        let rows = parts.descriptors.take().ok_or_else(none)?;
        let named = Self::of_parts(parts, rows.len(), poses.unwrap_or(descriptors));
        Ok((named, rows))
    }

    /// `n` rows of which a file of poses may know more.
    pub(super) fn with_poses(
        n: usize,
        poses: Option<&Path>,
        reading: PoseArgs,
    ) -> anyhow::Result<Self> {
        let Some(path) = poses else {
            return Ok(Self::of_parts(Parts::default(), n, Path::new("")));
        };
        let parts = reading.read(path)?;
        let actual = parts.poses.as_ref().map_or(0, Poses::len);
        if actual != n {
            let what = "poses, one per row or column of the scores";
            return Err(Error::Mismatch { what, expected: n, actual }.in_file(path).into());
        }
        Ok(Self::of_parts(parts, n, path))
    }

    fn of_parts(parts: Parts, n: usize, place: &Path) -> Self {
        let Parts { names, poses, about, .. } = parts;
        let named = if let Some(names) = names {
            Self::images(names.iter().map(PathBuf::from).collect(), poses, place)
        } else {
            let numbers = (0..n).map(|row| PathBuf::from(row.to_string())).collect();
            Self { has_names: false, ..Self::images(numbers, poses, place) }
        };
        Self { coordinates: about.coordinates, ..named }
    }

    /// Checks that distances to the positions of the other side mean something, and says so if only
    /// one side says where its are.
    pub(super) fn check_comparable(&self, references: &Self) -> anyhow::Result<()> {
        if let (Some(queries), Some(references)) = (self.posed(), references.posed()) {
            say(comparable(queries, references)?.as_slice());
        }
        Ok(())
    }

    fn posed(&self) -> Option<exchange::Side<'_>> {
        let poses = self.poses.as_ref()?;
        Some(exchange::Side { place: &self.place, poses, coordinates: self.coordinates })
    }

    /// Number of images.
    pub(super) fn len(&self) -> usize {
        self.names.len()
    }

    /// What a truth is told of this side.
    pub(super) fn side(&self) -> truth::Side {
        if !self.has_names {
            return truth::Side::numbered(self.len());
        }
        let names = self.names.iter().map(|name| name.to_string_lossy().into_owned()).collect();
        truth::Side { folder: self.folder.clone(), ..truth::Side::named(names) }
    }

    /// Some of the images, in this order.
    pub(super) fn selected(&self, images: &[usize]) -> Self {
        let names = images.iter().map(|&image| self.names[image].clone()).collect();
        let poses = self.poses.as_ref().map(|poses| poses.select(images));
        Self { names, poses, ..self.clone() }
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
