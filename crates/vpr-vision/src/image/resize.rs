//! Bilinear resize of 8-bit images, byte for byte that of OpenCV.

use kornia_image::{Image, ImageSize};
use vpr_core::{Error, Result};

use super::{MAX_PIXELS, from_pixels};

/// Binary digits of a weight.
const WEIGHT_BITS: u32 = 11;

/// Bilinear resize without anti-aliasing, byte for byte OpenCV's `resize` with `INTER_LINEAR`.
///
/// Weights have 11 binary digits and are applied along x, then along y. Beyond the first and last pixel centre the
/// border repeats; along y OpenCV still adds the border row to itself with two weights, each product rounded down, so
/// that such rows may be one level darker than their source. (kornia-imgproc's `resize_opencv_u8` leaves that out.)
///
/// # Errors
///
/// [`Error::Parameter`] if either image has no pixels or more than [`MAX_PIXELS`].
pub fn resize_bilinear<const C: usize>(
    image: &Image<u8, C>,
    size: ImageSize,
) -> Result<Image<u8, C>> {
    check(image.size())?;
    check(size)?;
    let across = taps(image.width(), size.width, Border::OnePixel);
    let down = taps(image.height(), size.height, Border::TwoWeights);
    let (pixels, _) = image.as_slice().as_chunks::<C>();
    let rows: Vec<&[[u8; C]]> = pixels.chunks_exact(image.width()).collect();

    let mut resized = Vec::with_capacity(size.width * size.height * C);
    // the two source rows in use, already resized along x
    let mut cache: [(usize, Vec<i32>); 2] = std::array::from_fn(|_| (usize::MAX, Vec::new()));
    for Tap { at, weights } in down {
        if cache[1].0 == at[0] {
            cache.swap(0, 1);
        }
        for (cached, at) in cache.iter_mut().zip(at) {
            if cached.0 != at {
                *cached = (at, resize_row(rows[at], &across));
            }
        }
        resized.extend(
            cache[0].1.iter().zip(&cache[1].1).map(|(&it, &next)| blend([it, next], weights)),
        );
    }
    Ok(from_pixels(size, resized))
}

/// Sums along x of two rows become a pixel; OpenCV's SIMD code keeps 16 bits of each product.
fn blend(sums: [i32; 2], weights: [i32; 2]) -> u8 {
    let [upper, lower] = [0, 1].map(|row| (weights[row] * (sums[row] >> 4)) >> 16);
    u8::try_from((upper + lower + 2) >> 2).expect("the weights sum to one")
}

pub(super) fn check(size: ImageSize) -> Result<()> {
    match size.width.checked_mul(size.height) {
        Some(1..=MAX_PIXELS) => Ok(()),
        _ => Err(Error::Parameter {
            name: "size",
            value: format!("{}x{}", size.width, size.height),
            reason: "an image has at least one pixel and at most 2^26",
        }),
    }
}

/// Where one target pixel comes from along one axis.
struct Tap {
    at: [usize; 2],
    weights: [i32; 2],
}

/// What happens before the first and after the last pixel centre.
#[derive(Clone, Copy, PartialEq)]
enum Border {
    /// The border pixel has the whole weight.
    OnePixel,
    /// The border pixel takes both weights.
    TwoWeights,
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "OpenCV rounds positions to f32; they are below 2^26"
)]
fn taps(source: usize, target: usize, border: Border) -> Vec<Tap> {
    let last = i64::try_from(source - 1).expect("at most 2^26");
    let scale = 1.0 / (target as f64 / source as f64);
    let tap = |pixel: usize| {
        let position = ((pixel as f64 + 0.5) * scale - 0.5) as f32;
        let first = position.floor() as i64;
        let outside = first < 0 || first >= last;
        let fraction = match border {
            Border::OnePixel if outside => 0.0,
            _ => position - position.floor(),
        };
        let weight = |it: f32| (it * (1 << WEIGHT_BITS) as f32).round_ties_even() as i32;
        let inside = |it: i64| usize::try_from(it.clamp(0, last)).expect("not negative");
        Tap {
            at: [inside(first), inside(first + 1)],
            weights: [weight(1.0 - fraction), weight(fraction)],
        }
    };
    (0..target).map(tap).collect()
}

fn resize_row<const C: usize>(row: &[[u8; C]], taps: &[Tap]) -> Vec<i32> {
    let mut sums = Vec::with_capacity(taps.len() * C);
    for Tap { at, weights } in taps {
        let pixels = at.map(|it| row[it]);
        sums.extend((0..C).map(|channel| {
            i32::from(pixels[0][channel]) * weights[0] + i32::from(pixels[1][channel]) * weights[1]
        }));
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::{
        super::tests::{digest, noise},
        *,
    };

    /// Digests of `cv2.resize(noise, size)`, OpenCV 4.14.0.
    #[test]
    fn resize_is_that_of_opencv() {
        let image = noise(53, 37);
        for (width, height, expected) in [
            (64, 64, 0xb1a9_c0ca_bea3_49bc),
            (512, 512, 0x94d8_cf6f_4d55_3832),
            (20, 11, 0xf6e0_f17e_5be1_a02d),
            (53, 37, 0x7535_8260_65f3_dec6),
            (106, 74, 0xd1a6_fce7_ed96_92d1),
            (27, 19, 0x6503_923a_2d0b_1ddf),
            (1, 1, 0xa094_b718_dcf2_9db8),
            (240, 9, 0x34eb_9184_e858_85a4),
        ] {
            let resized = resize_bilinear(&image, ImageSize { width, height }).unwrap();
            assert_eq!(digest(resized.as_slice()), expected, "{width} x {height}");
        }
        let half = resize_bilinear(&noise(60, 40), ImageSize { width: 30, height: 20 }).unwrap();
        assert_eq!(digest(half.as_slice()), 0x07be_82d3_368f_6140);
    }

    #[test]
    fn images_without_pixels_are_not_resized() {
        let (empty, full) = (ImageSize { width: 0, height: 4 }, ImageSize { width: 4, height: 4 });
        assert!(resize_bilinear(&noise(4, 4), empty).is_err());
        assert!(resize_bilinear(&noise(0, 4), full).is_err());
        assert!(resize_bilinear(&noise(4, 4), ImageSize { width: usize::MAX, height: 2 }).is_err());
    }
}
