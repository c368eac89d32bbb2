//! What a reader is told where a file does not say it itself.

use super::Direction;
use crate::ZoneChoice;

/// How files are read; the default asks for nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reading {
    /// The UTM zone of positions that are in degrees or name their zones.
    pub zone: ZoneChoice,
    /// Which way the poses of tables and TUM trajectories go; the other formats say it.
    pub direction: Option<Direction>,
    /// What a table beside a `.npy` file is good for.
    pub beside: Beside,
}

/// What becomes of `descriptors.csv` beside `descriptors.npy`.
///
/// A CSV that is no table of poses is none of ours and only mentioned.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Beside {
    /// It has the poses, and must be sound.
    #[default]
    Used,
    /// It has the poses; if it is not sound, that is said and nothing is taken from it. For files
    /// whose poses are not needed.
    IfSound,
    /// It is not looked at: poses are given by name.
    Ignored,
}
