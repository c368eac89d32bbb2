//! Which regions are worth matching: those of high local entropy.

use kornia_image::{Image, InterpolationMode};
use kornia_imgproc::resize::resize_opencv_f32;
use ndarray::{ArrayView2, s};
use vpr_core::Result;

use super::{CoHogParams, entropy::local_entropy};
use crate::image::{GrayImage, ImageSize, resize_bilinear};

/// Side of the image that local entropy is computed on.
const ENTROPY_SIZE: ImageSize = ImageSize { width: 100, height: 100 };

/// Radius of its disk, in pixels of that image.
const RADIUS: u8 = 5;

/// Most bits of entropy that 8-bit pixels can have.
const MAX_ENTROPY: f64 = 8.0;

/// One flag per region, row by row; `image` is the resized one.
pub(super) fn regions_of_interest(image: &GrayImage, params: &CoHogParams) -> Result<Vec<bool>> {
    let entropy = mean_entropy(image, params)?;
    Ok(entropy.into_iter().map(|share| share >= params.entropy_threshold).collect())
}

/// Mean local entropy of every region as a share of 8 bits.
fn mean_entropy(image: &GrayImage, params: &CoHogParams) -> Result<Vec<f64>> {
    let entropy = local_entropy(&resize_bilinear(image, ENTROPY_SIZE)?, RADIUS);
    let entropy = enlarge(entropy.view(), image.size());
    let map = ArrayView2::from_shape((image.height(), image.width()), entropy.as_slice())
        .expect("height × width values");
    let (cell, n_cells) = (params.cell_size, params.image_size / params.cell_size);
    let side = 2 * cell;
    let mean = |top: usize, left: usize| {
        let region = map.slice(s![top..top + side, left..left + side]);
        region.iter().map(|&bits| f64::from(bits)).sum::<f64>() / (side * side) as f64 / MAX_ENTROPY
    };
    let corners =
        (0..n_cells - 1).flat_map(|y| (0..n_cells - 1).map(move |x| (y * cell, x * cell)));
    Ok(corners.map(|(top, left)| mean(top, left)).collect())
}

/// Bilinear resize as OpenCV's, in f32.
fn enlarge(map: ArrayView2<'_, f64>, size: ImageSize) -> Image<f32, 1> {
    #[expect(clippy::cast_possible_truncation, reason = "bits of entropy, 0 to 8")]
    let values = map.iter().map(|&bits| bits as f32).collect();
    let map = Image::<f32, 1>::new(ENTROPY_SIZE, values).expect("100 × 100 values");
    let mut enlarged = Image::from_size_val(size, 0.0).expect("a checked size");
    resize_opencv_f32(&map, &mut enlarged, InterpolationMode::Bilinear).expect("sizes above zero");
    enlarged
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_textured_half_is_of_interest() {
        let mut state = 1u32;
        let pixels = (0..512 * 512).map(|i| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            if i % 512 < 256 { 90 } else { state.to_be_bytes()[0] }
        });
        let image =
            GrayImage::new(ImageSize { width: 512, height: 512 }, pixels.collect()).unwrap();
        let flags = regions_of_interest(&image, &CoHogParams::default()).unwrap();
        for (region, of_interest) in flags.into_iter().enumerate() {
            match region % 31 {
                0..=12 => assert!(!of_interest, "region {region}"),
                18.. => assert!(of_interest, "region {region}"),
                _ => {}
            }
        }
    }
}
