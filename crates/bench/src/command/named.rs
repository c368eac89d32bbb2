//! Images or rows of one side, with names and poses.

use std::path::{Path, PathBuf};

use anyhow::ensure;
use vpr_core::Poses;
use vpr_data::layout::{numbered::images_in_order, pose_csv::PoseTable, utm_names::UtmFolder};

/// Images of one side by name, with their poses if known.
pub(super) struct Named {
    pub(super) names: Vec<PathBuf>,
    pub(super) poses: Option<Poses>,
    /// UTM zone; empty if the names have none.
    pub(super) zone: String,
}

impl Named {
    /// Images of a folder: by their `@` names, or in order of their numbers if positions are not
    /// asked for.
    pub(super) fn folder(folder: &Path, needs_positions: bool) -> anyhow::Result<Self> {
        if !needs_positions {
            let names = images_in_order(folder)?;
            return Ok(Self { names, poses: None, zone: String::new() });
        }
        let images = UtmFolder::open(folder)?;
        let poses = Some(images.poses());
        let zone = images.zones.into_iter().find(|zone| !zone.is_empty()).unwrap_or_default();
        Ok(Self { names: images.images, poses, zone })
    }

    /// Rows of a pose table, as many as there are descriptors.
    pub(super) fn poses(path: &Path, n: usize) -> anyhow::Result<Self> {
        let table = PoseTable::read(path)?;
        ensure!(
            table.names.len() == n,
            "{}: {} poses for {n} descriptors",
            path.display(),
            table.names.len()
        );
        let names = table.names.into_iter().map(PathBuf::from).collect();
        let poses: Option<Poses> = Some(table.poses);
        Ok(Self { names, poses, zone: String::new() })
    }

    /// Rows without names.
    pub(super) fn numbered(n: usize) -> Self {
        let names = (0..n).map(|row| PathBuf::from(row.to_string())).collect();
        Self { names, poses: None, zone: String::new() }
    }
}
