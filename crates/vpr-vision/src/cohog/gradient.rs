//! Strength and direction of the gray value gradient, as OpenCV's Sobel operator and `phase` give them.

use ndarray::{Array2, Zip};
use vpr_core::Definition;

use crate::image::GrayImage;

/// Gradient of an image, height × width each.
pub(super) struct Gradient {
    /// How strong it is.
    pub(super) strength: Array2<f32>,
    /// Where it points, in degrees from 0 to 360; 0 is right, 90 is down.
    pub(super) angle: Array2<f32>,
}

impl Gradient {
    /// Gradient of `√(image / maximum) · 255`.
    pub(super) fn of(image: &GrayImage, definition: Definition) -> Self {
        let (x, y) = sobel(&square_root(image));
        #[expect(clippy::cast_possible_truncation, reason = "the released code narrows here too")]
        let strength = |&x: &f64, &y: &f64| match definition {
            Definition::Published => (0.5 * x + 0.5 * y).abs() as f32,
            Definition::Corrected => x.hypot(y) as f32,
        };
        #[expect(clippy::cast_possible_truncation, reason = "OpenCV computes angles in f32")]
        let angle = |&x: &f64, &y: &f64| degrees(x as f32, y as f32);
        Self {
            strength: Zip::from(&x).and(&y).map_collect(strength),
            angle: Zip::from(&x).and(&y).map_collect(angle),
        }
    }
}

/// Gray values on a scale from 0 to 255 that evens out bright and dark; black stays black.
fn square_root(image: &GrayImage) -> Array2<f64> {
    let pixels = image.as_slice();
    let brightest = f64::from(pixels.iter().copied().max().unwrap_or(0).max(1));
    let scaled: [f64; 256] = std::array::from_fn(|value| (value as f64 / brightest).sqrt() * 255.0);
    let scaled = pixels.iter().map(|&value| scaled[usize::from(value)]);
    Array2::from_shape_vec((image.height(), image.width()), scaled.collect())
        .expect("height × width bytes")
}

/// The 5 × 5 Sobel derivatives along x and y, mirrored at the border without repeating it.
///
/// The order of additions, and the one place where a product is not rounded before its addition, are those of an
/// OpenCV built for processors with fused multiply-add: where neighbours are equal the released code divides the
/// rounding noise by its own length, so that even the noise reaches the descriptor.
fn sobel(image: &Array2<f64>) -> (Array2<f64>, Array2<f64>) {
    let (height, width) = image.dim();
    let mut derivatives = Array2::zeros((height, width));
    let mut smooth = Array2::zeros((height, width));
    let mut padded = vec![0.0; width + 4];
    for (y, row) in image.outer_iter().enumerate() {
        for (x, value) in padded.iter_mut().enumerate() {
            *value = row[mirrored(x, width)];
        }
        let derivatives = derivatives.row_mut(y).into_slice().expect("standard layout");
        let smooth = smooth.row_mut(y).into_slice().expect("standard layout");
        let taps = padded.array_windows::<5>().zip(derivatives.iter_mut().zip(smooth));
        for (&[a, b, c, d, e], (derivative, smooth)) in taps {
            *derivative = -a - 2.0 * b + 2.0 * d + e;
            *smooth = 6.0f64.mul_add(c, a + 4.0 * b) + 4.0 * d + e;
        }
    }
    (
        combine_rows(&derivatives, |[a, b, c, d, e]| 6.0 * c + 4.0 * (b + d) + (a + e)),
        combine_rows(&smooth, |[a, b, _, d, e]| 2.0 * (d - b) + (e - a)),
    )
}

/// Combines five rows around every row, mirrored at the border.
fn combine_rows(values: &Array2<f64>, combine: impl Fn([f64; 5]) -> f64) -> Array2<f64> {
    let (height, width) = values.dim();
    let mut combined = Array2::zeros((height, width));
    for (y, mut combined) in combined.outer_iter_mut().enumerate() {
        let rows: [&[f64]; 5] = std::array::from_fn(|tap| {
            let row = values.row(mirrored(y + tap, height));
            &row.to_slice().expect("standard layout")[..width]
        });
        for (x, combined) in combined.iter_mut().enumerate() {
            *combined = combine(rows.map(|row| row[x]));
        }
    }
    combined
}

/// The pixel that stands for pixel `padded − 2`, mirrored at 0 and at `len − 1`.
fn mirrored(padded: usize, len: usize) -> usize {
    let inside = padded.abs_diff(2);
    if inside < len { inside } else { 2 * (len - 1) - inside }
}

/// Direction of `(x, y)` in degrees, 0 to 360, by OpenCV's polynomial, which is off by at most 0.01°.
///
/// An angle just below 0 rounds to 360.
fn degrees(x: f32, y: f32) -> f32 {
    const RADIAN: f32 = 57.295_78;
    const ODD: [f32; 4] = [
        0.999_787_87 * RADIAN,
        -0.325_808_4 * RADIAN,
        0.155_578_65 * RADIAN,
        -0.044_326_555 * RADIAN,
    ];
    #[expect(clippy::cast_possible_truncation, reason = "2^-52 is an f32")]
    const TINY: f32 = f64::EPSILON as f32;
    let (across, up) = (x.abs(), y.abs());
    let slope = across.min(up) / (across.max(up) + TINY);
    let square = slope * slope;
    let octant = (((ODD[3] * square + ODD[2]) * square + ODD[1]) * square + ODD[0]) * slope;
    let quadrant = if across >= up { octant } else { 90.0 - octant };
    let half = if x < 0.0 { 180.0 - quadrant } else { quadrant };
    if y < 0.0 { 360.0 - half } else { half }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these values are exact")]
mod tests {
    use super::*;
    use crate::image::ImageSize;

    #[test]
    fn angles_are_right_to_a_hundredth_of_a_degree() {
        for step in 0..3600u16 {
            let expected = f32::from(step) / 10.0;
            let (y, x) = expected.to_radians().sin_cos();
            let off = (degrees(x * 300.0, y * 300.0) - expected + 180.0).rem_euclid(360.0) - 180.0;
            assert!(off.abs() < 0.0101, "{expected}: off by {off}");
        }
        assert_eq!(degrees(0.0, 0.0), 0.0);
        assert_eq!(degrees(1.0, -1e-9), 360.0);
    }

    #[test]
    fn a_ramp_has_one_slope_inside_and_none_at_a_mirrored_border() {
        let ramp = Array2::from_shape_fn((7, 9), |(_, x)| x as f64);
        let (x, y) = sobel(&ramp);
        // 16 rows of smoothing times (1·2·2 + 2·1·2) of derivative
        assert_eq!(x[(3, 4)], 128.0);
        assert_eq!((x[(3, 0)], x[(3, 8)]), (0.0, 0.0));
        assert!(y.iter().all(|&value| value == 0.0));
        let (x, y) = sobel(&ramp.reversed_axes());
        assert_eq!((x[(4, 3)], y[(4, 3)]), (0.0, 128.0));
    }

    #[test]
    fn published_strength_vanishes_where_x_and_y_cancel() {
        let pixels = (0..400u16).map(|i| if i % 20 > i / 20 { 200 } else { 0 }).collect();
        let edge = GrayImage::new(ImageSize { width: 20, height: 20 }, pixels).unwrap();
        let at_edge = |definition| Gradient::of(&edge, definition).strength[(10, 10)];
        assert!(at_edge(Definition::Published) < 1e-3);
        assert!(at_edge(Definition::Corrected) > 1e3);
    }
}
