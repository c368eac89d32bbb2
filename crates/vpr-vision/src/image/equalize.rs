//! Histogram equalisation of the luma of a colour image, as VPR-Bench's AlexNet and CALC begin.

use super::{RgbImage, from_pixels};

/// Binary digits of a weight of the colour conversions.
const BITS: i32 = 14;
/// Half of one, for rounding.
const HALF: i32 = 1 << (BITS - 1);
/// What chroma is shifted by.
const MIDDLE: i32 = 128;

/// OpenCV's `cvtColor(BGR2YUV)`, `equalizeHist` of Y, `cvtColor(YUV2BGR)`, byte for byte.
///
/// An image of a single luma keeps it.
#[must_use]
pub fn equalize_luma(image: &RgbImage) -> RgbImage {
    let (pixels, _) = image.as_slice().as_chunks::<3>();
    let converted: Vec<[u8; 3]> = pixels.iter().map(|&pixel| to_yuv(pixel)).collect();
    let table = equalizing(&converted);
    let equalized = converted.iter().flat_map(|&[y, u, v]| to_rgb([table[usize::from(y)], u, v]));
    from_pixels(image.size(), equalized.collect())
}

fn to_yuv([r, g, b]: [u8; 3]) -> [u8; 3] {
    let [r, g, b] = [r, g, b].map(i32::from);
    let y = (4899 * r + 9617 * g + 1868 * b + HALF) >> BITS;
    let chroma =
        |difference: i32, weight: i32| (difference * weight + (MIDDLE << BITS) + HALF) >> BITS;
    [byte(y), byte(chroma(b - y, 8061)), byte(chroma(r - y, 14_369))]
}

fn to_rgb([y, u, v]: [u8; 3]) -> [u8; 3] {
    let [y, u, v] = [i32::from(y), i32::from(u) - MIDDLE, i32::from(v) - MIDDLE];
    let add = |chroma: i32| byte(y + ((chroma + HALF) >> BITS));
    [add(18_678 * v), add(-6472 * u - 9519 * v), add(33_292 * u)]
}

/// Where every luma goes: in proportion to how many pixels are darker or equal, the darkest to 0.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255, rounded")]
fn equalizing(pixels: &[[u8; 3]]) -> [u8; 256] {
    let mut counts = [0_u32; 256];
    for pixel in pixels {
        counts[usize::from(pixel[0])] += 1;
    }
    let mut table: [u8; 256] = std::array::from_fn(|at| at as u8);
    let Some(darkest) = counts.iter().position(|&n| n > 0) else { return table };
    let others = pixels.len() as u32 - counts[darkest];
    if others == 0 {
        return table;
    }
    let scale = 255.0 / others as f32;
    let mut sum = 0;
    table[darkest] = 0;
    for at in darkest + 1..256 {
        sum += counts[at];
        table[at] = (sum as f32 * scale).round_ties_even().clamp(0.0, 255.0) as u8;
    }
    table
}

#[expect(clippy::cast_sign_loss, reason = "clamped")]
fn byte(value: i32) -> u8 {
    value.clamp(0, 255) as u8
}

#[cfg(test)]
mod tests {
    use super::{
        super::{
            ImageSize,
            tests::{digest, noise},
        },
        *,
    };

    /// Digest of what OpenCV 4.14.0 makes of the same pixels, taken for blue, green, red.
    #[test]
    fn equalisation_is_that_of_opencv() {
        let image = noise(53, 37);
        let dark: Vec<u8> = image.as_slice().iter().map(|it| 40 + it / 3).collect();
        let dark = from_pixels::<3>(image.size(), dark);
        assert_eq!(digest(equalize_luma(&dark).as_slice()), EQUALIZED);
    }

    const EQUALIZED: u64 = 0x3628_b107_1326_85e7;

    #[test]
    fn one_luma_stays_as_it_is() {
        let size = ImageSize { width: 4, height: 3 };
        let gray = from_pixels::<3>(size, vec![77; 36]);
        assert_eq!(equalize_luma(&gray).as_slice(), gray.as_slice());
    }
}
