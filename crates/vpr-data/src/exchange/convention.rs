//! How files write poses: the order of a quaternion's numbers and the direction of a transform.

use std::{fmt, str::FromStr};

use nalgebra::{Isometry3, Matrix3, Quaternion, Rotation3, Translation3, UnitQuaternion};

use vpr_core::Pose;

/// The order in which a file has the four numbers of a quaternion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QuaternionOrder {
    /// Real part first: COLMAP, hloc, kapture, CoPR, and our own files.
    Wxyz,
    /// Real part last: TUM, ROS, scipy.
    Xyzw,
}

/// Which way a file's transform goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// A point in the camera's frame becomes one in the world's; the translation is the camera's
    /// position. 7-Scenes, TUM, KITTI, `EuRoC`, and [`Pose`].
    WorldFromCamera,
    /// A point in the world's frame becomes one in the camera's, whose position is `−Rᵀ t`. COLMAP,
    /// hloc, kapture.
    CameraFromWorld,
    /// The translation is the camera's position, but the quaternion turns the world's axes into the
    /// camera's. Some tables are like this.
    CameraFromWorldRotation,
}

impl Direction {
    /// All directions.
    pub const ALL: [Self; 3] =
        [Self::WorldFromCamera, Self::CameraFromWorld, Self::CameraFromWorldRotation];

    /// The name that is typed.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::WorldFromCamera => "world-from-camera",
            Self::CameraFromWorld => "camera-from-world",
            Self::CameraFromWorldRotation => "camera-from-world-rotation",
        }
    }
}

impl fmt::Display for Direction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Direction {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|it| it.name() == text).ok_or_else(|| {
            let known = Self::ALL.map(Self::name).join(", ");
            format!("`{}` is none of {known}", vpr_files::shorten(text))
        })
    }
}

/// How a format writes poses; a named choice per format, nothing is guessed from the numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PoseConvention {
    /// Order of the quaternion.
    pub order: QuaternionOrder,
    /// Direction of the transform.
    pub direction: Direction,
}

/// How far from 1 the length of a quaternion may be: files round to six digits or fewer.
const LENGTH_TOLERANCE: f64 = 1e-3;
/// How far from orthonormal a rotation matrix may be.
const ROTATION_TOLERANCE: f64 = 1e-2;

impl PoseConvention {
    /// `qw qx qy qz tx ty tz`, camera from world, as COLMAP and hloc write them.
    pub const HLOC: Self =
        Self { order: QuaternionOrder::Wxyz, direction: Direction::CameraFromWorld };
    /// `qw, qx, qy, qz, tx, ty, tz`, device from world, as kapture writes them.
    pub const KAPTURE: Self =
        Self { order: QuaternionOrder::Wxyz, direction: Direction::CameraFromWorld };
    /// `tx ty tz qx qy qz qw`, world from camera, as the TUM benchmark writes them.
    pub const TUM: Self =
        Self { order: QuaternionOrder::Xyzw, direction: Direction::WorldFromCamera };
    /// Real part first, world from camera: tables by title, and our own files.
    pub const TABLE: Self =
        Self { order: QuaternionOrder::Wxyz, direction: Direction::WorldFromCamera };

    /// The same with another direction, if one is named.
    #[must_use]
    pub fn directed(self, direction: Option<Direction>) -> Self {
        Self { direction: direction.unwrap_or(self.direction), ..self }
    }

    /// The pose of a translation and a quaternion in this convention.
    ///
    /// # Errors
    ///
    /// If the quaternion's length is not one within 0.001 (files hold rounded numbers).
    pub fn pose(self, translation: [f64; 3], quaternion: [f64; 4]) -> Result<Pose, String> {
        let mut xyzw = quaternion;
        if self.order == QuaternionOrder::Wxyz {
            xyzw.rotate_left(1);
        }
        let quaternion = Quaternion::from(xyzw);
        let length = quaternion.norm();
        if (length - 1.0).abs() > LENGTH_TOLERANCE {
            return Err(format!("the quaternion has length {length}, not 1"));
        }
        let rotation = UnitQuaternion::from_quaternion(quaternion);
        Ok(self.turn(Isometry3::from_parts(Translation3::from(translation), rotation)))
    }

