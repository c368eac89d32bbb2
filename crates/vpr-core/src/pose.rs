//! Where an image was taken.

use nalgebra::{Isometry3, Point2, Point3};

use crate::{Error, Result};

/// Position in the plane, in metres: easting and northing.
pub type PlanarPosition = Point2<f64>;

/// Position in space, in metres, world frame.
pub type Position = Point3<f64>;

/// Full camera pose, `world_from_camera`: a point in the camera's frame times this is in the world's.
pub type Pose = Isometry3<f64>;

/// The poses of a set of images; a set has one kind for all of its images.
///
/// GPS datasets have no height and no orientation, and none is invented: a method asks for the
/// kind it needs and gets an [`Error::PoseKind`] if the set does not have it.
#[derive(Clone, Debug, PartialEq)]
pub enum Poses {
    /// Easting and northing only.
    Planar(Vec<PlanarPosition>),
    /// Position in space without orientation.
    Spatial(Vec<Position>),
    /// Position and orientation.
    SixDof(Vec<Pose>),
}

impl Poses {
    /// Number of images.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Planar(positions) => positions.len(),
            Self::Spatial(positions) => positions.len(),
            Self::SixDof(poses) => poses.len(),
        }
    }

    /// Whether there is no image.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds the poses of more images.
    ///
    /// # Errors
    ///
    /// [`Error::PoseKind`] if they are of another kind.
    pub fn extend(&mut self, more: &Self) -> Result<()> {
        match (self, more) {
            (Self::Planar(all), Self::Planar(more)) => all.extend(more),
            (Self::Spatial(all), Self::Spatial(more)) => all.extend(more),
            (Self::SixDof(all), Self::SixDof(more)) => all.extend(more),
            (all, more) => return Err(Error::PoseKind { needed: more.kind(), actual: all.kind() }),
        }
        Ok(())
    }

    /// The poses of these images, in this order.
    ///
    /// # Panics
    ///
    /// If there is no such image.
    #[must_use]
    pub fn select(&self, images: &[usize]) -> Self {
        match self {
            Self::Planar(all) => Self::Planar(images.iter().map(|&image| all[image]).collect()),
            Self::Spatial(all) => Self::Spatial(images.iter().map(|&image| all[image]).collect()),
            Self::SixDof(all) => Self::SixDof(images.iter().map(|&image| all[image]).collect()),
        }
    }

    /// How the kind is called in messages.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Planar(_) => "planar",
            Self::Spatial(_) => "spatial",
            Self::SixDof(_) => "6-DoF",
        }
    }

    /// The positions in the plane.
    ///
    /// # Errors
    ///
    /// [`Error::PoseKind`] if the poses are not planar.
    pub fn planar(&self) -> Result<&[PlanarPosition]> {
        match self {
            Self::Planar(positions) => Ok(positions),
            _ => Err(Error::PoseKind { needed: "planar", actual: self.kind() }),
        }
    }

    /// The full poses.
    ///
    /// # Errors
    ///
    /// [`Error::PoseKind`] if there is no orientation.
    pub fn six_dof(&self) -> Result<&[Pose]> {
        match self {
            Self::SixDof(poses) => Ok(poses),
            _ => Err(Error::PoseKind { needed: "6-DoF", actual: self.kind() }),
        }
    }

    /// The position of one image in space; planar positions lie at height zero.
    ///
    /// # Panics
    ///
    /// If `index` is not below [`Self::len`].
    #[must_use]
    pub fn position(&self, index: usize) -> Position {
        match self {
            Self::Planar(positions) => Position::new(positions[index].x, positions[index].y, 0.0),
            Self::Spatial(positions) => positions[index],
            Self::SixDof(poses) => poses[index].translation.vector.into(),
        }
    }

    /// Checks that every number is finite.
    ///
    /// # Errors
    ///
    /// [`Error::NotFinite`] names the first image whose position or orientation is not.
    pub fn check_finite(&self) -> Result<()> {
        match (0..self.len()).find_map(|row| Some((row, self.first_not_finite(row)?))) {
            None => Ok(()),
            Some((row, column)) => {
                let value = self.values(row)[column];
                Err(Error::NotFinite { what: "poses", row, column, value })
            }
        }
    }

    /// The first number of a pose that is NaN or infinite: position, then quaternion.
    ///
    /// # Panics
    ///
    /// If `row` is not below [`Self::len`].
    #[must_use]
    pub fn first_not_finite(&self, row: usize) -> Option<usize> {
        self.values(row).iter().position(|value| !value.is_finite())
    }

    fn values(&self, row: usize) -> Vec<f64> {
        match self {
            Self::Planar(positions) => positions[row].iter().copied().collect(),
            Self::Spatial(positions) => positions[row].iter().copied().collect(),
            Self::SixDof(poses) => {
                let Pose { rotation, translation } = &poses[row];
                translation.vector.iter().chain(rotation.coords.iter()).copied().collect()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orientation_is_not_invented() {
        let poses = Poses::Planar(vec![PlanarPosition::new(1.0, 2.0)]);
        let err = poses.six_dof().unwrap_err();
        assert_eq!(err.to_string(), "needs 6-DoF poses, the map has planar");
    }

    #[test]
    fn position_of_a_pose_is_the_camera_centre() {
        let pose = Pose::translation(1.0, 2.0, 3.0);
        assert_eq!(Poses::SixDof(vec![pose]).position(0), Position::new(1.0, 2.0, 3.0));
    }

    #[test]
    fn infinite_positions_are_named() {
        let poses =
            Poses::Spatial(vec![Position::origin(), Position::new(0.0, f64::INFINITY, 0.0)]);
        let err = poses.check_finite().unwrap_err();
        assert!(matches!(err, Error::NotFinite { row: 1, column: 1, .. }), "{err}");
    }
}
