//! Histograms of oriented gradients, as OpenCV's `HOGDescriptor` computes them and VPR-Bench uses them.
//!
//! Dalal and Triggs, *Histograms of Oriented Gradients for Human Detection*, CVPR 2005. OpenCV's constructor with sizes
//! alone leaves gamma correction off, so gradients here are of the plain intensities.

mod gradient;
mod histogram;
mod params;
mod similarity;

use std::borrow::Cow;

use kornia_image::{Image, ImageSize};
use pulp::{Arch, Simd, WithSimd};
use vpr_core::Result;

pub use self::{
    params::HogParams,
    similarity::{similarities, similarity},
};
use crate::image::resize_bilinear;

/// Describes images by histograms of oriented gradients.
///
/// ```
/// use vpr_vision::{hog::{Hog, HogParams}, image::{ImageSize, RgbImage}};
///
/// let hog = Hog::new(HogParams::THESIS)?;
/// let gray_wall = RgbImage::from_size_val(ImageSize { width: 640, height: 480 }, 128).unwrap();
/// assert_eq!(hog.describe(&gray_wall)?, vec![0.0; 34_596]);
/// # Ok::<(), vpr_core::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Hog {
    params: HogParams,
    weights: Vec<f32>,
}

impl Hog {
    /// A describer with these sizes.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::Parameter`] if blocks do not tile the window or cells do not tile the block.
    pub fn new(params: HogParams) -> Result<Self> {
        params.check()?;
        Ok(Self { params, weights: histogram::weights(&params) })
    }

    /// The sizes.
    #[must_use]
    pub fn params(&self) -> &HogParams {
        &self.params
    }

    /// Describes a red-green-blue or gray image by [`HogParams::dim`] numbers from 0 to 1.
    ///
    /// Images of another size than the window are resized to it. Blocks are ordered by column, then by row, and so are
    /// the cells in a block; each has its histogram. An image without gradients gives zeros.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::Parameter`] if the image has no pixels.
    pub fn describe<const C: usize>(&self, image: &Image<u8, C>) -> Result<Vec<f32>> {
        let size = ImageSize { width: self.params.window, height: self.params.window };
        let image = if image.size() == size {
            Cow::Borrowed(image)
        } else {
            Cow::Owned(resize_bilinear(image, size)?)
        };
        let (pixels, _) = image.as_slice().as_chunks::<C>();
        Ok(Arch::new().dispatch(Describe { hog: self, pixels }))
    }
}

/// Compiles [`histogram::describe`] for each instruction set and takes the widest the processor has.
struct Describe<'a, const C: usize> {
    hog: &'a Hog,
    pixels: &'a [[u8; C]],
}

