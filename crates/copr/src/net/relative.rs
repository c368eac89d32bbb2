//! What H is told of the way from an anchor to a target.

use vpr_core::{Definition, Pose};
use vpr_nets::regress::RELATIVE_POSE;

use crate::regression::narrow;

/// Translation in metres, then the quaternion of the turn, wxyz: `tx ty tz qw qx qy qz`.
///
/// [`Definition::Published`] gives the translation in the axes of the world and the turn in those of
/// the anchor's camera (C-3), so that a turned world is another problem. [`Definition::Corrected`]
/// gives both in the anchor's axes, and of the two quaternions of a turn the one with `qw ≥ 0`.
#[must_use]
pub fn relative_pose(anchor: &Pose, target: &Pose, definition: Definition) -> [f32; RELATIVE_POSE] {
    let relative = anchor.inv_mul(target);
    let (t, q) = match definition {
        Definition::Published => {
            let world = target.translation.vector - anchor.translation.vector;
            (world, relative.rotation.into_inner())
        }
        Definition::Corrected => {
            let q = relative.rotation.into_inner();
            (relative.translation.vector, if q.w < 0.0 { -q } else { q })
        }
    };
    [t.x, t.y, t.z, q.w, q.i, q.j, q.k].map(narrow)
}

/// The same way in a world whose cameras are mirrored left to right.
///
/// A mirrored world is seen through mirrored cameras: of a corrected relative pose, x and the turns
/// about y and z change sign, and nothing else. A network whose weights of these inputs change sign
/// too gives the same descriptors.
#[must_use]
pub fn mirrored([tx, ty, tz, qw, qx, qy, qz]: [f32; RELATIVE_POSE]) -> [f32; RELATIVE_POSE] {
    [-tx, ty, tz, qw, qx, -qy, -qz]
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3};
    use proptest::prelude::*;

    use super::*;

    fn close(a: [f32; RELATIVE_POSE], b: [f32; RELATIVE_POSE]) -> bool {
        a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-4)
    }

    #[test]
    fn published_is_the_worlds_and_corrected_the_cameras() {
        // The anchor looks along world x: its z axis is the world's x.
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::FRAC_PI_2);
        let anchor = Isometry3::from_parts([1.0, 0.0, 0.0].into(), turn);
        let target = Isometry3::from_parts([3.0, 0.0, 0.0].into(), turn);
        let of = |definition| relative_pose(&anchor, &target, definition);
        assert!(close(of(Definition::Published), [2.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]));
        assert!(close(of(Definition::Corrected), [0.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0]));
    }

    fn pose() -> impl Strategy<Value = Pose> {
        let value = || -3.0_f64..3.0;
        ([value(), value(), value()], [value(), value(), value()])
            .prop_map(|(t, r)| Isometry3::new(t.into(), r.into()))
    }

    proptest! {
        #[test]
        fn a_turned_and_shifted_world_changes_nothing_if_corrected(
            anchor in pose(), target in pose(), by in pose(),
        ) {
            let of = |by: &Pose| relative_pose(&(by * anchor), &(by * target), Definition::Corrected);
            prop_assert!(close(of(&Isometry3::identity()), of(&by)));
        }

        /// The world is mirrored in a plane through its origin, the cameras left to right.
        #[test]
        fn a_mirrored_world_mirrors_the_relative_pose(anchor in pose(), target in pose()) {
            let world = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0));
            let camera = Matrix3::from_diagonal(&Vector3::new(-1.0, 1.0, 1.0));
            let mirror = |pose: &Pose| {
                let turn = world * pose.rotation.to_rotation_matrix().into_inner() * camera;
                let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turn));
                Isometry3::from_parts((world * pose.translation.vector).into(), turn)
            };
            let here = relative_pose(&anchor, &target, Definition::Corrected);
            let there = relative_pose(&mirror(&anchor), &mirror(&target), Definition::Corrected);
            // Half a turn has two quaternions with qw = 0.
            prop_assume!(here[3] > 1e-3);
            prop_assert!(close(mirrored(here), there));
        }
    }
}
