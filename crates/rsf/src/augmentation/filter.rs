//! Blur.

use nalgebra::Vector3;

use super::{Planar, warp};

/// A square kernel of odd width, rows one after another.
pub(super) struct Kernel {
    width: usize,
    values: Vec<f64>,
}

/// Values beyond the border.
#[derive(Clone, Copy)]
enum Border {
    /// Mirrored at the outermost pixels, which are not repeated; images of one pixel repeat it.
    Reflect,
    /// Black.
    Zero,
}

/// Kornia's `RandomGaussianBlur` with a kernel of odd width, `border_type` `reflect`.
pub(super) fn gaussian(image: &mut Planar, width: usize, sigma: f64) {
    let half = (width / 2) as f64;
    let weight = |at: usize| (-(at as f64 - half).powi(2) / (2.0 * sigma * sigma)).exp();
    let line: Vec<f64> = (0..width).map(weight).collect();
    let sum: f64 = line.iter().sum();
    let values = line.iter().flat_map(|y| line.iter().map(move |x| x * y / (sum * sum))).collect();
    correlate(image, &Kernel { width, values }, Border::Reflect);
}

/// Kornia's `RandomMotionBlur`, `border_type` `constant`, `resample` `nearest`.
pub(super) fn motion(image: &mut Planar, width: usize, degrees: f64, direction: f64) {
    correlate(image, &motion_kernel(width, degrees, direction), Border::Zero);
}

/// Kornia's `get_motion_kernel2d`: a line of weights from `direction` to its opposite, turned
/// anti-clockwise.
fn motion_kernel(width: usize, degrees: f64, direction: f64) -> Kernel {
    let direction = f64::midpoint(direction.clamp(-1.0, 1.0), 1.0);
    let slope = (1.0 - 2.0 * direction) / (width.max(2) - 1) as f64;
    let middle = (width - 1) as f64 / 2.0;
    let back = warp::about([middle, middle], [1.0, 1.0], degrees).try_inverse().unwrap_or_default();
    let mut values = Vec::with_capacity(width * width);
    for row in 0..width {
        for column in 0..width {
            let from = back * Vector3::new(column as f64, row as f64, 1.0);
            let (x, y) = (from.x.round_ties_even(), from.y.round_ties_even());
            let is_on_line = y == middle && x >= 0.0 && x < width as f64;
            values.push(if is_on_line { direction + slope * x } else { 0.0 });
        }
    }
    let sum: f64 = values.iter().sum();
    for value in &mut values {
        *value /= sum;
    }
    Kernel { width, values }
}

fn correlate(image: &mut Planar, kernel: &Kernel, border: Border) {
    let (width, height) = (image.width(), image.height());
    let half = kernel.width / 2;
    // Where a pixel that may lie outside is taken from.
    let inside = |at: usize, shift: usize, side: usize| {
        let at = at.cast_signed() + shift.cast_signed() - half.cast_signed();
        let last = side.cast_signed() - 1;
        match border {
            Border::Zero => (0..=last).contains(&at).then_some(at.cast_unsigned()),
            Border::Reflect if last == 0 => Some(0),
            Border::Reflect => {
                let at = at.rem_euclid(2 * last);
                Some(at.min(2 * last - at).cast_unsigned())
            }
        }
    };
    for plane in image.planes_mut() {
        let mut blurred = Vec::with_capacity(plane.len());
        for row in 0..height {
            for column in 0..width {
                let mut sum = 0.0;
                for (at, weight) in kernel.values.iter().enumerate().filter(|it| *it.1 != 0.0) {
                    let (dy, dx) = (at / kernel.width, at % kernel.width);
                    if let (Some(y), Some(x)) = (inside(row, dy, height), inside(column, dx, width))
                    {
                        sum += weight * plane[y * width + x];
                    }
                }
                blurred.push(sum);
            }
        }
        plane.copy_from_slice(&blurred);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The examples of Kornia's documentation of `get_motion_kernel2d`.
    #[test]
    fn motion_kernels_are_those_of_kornias_documentation() {
        let close = |found: &[f64], expected: &[f64]| {
            found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 5e-5)
        };
        let flat = motion_kernel(5, 0.0, 0.0);
        let expected = [[0.0; 5], [0.0; 5], [0.2; 5], [0.0; 5], [0.0; 5]].concat();
        assert!(close(&flat.values, &expected), "{:?}", flat.values);
        let turned = motion_kernel(3, 215.0, -0.5);
        let expected = [0.0, 0.0, 0.1667, 0.0, 0.3333, 0.0, 0.5, 0.0, 0.0];
        assert!(close(&turned.values, &expected), "{:?}", turned.values);
    }

    /// The example of Kornia's documentation of `motion_blur`'s augmentation: ones, a kernel of 3.
    #[test]
    fn outside_is_black_for_motion_and_mirrored_for_gaussians() {
        let mut image = Planar::grey(5, 5, 1.0);
        motion(&mut image, 3, 0.0, 0.0);
        let row = &image.planes_mut().next().unwrap()[..5];
        let expected = [2.0 / 3.0, 1.0, 1.0, 1.0, 2.0 / 3.0];
        assert!(row.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{row:?}");
        let mut image = Planar::grey(5, 1, 0.5);
        gaussian(&mut image, 7, 2.0);
        assert!(image.planes_mut().flatten().all(|it| (*it - 0.5).abs() < 1e-12));
    }

    /// Weights of a Gaussian by hand: e^(−1/2) beside 1.
    #[test]
    fn a_gaussian_is_one() {
        let mut image = Planar::grey(3, 1, 0.0);
        for plane in image.planes_mut() {
            plane[1] = 1.0;
        }
        gaussian(&mut image, 3, 1.0);
        let side = (-0.5_f64).exp();
        let middle = 1.0 / (1.0 + 2.0 * side);
        let row = image.planes_mut().next().unwrap();
        // The mirror shows the middle on the other side of each end.
        let expected = [2.0 * side * middle, middle, 2.0 * side * middle];
        assert!(row.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{row:?}");
    }
}
