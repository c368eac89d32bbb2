//! A pinhole camera with optional radial distortion.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Intrinsics, in pixels. The camera looks along +z, x points right and y down; pixel `(0, 0)` has
/// its middle at `(0.5, 0.5)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Camera {
    /// Image width.
    pub width: u32,
    /// Image height.
    pub height: u32,
    /// Focal length, the same in both directions.
    pub focal: f64,
    /// Radial distortion: a point at radius r (over the focal length) is seen at r (1 + k r²).
    pub distortion: f64,
}

impl Default for Camera {
    fn default() -> Self {
        Self { width: 320, height: 240, focal: 230.0, distortion: 0.0 }
    }
}

impl Camera {
    /// Direction, camera frame, unit length, in which the image point `(x, y)` lies.
    #[must_use]
    pub fn direction(&self, x: f64, y: f64) -> Vector3<f64> {
        let seen_x = (x - 0.5 * f64::from(self.width)) / self.focal;
        let seen_y = (y - 0.5 * f64::from(self.height)) / self.focal;
        // Solve s (1 + k r² s²) = 1 by Newton; [`Self::is_one_to_one`] says where that has a solution.
        let bend = self.distortion * (seen_x * seen_x + seen_y * seen_y);
        let mut scale = 1.0;
        if bend != 0.0 {
            for _ in 0..12 {
                let excess = scale * (1.0 + bend * scale * scale) - 1.0;
                scale -= excess / (1.0 + 3.0 * bend * scale * scale);
            }
        }
        Vector3::new(seen_x * scale, seen_y * scale, 1.0).normalize()
    }

    /// Whether the distortion leaves every pixel one direction: a strong barrel folds the corners.
    pub(crate) fn is_one_to_one(&self) -> bool {
        let corner = f64::from(self.width).hypot(f64::from(self.height)) * 0.5 / self.focal;
        // r (1 + k r²) grows up to r² = -1 / 3k, where it is 2/3 r; keep 2 % away from there.
        self.distortion >= 0.0
            || corner < 0.98 * 2.0 / 3.0 * (-1.0 / (3.0 * self.distortion)).sqrt()
    }

    /// Image point of a point in the camera's frame; `None` behind the camera.
    #[must_use]
    pub fn project(&self, point: &Vector3<f64>) -> Option<(f64, f64)> {
        if point.z <= 1e-6 {
            return None;
        }
        let (x, y) = (point.x / point.z, point.y / point.z);
        let scale = self.focal * (1.0 + self.distortion * (x * x + y * y));
        Some((0.5 * f64::from(self.width) + x * scale, 0.5 * f64::from(self.height) + y * scale))
    }

    /// Whether an image point lies on the image.
    #[must_use]
    pub fn sees(&self, (x, y): (f64, f64)) -> bool {
        (0.0..f64::from(self.width)).contains(&x) && (0.0..f64::from(self.height)).contains(&y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn projecting_a_pixels_direction_gives_the_pixel_back() {
        for distortion in [0.0, 0.2, -0.15] {
            let camera = Camera { distortion, ..Camera::default() };
            assert!(camera.is_one_to_one());
            for (x, y) in [(0.5, 0.5), (160.0, 120.0), (300.25, 17.5), (319.5, 239.5)] {
                let back = camera.project(&(camera.direction(x, y) * 7.0)).unwrap();
                assert!(
                    (back.0 - x).abs() < 1e-3 && (back.1 - y).abs() < 1e-3,
                    "{distortion}: {back:?}"
                );
            }
        }
    }

    #[test]
    fn a_barrel_that_folds_the_corners_is_noticed() {
        // At the corner r = 0.87, but r (1 - 0.2 r²) never exceeds 0.86.
        assert!(!Camera { distortion: -0.2, ..Camera::default() }.is_one_to_one());
    }
}