impl<const C: usize> WithSimd for Describe<'_, C> {
    type Output = Vec<f32>;

    #[expect(clippy::inline_always, reason = "takes the instruction set of the caller")]
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<f32> {
        histogram::describe(simd, &self.hog.params, &self.hog.weights, self.pixels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::GrayImage;

    fn gray(width: usize, pixel: impl Fn(usize, usize) -> usize) -> GrayImage {
        let pixel = |at: usize| u8::try_from(pixel(at % width, at / width)).unwrap();
        let pixels = (0..width * width).map(pixel).collect();
        GrayImage::new(ImageSize { width, height: width }, pixels).unwrap()
    }

    #[test]
    fn every_configuration_has_its_published_length() {
        let dim = |params: HogParams| {
            let image = gray(64, |x, y| (x * 7 + y * 3) % 256);
            let descriptor = Hog::new(params).unwrap().describe(&image).unwrap();
            assert_eq!(descriptor.len(), params.dim());
            params.dim()
        };
        assert_eq!(dim(HogParams::RELEASED), 35_721);
        assert_eq!(dim(HogParams::THESIS), 34_596);
        let sweep = [8, 16, 32, 64, 128].map(|cell| dim(HogParams::THESIS.with_cell_size(cell)));
        assert_eq!(sweep, [142_884, 34_596, 8_100, 1_764, 324]);
    }

    #[test]
    fn constant_image_gives_zeros() {
        for params in [HogParams::RELEASED, HogParams::THESIS] {
            let descriptor = Hog::new(params).unwrap().describe(&gray(512, |_, _| 200)).unwrap();
            assert!(descriptor.iter().all(|&it| it == 0.0));
        }
    }

    /// A ramp along x has gradients of direction 0 only, half-way between the first and the last bin.
    #[test]
    fn horizontal_ramp_votes_equally_for_first_and_last_bin() {
        let params = HogParams { window: 8, block: 8, stride: 8, cell: 8, bins: 9 };
        let descriptor = Hog::new(params).unwrap().describe(&gray(8, |x, _| 10 * x)).unwrap();
        assert!((descriptor[0] - descriptor[8]).abs() < 1e-6);
        assert!(descriptor[1..8].iter().all(|&it| it == 0.0), "{descriptor:?}");
        let half = 0.2 / ((2.0 * 0.2_f32.powi(2)).sqrt() + 1e-3);
        assert!((descriptor[0] - half).abs() < 1e-6, "{} {half}", descriptor[0]);
    }

    /// Inside, the direction is 45°: 2¼ bins, between the centres of bins 1 and 2. At the border one axis has no
    /// gradient, so the direction is 0° (bins 8 and 0) or 90° (bin 4).
    #[test]
    fn diagonal_ramp_votes_between_two_bins_and_for_its_border() {
        let params = HogParams { window: 4, block: 4, stride: 4, cell: 4, bins: 9 };
        let ramp = gray(4, |x, y| 2 * (x + y));
        let descriptor = Hog::new(params).unwrap().describe(&ramp).unwrap();
        let voted: Vec<usize> = (0..9).filter(|&bin| descriptor[bin] > 0.0).collect();
        assert_eq!(voted, [0, 1, 2, 4, 8], "{descriptor:?}");
    }

    #[test]
    fn strongest_channel_counts() {
        let params = HogParams { window: 16, block: 16, stride: 8, cell: 8, bins: 9 };
        let hog = Hog::new(params).unwrap();
        let strong = gray(16, |x, y| (x * x + 3 * y) % 256);
        for channel in 0..3 {
            let pixels = strong.as_slice().iter().flat_map(|&value| {
                let mut pixel = [7, 7, 7];
                pixel[channel] = value;
                pixel
            });
            let rgb = Image::<u8, 3>::new(strong.size(), pixels.collect()).unwrap();
            assert_eq!(hog.describe(&rgb).unwrap(), hog.describe(&strong).unwrap());
        }
    }

    #[test]
    fn sizes_that_do_not_fit_are_refused_by_name() {
        let refused = |params: HogParams| Hog::new(params).unwrap_err().to_string();
        let thesis = HogParams::THESIS;
        assert!(refused(HogParams { stride: 7, ..thesis }).starts_with("`stride` = 7"));
        assert!(refused(HogParams { stride: 0, ..thesis }).starts_with("`stride` = 0"));
        assert!(refused(HogParams { cell: 5, ..thesis }).starts_with("`cell` = 5"));
        assert!(refused(HogParams { cell: 0, ..thesis }).starts_with("`cell` = 0"));
        assert!(refused(HogParams { block: 1024, ..thesis }).starts_with("`block` = 1024"));
        assert!(refused(HogParams { bins: 1, ..thesis }).starts_with("`bins` = 1"));
        assert!(refused(HogParams { window: 1 << 20, ..thesis }).starts_with("`window` = 1048576"));
    }

    #[test]
    fn image_without_pixels_is_refused() {
        let empty = GrayImage::new(ImageSize { width: 0, height: 0 }, vec![]).unwrap();
        assert!(Hog::new(HogParams::THESIS).unwrap().describe(&empty).is_err());
    }

    #[test]
    fn odd_sizes_agree_with_the_definition() {
        let params = HogParams { window: 45, block: 15, stride: 10, cell: 5, bins: 7 };
        let image = gray(45, |x, y| (x * 31 + y * 17 + x * y) % 256);
        let fast = Hog::new(params).unwrap().describe(&image).unwrap();
        let slow = definition(&params, &image);
        let worst = fast.iter().zip(&slow).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(worst < 2e-3, "{worst}"); // the polynomial arc tangent is off by up to 0.3°
    }

    /// Pixel by pixel, with the exact arc tangent.
    #[expect(clippy::cast_possible_truncation, reason = "descriptors are f32, bins are few")]
    #[expect(clippy::cast_sign_loss, reason = "bins are not negative")]
    fn definition(params: &HogParams, image: &GrayImage) -> Vec<f32> {
        let &HogParams { window, block, stride, cell, bins } = params;
        // coordinates are one more than those of the image, so that the border is not negative
        let mirrored = |at: usize| match at {
            0 => 1,
            _ if at > window => window - 2,
            _ => at - 1,
        };
        let pixel =
            |x: usize, y: usize| f64::from(image.as_slice()[mirrored(y) * window + mirrored(x)]);
        let (cells, blocks) = (block / cell, (window - block) / stride + 1);
        let mut descriptor = Vec::new();
        for (left, top) in
            (0..blocks * blocks).map(|at| (at / blocks * stride, at % blocks * stride))
        {
            let mut histograms = vec![0.0; cells * cells * bins];
            for (j, i) in (0..block * block).map(|at| (at % block, at / block)) {
                let (x, y) = (left + j + 1, top + i + 1);
                let (dx, dy) =
                    (pixel(x + 1, y) - pixel(x - 1, y), pixel(x, y + 1) - pixel(x, y - 1));
                let turn = dy.atan2(dx).rem_euclid(std::f64::consts::PI) / std::f64::consts::PI;
                let position = turn * bins as f64 - 0.5;
                let lower = position.floor();
                let off = |at: usize| (at as f64 - block as f64 / 2.0).powi(2);
                let gaussian = (-(off(i) + off(j)) / (block * block) as f64 * 8.0).exp();
                let tent = |at: usize, c: usize| {
                    (1.0 - ((at as f64 + 0.5) / cell as f64 - 0.5 - c as f64).abs()).max(0.0)
                };
                for (cx, cy) in (0..cells * cells).map(|at| (at / cells, at % cells)) {
                    for (bin, share) in
                        [(lower, 1.0 - position + lower), (lower + 1.0, position - lower)]
                    {
                        let bin = bin.rem_euclid(bins as f64) as usize;
                        histograms[(cx * cells + cy) * bins + bin] +=
                            dx.hypot(dy) * gaussian * tent(j, cx) * tent(i, cy) * share;
                    }
                }
            }
            let length = |it: &[f64]| it.iter().map(|it| it * it).sum::<f64>().sqrt();
            let scale = length(&histograms) + 0.1 * histograms.len() as f64;
            for it in &mut histograms {
                *it = (*it / scale).min(0.2);
            }
            let scale = length(&histograms) + 1e-3;
            descriptor.extend(histograms.iter().map(|it| (it / scale) as f32));
        }
        descriptor
    }
}
