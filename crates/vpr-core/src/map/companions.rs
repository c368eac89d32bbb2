//! What a map file holds beside descriptors: poses, names, origins.

use nalgebra::{Isometry3, Point2, Point3, Quaternion, Translation3, UnitQuaternion};

use super::{MapFile, Names, Origins, checks, layout};
use crate::{Error, Poses, Result};

impl MapFile {
    /// How the kind of pose is called in messages, as [`Poses::kind`]; `None` without poses.
    #[must_use]
    pub fn pose_kind(&self) -> Option<&'static str> {
        let tensors = &self.header().tensors;
        let width = tensors.get(layout::POSITIONS)?.shape[1];
        Some(match (width, tensors.contains_key(layout::ORIENTATIONS)) {
            (2, _) => "planar",
            (_, false) => "spatial",
            (_, true) => "6-DoF",
        })
    }

    /// The poses, if the map has any.
    ///
    /// # Errors
    ///
    /// [`Error::Format`] if they are damaged, [`Error::NotFinite`] if one is not finite.
    pub fn poses(&self) -> Result<Option<Poses>> {
        let poses = self.poses_from(|name| Ok(doubles(&self.read_tensor(name)?)))?;
        let finite = poses.as_ref().map(Poses::check_finite).transpose();
        finite.map_err(|err| err.in_file(self.path()))?;
        Ok(poses)
    }

    /// The poses as they are, whatever their digests; finite or not.
    pub(super) fn poses_unchecked(&self) -> Result<Option<Poses>> {
        self.poses_from(|name| Ok(doubles(&self.read_tensor_unchecked(name)?)))
    }

    fn poses_from(&self, read: impl Fn(&str) -> Result<Vec<f64>>) -> Result<Option<Poses>> {
        let Some(entry) = self.header().tensors.get(layout::POSITIONS) else { return Ok(None) };
        let positions = read(layout::POSITIONS)?;
        let poses = if entry.shape[1] == 2 {
            Poses::Planar(positions.as_chunks().0.iter().map(|&[x, y]| Point2::new(x, y)).collect())
        } else if self.header().tensors.contains_key(layout::ORIENTATIONS) {
            let orientations = read(layout::ORIENTATIONS)?;
            let both = positions.as_chunks().0.iter().zip(orientations.as_chunks().0);
            Poses::SixDof(both.map(|(position, wxyz)| pose(*position, *wxyz)).collect())
        } else {
            Poses::Spatial(positions.as_chunks().0.iter().map(|&xyz| Point3::from(xyz)).collect())
        };
        Ok(Some(poses))
    }

    /// Checks the digest of a tensor, if there is one of this name.
    pub(super) fn check_tensor_digest(&self, name: &str) -> Result<()> {
        if self.header().tensors.contains_key(name) {
            self.read_tensor(name).map(drop)
        } else {
            Ok(())
        }
    }

    /// The lengths of the stored quaternions; none without orientations.
    pub(super) fn orientation_lengths(&self) -> Result<Vec<f64>> {
        if !self.header().tensors.contains_key(layout::ORIENTATIONS) {
            return Ok(Vec::new());
        }
        let wxyz = doubles(&self.read_tensor_unchecked(layout::ORIENTATIONS)?);
        let length = |wxyz: &[f64; 4]| wxyz.iter().map(|x| x * x).sum::<f64>().sqrt();
        Ok(wxyz.as_chunks().0.iter().map(length).collect())
    }

    /// Reads and checks a tensor other than the descriptors.
    pub(super) fn read_tensor(&self, name: &str) -> Result<Vec<u8>> {
        let bytes = self.read_tensor_unchecked(name)?;
        let (path, header) = (self.path(), self.header());
        checks::check_tensor_digests(path, header, self.rows(), self.digests(), name, &bytes)?;
        Ok(bytes)
    }

    /// The names of the images, if the map has them.
    ///
    /// # Errors
    ///
    /// [`Error::Format`] if they are damaged.
    pub fn names(&self) -> Result<Option<Names>> {
        if !self.header().tensors.contains_key(layout::NAMES) {
            return Ok(None);
        }
        let offsets = integers(&self.read_tensor(layout::NAME_OFFSETS)?);
        let names = Names::from_parts(self.read_tensor(layout::NAMES)?, &offsets)
            .map_err(|reason| Error::format(self.path(), "tensor `names`", reason))?;
        Ok(Some(names))
    }

    /// Which rows were regressed and from which others; `None` if all were measured.
    ///
    /// # Errors
    ///
    /// [`Error::Format`] if the file is damaged, or if an anchor is no measured row of it.
    pub fn origins(&self) -> Result<Option<Origins>> {
        if !self.header().tensors.contains_key(layout::ANCHORS) {
            return Ok(None);
        }
        let offsets = integers(&self.read_tensor(layout::ANCHOR_OFFSETS)?);
        let anchors = integers(&self.read_tensor(layout::ANCHORS)?);
        let origins = Origins::from_parts(&anchors, &offsets)
            .map_err(|reason| Error::format(self.path(), "tensor `anchors`", reason))?;
        Ok(Some(origins))
    }
}

fn integers(bytes: &[u8]) -> Vec<i64> {
    bytes.as_chunks().0.iter().map(|bytes| i64::from_le_bytes(*bytes)).collect()
}

fn doubles(bytes: &[u8]) -> Vec<f64> {
    bytes.as_chunks().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect()
}

/// The pose of a stored position and orientation; an orientation is scaled to length one unless it
/// has it already, so that what was written is read bit by bit.
fn pose([x, y, z]: [f64; 3], [qw, qx, qy, qz]: [f64; 4]) -> crate::Pose {
    let stored = Quaternion::new(qw, qx, qy, qz);
    let is_unit = (stored.norm_squared() - 1.0).abs() < 1e-12;
    let rotation = if is_unit {
        UnitQuaternion::new_unchecked(stored)
    } else {
        UnitQuaternion::from_quaternion(stored)
    };
    Isometry3::from_parts(Translation3::new(x, y, z), rotation)
}
