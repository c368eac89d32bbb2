//! Poses as a table: columns by their titles, such as `name,easting,northing`, `name,x,y,z` or
//! `name,x,y,z,qw,qx,qy,qz`.

use std::path::Path;

use crate::exchange::{self, Format};
use vpr_core::{Error, Poses, Result};

/// The names and poses of a table, in its order.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseTable {
    /// Names of the images, each once.
    pub names: Vec<String>,
    /// Their poses, metres; orientations are `world_from_camera`.
    pub poses: Poses,
}

impl PoseTable {
    /// Reads the file, see [`Format::PoseCsv`]. Quaternions must be of unit length within 0.001
    /// (rounded decimals are not exact) and are normalised.
    ///
    /// # Errors
    ///
    /// [`Error::Io`]; [`Error::Format`] with line and column of what is not as it should be, or if
    /// no column has names.
    pub fn read(path: &Path) -> Result<Self> {
        let parts = exchange::read(Format::PoseCsv, path)?;
        match (parts.names, parts.poses) {
            (Some(names), Some(poses)) => {
                Ok(Self { names: names.iter().map(str::to_owned).collect(), poses })
            }
            _ => Err(Error::format(path, "header", "no column has names")),
        }
    }
}
