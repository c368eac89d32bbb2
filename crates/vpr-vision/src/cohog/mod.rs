//! CoHOG: convolved histograms of oriented gradients, matched region by region.
//!
//! M. Zaffar, S. Ehsan, M. Milford and K. McDonald-Maier, "CoHOG: A Light-Weight, Compute-Efficient, and
//! Training-Free Visual Place Recognition Technique for Changing Environments", RA-L 2020; chapter 3 of the thesis.
//! The numbers follow the code released with VPR-Bench.
//!
//! ```
//! use vpr_vision::cohog::{CoHog, CoHogParams, similarity};
//! use vpr_vision::image::{ImageSize, RgbImage};
//!
//! let size = ImageSize { width: 64, height: 48 };
//! let noise = (0..64 * 48 * 3u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
//! let image = RgbImage::new(size, noise).unwrap();
//!
//! let cohog = CoHog::new(CoHogParams::default())?;
//! let place = cohog.describe(&image)?;
//! assert_eq!((place.n_regions(), place.depth()), (31 * 31, 32));
//! assert!((similarity(&place, &place)? - 1.0).abs() < 1e-5);
//! # Ok::<(), vpr_core::Error>(())
//! ```

mod best_match;
mod descriptor;
mod entropy;
mod gradient;
mod histogram;
mod interest;
mod matching;

pub use descriptor::{CoHogDescriptor, n_fallbacks};
pub use entropy::local_entropy;
pub use matching::{similarities, similarity};

use serde::{Deserialize, Serialize};
use vpr_core::{Definition, Error, Result};

use crate::image::{GrayImage, ImageSize, RgbImage, gray, resize_bilinear};
use gradient::Gradient;

/// Parameters of [`CoHog`]; the defaults are those of the released code.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CoHogParams {
    /// Side in pixels of the square that every image is resized to, 16 to 4096.
    pub image_size: usize,
    /// Side of a cell in pixels, from 1 to half of `image_size`; a region is 2 × 2 cells. Pixels right of or below
    /// the last whole cell are not used.
    pub cell_size: usize,
    /// Orientations over the full circle; divides 360.
    pub bins: usize,
    /// Share of 8 bits, 0 to 1, that the mean local entropy of a region must reach to be of interest.
    pub entropy_threshold: f64,
    /// [`Definition::Published`] weighs orientations as the released code does; [`Definition::Corrected`] differs in
    /// three points: the strength of a gradient `(x, y)` is its length `√(x² + y²)` and not the signed mean
    /// `|x + y| / 2`, which is zero for every edge at −45°; an angle that rounds to 360° counts as 0° and not for the
    /// last bin; a region without contrast stays zero, where the released code may scale rounding noise to length one.
    pub definition: Definition,
}

impl Default for CoHogParams {
    fn default() -> Self {
        Self {
            image_size: 512,
            cell_size: 16,
            bins: 8,
            entropy_threshold: 0.4,
            definition: Definition::Published,
        }
    }
}

impl CoHogParams {
    /// The released parameters with another cell size: 8, 16, 32, 64, 128, 256 in table 3.9.
    #[must_use]
    pub fn with_cell_size(cell_size: usize) -> Self {
        Self { cell_size, ..Self::default() }
    }

    /// Number of regions of one image: two cells wide and high, one cell apart.
    #[must_use]
    pub const fn n_regions(&self) -> usize {
        let per_side = (self.image_size / self.cell_size).saturating_sub(1);
        per_side * per_side
    }

    /// Length of one region's descriptor: the histograms of its four cells.
    #[must_use]
    pub const fn depth(&self) -> usize {
        4 * self.bins
    }
}

/// Describes images by the gradient orientations of overlapping regions.
#[derive(Clone, Debug)]
pub struct CoHog(CoHogParams);

impl CoHog {
    /// Checks the parameters.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if one is out of range.
    pub fn new(params: CoHogParams) -> Result<Self> {
        let refuse = |name, value: &dyn ToString, reason| {
            Err(Error::Parameter { name, value: value.to_string(), reason })
        };
        let CoHogParams { image_size, cell_size, bins, entropy_threshold, .. } = params;
        if !(16..=4096).contains(&image_size) {
            refuse("image_size", &image_size, "must be from 16 to 4096 pixels")
        } else if !(1..=image_size / 2).contains(&cell_size) {
            refuse("cell_size", &cell_size, "must be from 1 to half of the image size")
        } else if bins == 0 || 360 % bins != 0 {
            refuse("bins", &bins, "must divide 360")
        } else if !(0.0..=1.0).contains(&entropy_threshold) {
            refuse("entropy_threshold", &entropy_threshold, "must be from 0 to 1")
        } else {
            Ok(Self(params))
        }
    }

