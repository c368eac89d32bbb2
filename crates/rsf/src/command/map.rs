//! The map that a command is about.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use rsf::ReferenceSet;
use vpr_core::map::Names;
use vpr_data::{
    exchange::Parts,
    layout::{numbered::images_in_order, utm_names::UtmFolder},
};
use vpr_report::cli::{self, Bar, DataArgs};
use vpr_study::{Sources, reading::PoseArgs};

/// References: a folder, or those of a dataset. Nothing here names a query.
#[derive(clap::Args)]
pub(crate) struct MapArgs {
    /// Folder of the reference images; their positions are those of --database-poses, or of
    /// `@utm_east@utm_north@…` names
    #[arg(
        long,
        alias = "database_folder",
        value_name = "DIR",
        required_unless_present = "dataset"
    )]
    database_folder: Option<PathBuf>,
    /// Poses of the references: a table, or any format of docs/formats.md
    #[arg(long, alias = "database_poses", value_name = "FILE", requires = "database_folder")]
    database_poses: Option<PathBuf>,
    /// Instead of a folder: the references of a dataset, such as `world/rail`
    #[arg(long, value_name = "NAME", conflicts_with = "database_folder")]
    dataset: Option<String>,
    /// Do without poses: negatives are random, and may show the same place
    #[arg(long, conflicts_with = "database_poses")]
    no_poses: bool,
    #[command(flatten)]
    reading: PoseArgs,
    #[command(flatten)]
    pub(crate) data: DataArgs,
}

impl MapArgs {
    /// The references, and what they are called.
    pub(crate) fn open(&self) -> anyhow::Result<(ReferenceSet, String)> {
        let (images, poses, name) = match (&self.dataset, &self.database_folder) {
            (Some(id), _) => {
                let set = self.of_dataset(id)?;
                return Ok((if self.no_poses { set.without_poses() } else { set }, id.clone()));
            }
            (None, Some(folder)) => {
                let (images, poses) = self.of_folder(folder)?;
                (images, poses, folder.display().to_string())
            }
            (None, None) => bail!("give --database-folder or --dataset"),
        };
        Ok((ReferenceSet::new(images, poses)?, name))
    }

    fn of_dataset(&self, id: &str) -> anyhow::Result<ReferenceSet> {
        let bar = Bar::default();
        let (folders, cache) = (self.data.folders(), self.data.cache());
        let sources = Sources::new(folders.iter().map(PathBuf::as_path), &cache, &bar);
        match rsf::study::references(&sources, id)? {
            Some(set) => Ok(set),
            None => bail!(sources.why_absent(id, "images")?),
        }
    }

    fn of_folder(&self, folder: &Path) -> anyhow::Result<(Vec<PathBuf>, Option<vpr_core::Poses>)> {
        if self.no_poses || self.database_poses.is_some() {
            let listing = images_in_order(folder)?;
            say(&listing.notes);
            let Some(path) = &self.database_poses else { return Ok((listing.images, None)) };
            let inside = |it: &PathBuf| it.strip_prefix(folder).unwrap_or(it).display().to_string();
            let names: Names = listing.images.iter().map(inside).collect();
            let parts = Parts { names: Some(names), ..Parts::default() };
            return Ok((listing.images, self.reading.join(parts, path)?.poses));
        }
        let opened = UtmFolder::open_in(folder, self.reading.zone.unwrap_or_default())
            .context("without --database-poses, names say where images were taken")?;
        say(&opened.notes);
        let poses = opened.poses();
        Ok((opened.images, Some(poses)))
    }
}

fn say(notes: &[String]) {
    for note in notes {
        cli::note(&format!("note: {note}"));
    }
}
