//! Changes of viewpoint: images under a homography.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use vpr_vision::image::{RgbImage, from_pixels};

/// How positions between pixels are counted.
///
/// Kornia normalises pixels of a matrix by `width − 1` whatever `align_corners` says. Without that
/// flag, which is the default of perspectives and affine maps, its sampler takes the same numbers to
/// mean `width` pixels. Affine maps start from pixels counted in the sampler's way, perspectives (up
/// to Kornia 0.8) from pixels counted in the matrix's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Corners {
    /// Rotations and crops: pixels are where they are.
    Aligned,
    /// Perspectives: all is stretched by `width / (width − 1)` and moved by half a pixel.
    Stretched,
    /// Affine maps: the map is taken of pixels that are stretched so, which is undone before.
    Centred,
}

impl Corners {
    /// Where the matrix takes a pixel of the result to be.
    fn asked(self, at: f64, side: usize) -> f64 {
        match self {
            Self::Centred if side > 1 => (at + 0.5) * (side as f64 - 1.0) / side as f64,
            _ => at,
        }
    }

    /// Where the sampler looks for what the matrix says.
    fn sampled(self, at: f64, side: usize) -> f64 {
        match self {
            Self::Stretched | Self::Centred if side > 1 => {
                at * side as f64 / (side as f64 - 1.0) - 0.5
            }
            _ => at,
        }
    }
}

/// The image under `matrix`, which takes its pixels to those of the result; bilinear, black outside.
pub(super) fn warp(image: &RgbImage, matrix: &Matrix3<f64>, corners: Corners) -> Option<RgbImage> {
    let inverse = matrix.try_inverse()?;
    let (width, height) = (image.width(), image.height());
    let mut pixels = Vec::with_capacity(3 * width * height);
    for row in 0..height {
        for column in 0..width {
            let (x, y) = (corners.asked(column as f64, width), corners.asked(row as f64, height));
            let from = inverse * Vector3::new(x, y, 1.0);
            let x = corners.sampled(from.x / from.z, width);
            let y = corners.sampled(from.y / from.z, height);
            pixels.extend(bilinear(image, x, y));
        }
    }
    Some(from_pixels(image.size(), pixels))
}

/// The colour between four pixels; those outside are black.
fn bilinear(image: &RgbImage, x: f64, y: f64) -> [u8; 3] {
    let (width, height) = (image.width() as f64, image.height() as f64);
    if !(x > -1.0 && y > -1.0 && x < width && y < height) {
        return [0; 3];
    }
    let (left, top) = (x.floor(), y.floor());
    let (across, down) = (x - left, y - top);
    let corners = [
        (left, top, (1.0 - across) * (1.0 - down)),
        (left + 1.0, top, across * (1.0 - down)),
        (left, top + 1.0, (1.0 - across) * down),
        (left + 1.0, top + 1.0, across * down),
    ];
    let mut sum = [0.0; 3];
    for (x, y, share) in corners {
        if x < 0.0 || y < 0.0 || x >= width || y >= height {
            continue;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside")]
        let at = 3 * (y as usize * image.width() + x as usize);
        for (sum, byte) in sum.iter_mut().zip(&image.as_slice()[at..at + 3]) {
            *sum += share * f64::from(*byte);
        }
    }
    sum.map(super::byte)
}

/// The homography that takes four points to four others; `None` if three of them lie on a line.
pub(super) fn perspective(from: &[[f64; 2]; 4], to: &[[f64; 2]; 4]) -> Option<Matrix3<f64>> {
    let mut equations = SMatrix::<f64, 8, 8>::zeros();
    let mut right = SVector::<f64, 8>::zeros();
    for (point, ([x, y], [u, v])) in from.iter().zip(to).enumerate() {
        let (first, second) = (2 * point, 2 * point + 1);
        let lines = [
            [*x, *y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y],
            [0.0, 0.0, 0.0, *x, *y, 1.0, -v * x, -v * y],
        ];
        for column in 0..8 {
            equations[(first, column)] = lines[0][column];
            equations[(second, column)] = lines[1][column];
        }
        (right[first], right[second]) = (*u, *v);
    }
    let h = equations.lu().solve(&right)?;
    h.iter()
        .all(|it| it.is_finite())
        .then(|| Matrix3::new(h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], 1.0))
}

/// Kornia's `get_affine_matrix2d`: scale and turn about the centre, positive angles clockwise, after
/// a shear; then moved.
pub(super) fn affine(
    size: (usize, usize),
    translation: [f64; 2],
    scale: [f64; 2],
    degrees: f64,
    shear_degrees: [f64; 2],
) -> Matrix3<f64> {
    let centre = [size.0 as f64 / 2.0 - 0.5, size.1 as f64 / 2.0 - 0.5];
    let turned = about(centre, scale, -degrees);
    let moved = Matrix3::new_translation(&translation.into()) * turned;
    let [sx, sy] = shear_degrees.map(|it| it.to_radians().tan());
    let [x, y] = centre;
    let shear = Matrix3::new(
        1.0,
        -sx,
        sx * y, //
        -sy,
        1.0 + sx * sy,
        sy * (x - sx * y), //
        0.0,
        0.0,
        1.0,
    );
    moved * shear
}

/// Kornia's `get_rotation_matrix2d`: about a centre, positive angles anti-clockwise as displayed.
pub(super) fn about(centre: [f64; 2], scale: [f64; 2], degrees: f64) -> Matrix3<f64> {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let rotation = Matrix3::new(cos, sin, 0.0, -sin, cos, 0.0, 0.0, 0.0, 1.0);
    let to = Matrix3::new_translation(&centre.into());
    let from = Matrix3::new_translation(&[-centre[0], -centre[1]].into());
    let scale = Matrix3::new(scale[0], 0.0, 0.0, 0.0, scale[1], 0.0, 0.0, 0.0, 1.0);
    to * rotation * scale * from
}