    /// The parameters.
    #[must_use]
    pub fn params(&self) -> &CoHogParams {
        &self.0
    }

    /// Describes an image of any size.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if the image has no pixels.
    pub fn describe(&self, image: &RgbImage) -> Result<CoHogDescriptor> {
        self.describe_gray(&gray(image))
    }

    /// Describes a gray image of any size.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if the image has no pixels.
    pub fn describe_gray(&self, image: &GrayImage) -> Result<CoHogDescriptor> {
        let params = &self.0;
        let side = params.image_size;
        let image = resize_bilinear(image, ImageSize { width: side, height: side })?;
        let gradient = Gradient::of(&image, params.definition);
        let cells = histogram::cells(&gradient, params);
        let regions = histogram::regions(&cells, params.definition);
        let of_interest = interest::regions_of_interest(&image, params)?;
        CoHogDescriptor::new(regions, of_interest)
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these values are exact")]
mod tests {
    use super::*;

    fn textured() -> GrayImage {
        let size = ImageSize { width: 90, height: 70 };
        let mut state = 7u32;
        let pixels = (0..90 * 70).map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state.to_be_bytes()[0]
        });
        GrayImage::new(size, pixels.collect()).unwrap()
    }

    fn with(change: impl FnOnce(&mut CoHogParams)) -> Result<CoHog> {
        let mut params = CoHogParams::default();
        change(&mut params);
        CoHog::new(params)
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let name = |result: Result<CoHog>| match result {
            Err(Error::Parameter { name, .. }) => name,
            other => panic!("{other:?}"),
        };
        assert_eq!(name(with(|p| p.image_size = 0)), "image_size");
        assert_eq!(name(with(|p| p.cell_size = 0)), "cell_size");
        assert_eq!(name(with(|p| p.cell_size = 257)), "cell_size");
        assert_eq!(name(with(|p| p.bins = 7)), "bins");
        assert_eq!(name(with(|p| p.entropy_threshold = f64::NAN)), "entropy_threshold");
    }

    #[test]
    fn every_cell_size_of_table_3_9_gives_its_number_of_regions() {
        for (cell_size, n_regions) in
            [(8, 3969), (16, 961), (32, 225), (64, 49), (128, 9), (256, 1)]
        {
            let cohog = CoHog::new(CoHogParams::with_cell_size(cell_size)).unwrap();
            assert_eq!(cohog.describe_gray(&textured()).unwrap().n_regions(), n_regions);
        }
    }

    #[test]
    fn an_image_is_most_similar_to_itself() {
        for definition in [Definition::Published, Definition::Corrected] {
            let cohog = with(|p| p.definition = definition).unwrap();
            let place = cohog.describe_gray(&textured()).unwrap();
            assert!((similarity(&place, &place).unwrap() - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn black_images_are_described_and_similar_to_nothing() {
        let black = GrayImage::from_size_val(ImageSize { width: 20, height: 20 }, 0).unwrap();
        let cohog = CoHog::new(CoHogParams::default()).unwrap();
        let black = cohog.describe_gray(&black).unwrap();
        let place = cohog.describe_gray(&textured()).unwrap();
        assert!(black.is_fallback() && !place.is_fallback());
        assert_eq!(n_fallbacks(&[black.clone(), place.clone()]), 1);
        assert_eq!(similarity(&black, &place).unwrap(), 0.0);
    }

    #[test]
    fn corrected_regions_without_contrast_are_zero() {
        // 187 is one of the gray values whose square root leaves rounding noise behind OpenCV's Sobel.
        let flat = GrayImage::from_size_val(ImageSize { width: 20, height: 20 }, 187).unwrap();
        let cohog = with(|p| p.definition = Definition::Corrected).unwrap();
        let regions = cohog.describe_gray(&flat).unwrap();
        assert!(regions.regions().iter().all(|&value| value == 0.0));
    }
}