    /// Translation and quaternion of a pose in this convention.
    #[must_use]
    pub fn parts(self, pose: &Pose) -> ([f64; 3], [f64; 4]) {
        let Isometry3 { rotation, translation } = self.turn(*pose);
        let mut quaternion: [f64; 4] = rotation.coords.into();
        if self.order == QuaternionOrder::Wxyz {
            quaternion.rotate_right(1);
        }
        (translation.vector.into(), quaternion)
    }

    fn turn(self, pose: Isometry3<f64>) -> Isometry3<f64> {
        match self.direction {
            Direction::WorldFromCamera => pose,
            Direction::CameraFromWorld => pose.inverse(),
            Direction::CameraFromWorldRotation => {
                Isometry3::from_parts(pose.translation, pose.rotation.inverse())
            }
        }
    }
}

/// The pose of the first three rows of a 4×4 world-from-camera matrix.
///
/// Rounded rotations are replaced by the nearest one (in the Frobenius norm).
pub(super) fn pose_from_rows(rows: &[f64; 12]) -> Result<Pose, String> {
    let matrix = Matrix3::from_fn(|row, column| rows[4 * row + column]);
    let error = (matrix.transpose() * matrix - Matrix3::identity()).amax();
    if error > ROTATION_TOLERANCE || matrix.determinant() < 0.0 {
        return Err(format!("is no rotation: Rᵀ·R is off by {error:.2e} from the identity"));
    }
    let svd = matrix.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
        return Err("is no rotation: its decomposition failed".to_owned());
    };
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(u * v_t));
    Ok(Isometry3::from_parts(Translation3::new(rows[3], rows[7], rows[11]), rotation))
}

/// The first three rows of a pose's 4×4 world-from-camera matrix.
pub(super) fn rows_of_pose(pose: &Pose) -> [f64; 12] {
    let matrix = pose.to_homogeneous();
    std::array::from_fn(|index| matrix[(index / 4, index % 4)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hloc_and_tum_write_the_same_pose_differently() {
        // The camera stands at (1, 2, 3) and is turned by 90° about z.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let tum = PoseConvention::TUM.pose([1.0, 2.0, 3.0], [0.0, 0.0, half, half]).unwrap();
        let hloc = PoseConvention::HLOC.pose([-2.0, 1.0, -3.0], [half, 0.0, 0.0, -half]).unwrap();
        assert!((tum.inverse() * hloc).translation.vector.norm() < 1e-12);
        assert!(tum.rotation.angle_to(&hloc.rotation) < 1e-7);
    }

    #[test]
    fn a_quaternion_may_turn_the_other_way_than_the_position_says() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let turned = [half, 0.0, 0.0, -half];
        let direct = PoseConvention::TABLE.pose([1.0, 2.0, 3.0], [half, 0.0, 0.0, half]).unwrap();
        for (direction, translation) in [
            (Direction::CameraFromWorldRotation, [1.0, 2.0, 3.0]),
            (Direction::CameraFromWorld, [-2.0, 1.0, -3.0]),
        ] {
            let convention = PoseConvention::TABLE.directed(Some(direction));
            let pose = convention.pose(translation, turned).unwrap();
            assert!((pose.translation.vector - direct.translation.vector).norm() < 1e-12);
            assert!(pose.rotation.angle_to(&direct.rotation) < 1e-7, "{direction}");
            let (back, _) = convention.parts(&pose);
            assert!(back.iter().zip(translation).all(|(a, b)| (a - b).abs() < 1e-12));
            assert_eq!(direction.to_string().parse(), Ok(direction));
        }
    }

    #[test]
    fn a_quaternion_far_from_unit_length_is_refused() {
        let err = PoseConvention::TUM.pose([0.0; 3], [1.0, 1.0, 0.0, 0.0]).unwrap_err();
        assert!(err.starts_with("the quaternion has length 1.414"), "{err}");
    }

    #[test]
    fn a_reflection_is_no_rotation() {
        let mirror = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0];
        assert!(pose_from_rows(&mirror).is_err());
    }
}
