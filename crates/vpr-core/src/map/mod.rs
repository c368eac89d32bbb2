//! The reference map: descriptors with poses, in memory and on disk.

mod about;
mod checks;
mod companions;
mod copy;
mod digest;
mod file;
mod header;
mod layout;
mod lock;
mod names;
mod open_map;
mod origins;
mod row_lengths;
mod row_type;
mod segments;
mod touch;
mod utm;
mod verify;
mod writer;

pub use about::{About, Coordinates, ImageSize, UtmZone, metric_name, parse_metric};
pub use copy::{copy_as, merge};
pub use digest::{BlockDigest, image_list_digest};
pub use file::{Access, MapFile, Opening};
pub use header::{ElementType, Header, TensorEntry};
pub use names::Names;
pub use open_map::OpenMap;
pub use origins::{Origin, Origins};
pub use row_type::RowType;
pub use segments::GrowingMap;
pub use utm::LatLon;
pub use verify::verify;
pub use writer::{MapWriter, write};

use crate::{Descriptors, Error, Poses, Result};

/// The reference map of the thesis, §3.2.1: the descriptor and the pose of every reference image.
///
/// Code that needs no poses (retrieval, recall) takes [`Descriptors`]; code that needs them takes
/// the map, so that there is no optional pose to forget.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    descriptors: Descriptors,
    poses: Poses,
}

impl Map {
    /// Joins the descriptors and the poses of the same images, in the same order.
    ///
    /// # Errors
    ///
    /// [`Error::Mismatch`] if they are not equally many, [`Error::NotFinite`] if a pose is not finite.
    pub fn new(descriptors: Descriptors, poses: Poses) -> Result<Self> {
        if descriptors.len() != poses.len() {
            return Err(Error::Mismatch {
                what: "poses of a map, one per descriptor",
                expected: descriptors.len(),
                actual: poses.len(),
            });
        }
        poses.check_finite()?;
        Ok(Self { descriptors, poses })
    }

    /// Descriptor of every reference.
    #[must_use]
    pub fn descriptors(&self) -> &Descriptors {
        &self.descriptors
    }

    /// Pose of every reference.
    #[must_use]
    pub fn poses(&self) -> &Poses {
        &self.poses
    }

    /// Number of references.
    #[must_use]
    pub fn len(&self) -> usize {
        self.descriptors.len()
    }

    /// Whether there is no reference.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.descriptors.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;
    use crate::PlanarPosition;

    #[test]
    fn every_descriptor_needs_a_pose() {
        let descriptors = Descriptors::new(array![[1.0], [2.0]]).unwrap();
        let poses = Poses::Planar(vec![PlanarPosition::origin()]);
        let err = Map::new(descriptors, poses).unwrap_err();
        assert!(matches!(err, Error::Mismatch { expected: 2, actual: 1, .. }), "{err}");
    }
}
