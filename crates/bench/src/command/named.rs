//! Images or rows of one side, with names and poses.

use std::path::{Path, PathBuf};

use vpr_core::{
    Descriptors, Error, Poses,
    map::{Coordinates, Names, UtmZone},
};
use vpr_data::{
    exchange::{self, Format, Parts},
    layout::{numbered::images_in_order, utm_names::UtmFolder},
    truth::Side,
};

/// Images of one side by name, with their poses if known.
#[derive(Clone)]
pub(super) struct Named {
    /// Files of images, names of rows, or their numbers.
    pub(super) names: Vec<PathBuf>,
    pub(super) poses: Option<Poses>,
    /// What the numbers of the poses mean, if that is known.
    pub(super) coordinates: Option<Coordinates>,
    /// Whether the names are more than numbers.
    has_names: bool,
    folder: Option<PathBuf>,
}

impl Named {
    /// Images of a folder: by their `@` names, or in order of their numbers if positions are not
    /// asked for.
    pub(super) fn folder(folder: &Path, needs_positions: bool) -> anyhow::Result<Self> {
        let folder_of_names = Some(folder.to_owned());
        if !needs_positions {
            let names = images_in_order(folder)?;
            return Ok(Self { folder: folder_of_names, ..Self::images(names, None) });
        }
        let images = UtmFolder::open(folder)?;
        let (poses, coordinates) = (Some(images.poses()), zone(&images.zones));
        let named = Self::images(images.images, poses);
        Ok(Self { coordinates, folder: folder_of_names, ..named })
    }

    /// Image files.
    pub(super) fn images(names: Vec<PathBuf>, poses: Option<Poses>) -> Self {
        Self { names, poses, coordinates: None, has_names: true, folder: None }
    }

    /// Rows without names.
    pub(super) fn numbered(n: usize) -> Self {
        let names = (0..n).map(|row| PathBuf::from(row.to_string())).collect();
        Self { has_names: false, ..Self::images(names, None) }
    }

    /// The rows of a file of descriptors, and what else it and the file of poses know of them.
    pub(super) fn rows(path: &Path, poses: Option<&Path>) -> anyhow::Result<(Self, Descriptors)> {
        let mut parts = exchange::read(Format::guess(path)?, path)?;
        let rows = parts
            .descriptors
            .take()
            .ok_or_else(|| anyhow::Error::from(Error::Empty("descriptors").in_file(path)))?;
        let named = Self::of_parts(parts, rows.len(), poses)?;
        Ok((named, rows))
    }

    /// `n` rows that a file of poses may know more of.
    pub(super) fn with_poses(n: usize, poses: Option<&Path>) -> anyhow::Result<Self> {
        Self::of_parts(Parts::default(), n, poses)
    }

    fn of_parts(parts: Parts, n: usize, poses: Option<&Path>) -> anyhow::Result<Self> {
        let mut parts = parts;
        if let Some(path) = poses {
            let read = exchange::read(Format::guess(path)?, path)?;
            parts.poses = None;
            parts = parts.join(read).map_err(|err| err.in_file(path))?;
            let actual = parts.poses.as_ref().map_or(0, Poses::len);
            if actual != n {
                let what = "poses, one per descriptor";
                return Err(Error::Mismatch { what, expected: n, actual }.in_file(path).into());
            }
        }
        let Parts { names, poses, about, .. } = parts;
        let names: Option<Vec<PathBuf>> = names
            .filter(|names| names.len() == n)
            .map(|names: Names| names.iter().map(PathBuf::from).collect());
        let named = match names {
            Some(names) => Self::images(names, poses),
            None => Self { poses, ..Self::numbered(n) },
        };
        Ok(Self { coordinates: about.coordinates, ..named })
    }

    /// Number of images.
    pub(super) fn len(&self) -> usize {
        self.names.len()
    }

    /// What a truth is told of this side.
    pub(super) fn side(&self) -> Side {
        if !self.has_names {
            return Side::numbered(self.len());
        }
        let names = self.names.iter().map(|name| name.to_string_lossy().into_owned()).collect();
        Side { folder: self.folder.clone(), ..Side::named(names) }
    }

    /// Some of the images, in this order.
    pub(super) fn selected(&self, images: &[usize]) -> Self {
        let names = images.iter().map(|&image| self.names[image].clone()).collect();
        let poses = self.poses.as_ref().map(|poses| poses.select(images));
        Self { names, poses, ..self.clone() }
    }
}

/// The zone of names such as `10S`, where the letter is a latitude band: N and above lie north.
fn zone(zones: &[String]) -> Option<Coordinates> {
    let zone = zones.iter().find(|zone| !zone.is_empty())?;
    let letter = zone.chars().last()?;
    let number = zone.strip_suffix(letter)?.parse().ok()?;
    Some(Coordinates::Utm(UtmZone { number, south: letter < 'N' }))
}
