//! Bicubic resize of 8-bit images as OpenCV's `INTER_CUBIC`.

use kornia_image::{Image, ImageSize};
use vpr_core::Result;

use super::{from_pixels, resize::check};

/// What a weight of one is kept as.
const ONE: f32 = 2048.0;
/// The slope of OpenCV's cubic.
const SLOPE: f32 = -0.75;

/// The four pixels that one target pixel comes from along an axis.
struct Tap {
    at: [usize; 4],
    weights: [i32; 4],
}

/// Bicubic resize without anti-aliasing, as OpenCV's `resize` with `INTER_CUBIC`: whole weights of
/// 11 binary digits along x, products in single precision along y. About one byte in twenty is a level off.
///
/// # Errors
///
/// As [`super::resize_bilinear`].
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to a byte")]
pub fn resize_bicubic<const C: usize>(
    image: &Image<u8, C>,
    size: ImageSize,
) -> Result<Image<u8, C>> {
    check(image.size())?;
    check(size)?;
    let across = taps(image.width(), size.width);
    let down = taps(image.height(), size.height);
    let (pixels, _) = image.as_slice().as_chunks::<C>();
    let mut rows: Vec<Vec<f32>> = Vec::with_capacity(image.height());
    for row in pixels.chunks_exact(image.width()) {
        let mut sums = Vec::with_capacity(size.width * C);
        for Tap { at, weights } in &across {
            sums.extend((0..C).map(|channel| {
                let parts = at.iter().zip(weights);
                parts.map(|(&x, weight)| i32::from(row[x][channel]) * weight).sum::<i32>() as f32
            }));
        }
        rows.push(sums);
    }
    let mut resized = Vec::with_capacity(size.width * size.height * C);
    for Tap { at, weights } in down {
        let weights = weights.map(|weight| weight as f32 / (ONE * ONE));
        let [first, second, third, fourth] = at.map(|y| &rows[y]);
        resized.extend((0..size.width * C).map(|x| {
            let inner = weights[2] * third[x] + weights[3] * fourth[x];
            let sum = weights[0] * first[x] + (weights[1] * second[x] + inner);
            sum.round_ties_even().clamp(0.0, 255.0) as u8
        }));
    }
    Ok(from_pixels(size, resized))
}

#[expect(clippy::cast_possible_truncation, reason = "positions are below 2^26")]
fn taps(source: usize, target: usize) -> Vec<Tap> {
    let last = i64::try_from(source - 1).expect("at most 2^26");
    let scale = 1.0 / (target as f64 / source as f64);
    let tap = |pixel: usize| {
        let position = ((pixel as f64 + 0.5) * scale - 0.5) as f32;
        let first = position.floor();
        let x = position - first;
        let outer = |x: f32| ((SLOPE * x - 5.0 * SLOPE) * x + 8.0 * SLOPE) * x - 4.0 * SLOPE;
        let inner = |x: f32| ((SLOPE + 2.0) * x - (SLOPE + 3.0)) * x * x + 1.0;
        let three = [outer(x + 1.0), inner(x), inner(1.0 - x)];
        let all = [three[0], three[1], three[2], 1.0 - three[0] - three[1] - three[2]];
        let inside = |it: i64| usize::try_from(it.clamp(0, last)).expect("not negative");
        Tap {
            at: [-1, 0, 1, 2].map(|off| inside(first as i64 + off)),
            weights: all.map(|weight| (weight * ONE).round_ties_even() as i32),
        }
    };
    (0..target).map(tap).collect()
}

#[cfg(test)]
mod tests {
    use super::{super::tests::noise, *};

    /// The first six bytes of `cv2.resize(noise, size, interpolation=INTER_CUBIC)`, OpenCV 4.14.0.
    #[test]
    fn resize_is_that_of_opencv_within_a_level() {
        for (width, height, expected) in [
            (64, 64, [0, 255, 254, 189, 220, 207]),
            (20, 11, [0, 185, 172, 183, 162, 150]),
            (160, 120, [0, 255, 255, 0, 255, 254]),
        ] {
            let resized = resize_bicubic(&noise(53, 37), ImageSize { width, height }).unwrap();
            for (ours, theirs) in resized.as_slice().iter().zip(expected) {
                assert!(ours.abs_diff(theirs) <= 1, "{width} x {height}: {ours} {theirs}");
            }
        }
    }

    #[test]
    fn images_without_pixels_are_not_resized() {
        let empty = ImageSize { width: 0, height: 4 };
        assert!(resize_bicubic(&noise(4, 4), empty).is_err());
    }
}
