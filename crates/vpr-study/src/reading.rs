//! How files of other programs are read: the same flags in every program. Behind the feature `cli`.

use std::path::Path;

use anyhow::Context as _;
use clap::Args;
use vpr_core::Error;
use vpr_data::{
    ZoneChoice,
    exchange::{self, Beside, Direction, Format, Kind, Parts, Reading},
};
use vpr_report::cli;

/// The format of files with descriptors.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct FromArgs {
    /// Format of the files that are read, if their names do not say it: one of docs/formats.md
    #[arg(
        long,
        aliases = ["descriptors-format", "queries-format", "descriptors_format", "queries_format"],
        value_name = "FORMAT"
    )]
    pub from: Option<Format>,
}

/// How poses are read.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct PoseArgs {
    /// Format of the files with poses, if their names do not say it: one of docs/formats.md
    #[arg(long, alias = "poses_format", value_name = "FORMAT")]
    pub poses_format: Option<Format>,
    /// UTM zone for positions that lie in several, such as 30N; `auto` takes that of most
    #[arg(long, value_name = "ZONE", allow_hyphen_values = true)]
    pub zone: Option<ZoneChoice>,
    /// Which way the poses of tables and TUM trajectories go: world-from-camera (as they should),
    /// camera-from-world, or camera-from-world-rotation: only the quaternion turns the world's axes
    /// into the camera's
    #[arg(long, alias = "pose_direction", value_name = "DIRECTION")]
    pub pose_direction: Option<Direction>,
}

/// How descriptors and poses are read.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct ReadingArgs {
    /// The format of descriptors.
    #[command(flatten)]
    pub from: FromArgs,
    /// The format of poses.
    #[command(flatten)]
    pub poses: PoseArgs,
}

impl FromArgs {
    /// The format that was named, or the one that the path shows.
    ///
    /// # Errors
    ///
    /// Those of [`Format::guess`], with the flag that helps.
    pub fn format_of(self, path: &Path) -> anyhow::Result<Format> {
        match self.from {
            Some(format) => Ok(format),
            None => Ok(Format::guess_or(path, "--from", |_| true)?),
        }
    }
}

impl PoseArgs {
    /// What a reader is told.
    #[must_use]
    pub fn reading(self, beside: Beside) -> Reading {
        Reading { zone: self.zone.unwrap_or_default(), direction: self.pose_direction, beside }
    }

    /// Reads a file or folder with poses, and says on stderr what is to be said of it.
    ///
    /// # Errors
    ///
    /// Those of [`Format::guess`] with the flag that helps, and of [`exchange::read_with`]; if
    /// there are no poses.
    pub fn read(self, path: &Path) -> anyhow::Result<Parts> {
        let has_poses = |format: Format| matches!(format.kind(), Kind::Poses | Kind::Descriptors);
        let format = match self.poses_format {
            Some(format) => format,
            None => Format::guess_or(path, "--poses-format", has_poses)?,
        };
        let parts = said(exchange::read_with(format, path, self.reading(Beside::Used))?);
        if parts.poses.is_none() {
            return Err(Error::Empty("poses").in_file(path).into());
        }
        Ok(parts)
    }

    /// Joins what is known of images with the poses of a file.
    ///
    /// # Errors
    ///
    /// Those of [`Self::read`] and of [`Parts::join`].
    pub fn join(self, parts: Parts, path: &Path) -> anyhow::Result<Parts> {
        let poses = self.read(path)?;
        let joined = parts.join(poses).map_err(|err| err.in_file(path))?;
        let prefixed = |note: &String| format!("{}: {note}", path.display());
        let notes = joined.notes.iter().map(prefixed).collect();
        Ok(said(Parts { notes, ..joined }))
    }
}

impl ReadingArgs {
    /// Reads a file, and says on stderr what is to be said of it.
    ///
    /// # Errors
    ///
    /// Those of [`FromArgs::format_of`] and of [`exchange::read_with`].
    pub fn read(self, path: &Path, beside: Beside) -> anyhow::Result<Parts> {
        let format = self.from.format_of(path)?;
        Ok(said(exchange::read_with(format, path, self.poses.reading(beside))?))
    }

    /// Reads descriptors, and their poses from another file if there is one: that one counts,
    /// whatever lies beside the descriptors.
    ///
    /// # Errors
    ///
    /// Those of [`Self::read`] and of [`PoseArgs::join`].
    pub fn read_both(
        self,
        descriptors: &Path,
        poses: Option<&Path>,
        beside: Beside,
    ) -> anyhow::Result<Parts> {
        let Some(poses) = poses else { return self.read(descriptors, beside) };
        let format = self.from.format_of(descriptors)?;
        // What is said of poses is about the other file.
        let reading = Reading { beside: Beside::Ignored, ..Reading::default() };
        let parts = said(exchange::read_with(format, descriptors, reading)?);
        self.poses
            .join(parts, poses)
            .with_context(|| format!("{} and {}", descriptors.display(), poses.display()))
    }
}

/// Says what is to be said of a reading, once.
fn said(mut parts: Parts) -> Parts {
    for note in parts.notes.drain(..) {
        cli::note(&format!("note: {note}"));
    }
    parts
}
