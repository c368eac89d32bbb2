//! How much of what a query sees a reference sees too.

use glam::Vec3;
use nalgebra::Point3;
use ndarray::Array2;
use rayon::prelude::*;

use crate::{camera::Camera, render::Exposure};

/// The surfaces an image shows, thinned out.
pub(crate) struct Survey {
    camera: Camera,
    pose: vpr_core::Pose,
    /// Static surface points, world frame, of every [`POINT_STEP`]-th pixel both ways.
    points: Vec<Vec3>,
    /// Depth of every second pixel both ways.
    depth: Vec<f32>,
}

const POINT_STEP: usize = 8;
const DEPTH_STEP: usize = 2;

impl Survey {
    pub(crate) fn new(camera: &Camera, pose: &vpr_core::Pose, exposure: &Exposure) -> Self {
        let (width, height) = (camera.width as usize, camera.height as usize);
        let mut points = Vec::new();
        for row in (POINT_STEP / 2..height).step_by(POINT_STEP) {
            for column in (POINT_STEP / 2..width).step_by(POINT_STEP) {
                let depth = exposure.depth[row * width + column];
                if !depth.is_finite() || exposure.moving[row * width + column] {
                    continue;
                }
                let direction = camera.direction(column as f64 + 0.5, row as f64 + 0.5);
                let at = pose * Point3::from(direction * (f64::from(depth) / direction.z));
                points.push(Vec3::new(at.x as f32, at.y as f32, at.z as f32));
            }
        }
        let depth = (0..height)
            .step_by(DEPTH_STEP)
            .flat_map(|row| (0..width).step_by(DEPTH_STEP).map(move |column| (row, column)))
            .map(|(row, column)| exposure.depth[row * width + column])
            .collect();
        Self { camera: *camera, pose: *pose, points, depth }
    }

    /// Share of this image's static surface points that `other` sees: in front of it, within its
    /// frame, and not behind something (5 % and 5 cm of slack in depth).
    pub(crate) fn seen_by(&self, other: &Self) -> f32 {
        if self.points.is_empty() {
            return 0.0;
        }
        let back = other.pose.inverse();
        let columns = (other.camera.width as usize).div_ceil(DEPTH_STEP);
        let seen = self.points.iter().filter(|point| {
            let at = back * Point3::new(f64::from(point.x), f64::from(point.y), f64::from(point.z));
            other.camera.project(&at.coords).filter(|&pixel| other.camera.sees(pixel)).is_some_and(
                |(x, y)| {
                    let cell = (y as usize / DEPTH_STEP) * columns + x as usize / DEPTH_STEP;
                    let nearest = f64::from(other.depth[cell]);
                    at.z <= nearest * 1.05 + 0.05
                },
            )
        });
        seen.count() as f32 / self.points.len() as f32
    }
}

/// `n_queries × n_references` shares.
pub(crate) fn matrix(queries: &[Survey], references: &[Survey]) -> Array2<f32> {
    let rows: Vec<Vec<f32>> = queries
        .par_iter()
        .map(|query| references.iter().map(|reference| query.seen_by(reference)).collect())
        .collect();
    Array2::from_shape_fn((queries.len(), references.len()), |(query, reference)| {
        rows[query][reference]
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;

    /// A camera that looks along +z of the world at a wall at z = 10.
    fn before_the_wall(x: f64, z: f64) -> Survey {
        let camera = Camera::default();
        let n = (camera.width * camera.height) as usize;
        let exposure = Exposure {
            colours: vec![Vec3::ZERO; n],
            depth: vec![10.0 - z as f32; n],
            moving: vec![false; n],
        };
        Survey::new(&camera, &Isometry3::translation(x, 0.0, z), &exposure)
    }

    #[test]
    fn side_by_side_before_a_wall_the_overlap_is_symmetric() {
        let (left, right) = (before_the_wall(0.0, 0.0), before_the_wall(3.0, 0.0));
        // The view is 320 / 230 · 10 m = 13.9 m wide, so 78 % of it is shared.
        assert!((left.seen_by(&right) - 0.78).abs() < 0.03, "{}", left.seen_by(&right));
        assert!((left.seen_by(&right) - right.seen_by(&left)).abs() < 0.01);
        assert_eq!(left.seen_by(&left), 1.0);
    }

    #[test]
    fn a_nearer_camera_sees_less_of_what_a_farther_one_sees() {
        let (far, near) = (before_the_wall(0.0, 0.0), before_the_wall(0.0, 5.0));
        assert_eq!(near.seen_by(&far), 1.0);
        assert!((far.seen_by(&near) - 0.25).abs() < 0.03, "{}", far.seen_by(&near));
    }

    #[test]
    fn what_is_hidden_or_moving_does_not_count() {
        let far = before_the_wall(0.0, 0.0);
        let mut blocked = before_the_wall(0.0, 0.0);
        blocked.depth.fill(2.0);
        assert_eq!(far.seen_by(&blocked), 0.0);
    }
}
