//! Targets behind walls: what cameras with depth say of them.

use nalgebra::Point3;
use ndarray::ArrayView2;
use vpr_core::Pose;

use super::Targets;

/// A camera with a depth image, without distortion.
#[derive(Clone, Copy, Debug)]
pub struct DepthView<'a> {
    /// Where it stands, `world_from_camera`, metres.
    pub pose: Pose,
    /// Focal lengths, pixels, in x and y.
    pub focal: [f64; 2],
    /// Where the optical axis meets the image, pixels; the middle of the first pixel is (.5, .5).
    pub centre: [f64; 2],
    /// Metres along the optical axis, `height × width`; infinite where nothing is, 0 or not a number
    /// where the sensor says nothing.
    pub metres: ArrayView2<'a, f32>,
}

/// How far every target lies behind what cameras see, metres along their optical axes; negative as far
/// as it lies before it. Of several cameras that have it in view the one counts for which it is freest;
/// 0 if none has.
///
/// An orientation plays no part: a target is where a camera would be.
#[must_use]
pub fn behind(targets: &Targets<'_>, views: &[DepthView<'_>]) -> Vec<f64> {
    let of = |target: super::Target| {
        let at = Point3::from(target.pose.translation.vector);
        let told = views.iter().filter_map(|view| view.behind(&at));
        told.min_by(f64::total_cmp).unwrap_or(0.0)
    };
    targets.iter().map(of).collect()
}

impl DepthView<'_> {
    /// `None` if the point is not in view or nothing was measured there.
    fn behind(&self, point: &Point3<f64>) -> Option<f64> {
        let at = self.pose.inverse_transform_point(point);
        if at.z <= 0.0 {
            return None;
        }
        let pixel = |value: f64, axis: usize| {
            let pixel = (self.focal[axis] * value / at.z + self.centre[axis]).floor();
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "not negative"
            )]
            (0.0..1e9).contains(&pixel).then_some(pixel as usize)
        };
        let metres = f64::from(*self.metres.get((pixel(at.y, 1)?, pixel(at.x, 0)?))?);
        (metres > 0.0).then_some(at.z - metres)
    }
}

#[cfg(test)]
mod tests {
    use ndarray::{Array2, array};
    use vpr_core::Pose;

    use super::*;
    use crate::{Anchors, Target};

    #[test]
    fn a_wall_hides_what_is_behind_it() {
        // Two pixels: a wall 2 m ahead to the left, nothing to the right.
        let metres = array![[2.0_f32, f32::INFINITY]];
        let view = |pose, metres: ArrayView2<'static, f32>| DepthView {
            pose,
            focal: [1.0, 1.0],
            centre: [1.0, 0.5],
            metres,
        };
        let left: &'static Array2<f32> = Box::leak(Box::new(metres));
        let silent: &'static Array2<f32> = Box::leak(Box::new(array![[0.0_f32, f32::NAN]]));
        let poses = vec![Pose::identity()];
        let anchors = Anchors::of_rows(&poses, &[vec![0]]).unwrap();
        let at = |x: f64, z: f64| Target { pose: Pose::translation(x, 0.0, z), home: 0 };
        let all = vec![at(-0.5, 3.0), at(-0.5, 1.5), at(0.5, 9.0), at(-5.0, 3.0), at(0.0, -1.0)];
        let targets = Targets::placed(&anchors, all).unwrap();
        let here = view(Pose::identity(), left.view());
        let told = behind(&targets, &[here]);
        assert_eq!(told, [1.0, -0.5, f64::NEG_INFINITY, 0.0, 0.0]);
        // A camera one metre further on is nearer to the wall that it sees: the freest view counts.
        let ahead = view(Pose::translation(0.0, 0.0, 1.5), left.view());
        assert_eq!(behind(&targets, &[here, ahead])[0], -0.5);
        // A sensor that says nothing says nothing of walls.
        let mute = view(Pose::identity(), silent.view());
        assert_eq!(behind(&targets, &[mute]), [0.0; 5]);
        assert_eq!(behind(&targets, &[]), [0.0; 5]);
    }
}
