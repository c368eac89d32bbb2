//! ORB through kornia-rs: oriented FAST corners and 256 rotated binary tests.
//!
//! Rublee et al., *ORB: An Efficient Alternative to SIFT or SURF*, ICCV 2011; the spread of keypoints over the image
//! by a quadtree is that of ORB-SLAM3.

use kornia_image::Image;
use kornia_imgproc::features::{HarrisResponse, OrbDetector};
use serde::{Deserialize, Serialize};
use vpr_core::{Error, Result};

use crate::{
    features::{BinaryDescriptors, Extractor, LocalDescriptors, LocalFeatures},
    image::{GrayImage, RgbImage, gray},
};

/// How many keypoints on which scales.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct OrbParams {
    /// Keypoints that the quadtree aims at, over all levels; the last split may give some more.
    pub features: usize,
    /// Levels of the pyramid.
    pub levels: usize,
    /// Ratio of the sizes of two levels.
    pub scale_factor: f32,
    /// Difference of intensity, of 255, that makes a corner.
    pub fast_threshold: u8,
}

impl Default for OrbParams {
    fn default() -> Self {
        Self { features: 500, levels: 8, scale_factor: 1.2, fast_threshold: 20 }
    }
}

/// Bytes of a descriptor.
pub const ROW_BYTES: usize = 32;

/// Images below this on a side have no room for a descriptor (patches reach 19 pixels from a corner).
const MIN_SIDE: usize = 2 * 20 + 1;

/// Finds and describes the corners of a gray image, level after level.
///
/// Scores are Harris responses (k = 0.04) of the full image at the keypoint. Images of fewer than 41 pixels on a side
/// have no keypoint.
///
/// # Errors
///
/// [`Error::Parameter`] if a parameter is out of range.
pub fn detect(image: &GrayImage, params: &OrbParams) -> Result<LocalFeatures> {
    params.check()?;
    if image.width().min(image.height()) < MIN_SIDE {
        return assemble(image, &[], &[]);
    }
    // Levels that have no room for a patch are left out: kornia 0.2 computes with their size.
    let side = image.width().min(image.height()) as f32;
    let fitting = (0..params.levels).take_while(|&level| {
        side / params.scale_factor.powf(level as f32) >= MIN_SIDE as f32 + 1.0
    });
    let detector = OrbDetector {
        n_keypoints: params.features,
        n_scales: fitting.count().max(1),
        downscale: params.scale_factor,
        ini_fast_threshold: f32::from(params.fast_threshold) / 255.0,
        min_fast_threshold: f32::from(params.fast_threshold.min(7)) / 255.0,
        ..OrbDetector::default()
    };
    let found = detector.detect_and_extract_u8(image).map_err(|reason| Error::Parameter {
        name: "image",
        value: format!("{}x{}: {reason}", image.width(), image.height()),
        reason: "ORB needs an image that kornia can shrink",
    })?;
    assemble(image, &found.keypoints_xy, &found.descriptors)
}

fn assemble(
    image: &GrayImage,
    keypoints: &[[f32; 2]],
    rows: &[[u8; ROW_BYTES]],
) -> Result<LocalFeatures> {
    let scores = if keypoints.is_empty() { Vec::new() } else { harris(image, keypoints) };
    let bits = BinaryDescriptors::new(ROW_BYTES, rows.as_flattened().to_vec())?;
    LocalFeatures::new(keypoints.to_vec(), scores, LocalDescriptors::Binary(bits))
}

/// Harris responses at the pixels nearest to the keypoints.
fn harris(image: &GrayImage, keypoints: &[[f32; 2]]) -> Vec<f32> {
    let size = image.size();
    let mut response = Image::<f32, 1>::from_size_val(size, 0.0).expect("the size of an image");
    HarrisResponse::new(size)
        .compute_u8(image, &mut response)
        .expect("an image with room for a patch has two rows and two columns");
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the image"
    )]
    let pixel = |value: f32, len: usize| value.round().clamp(0.0, len as f32 - 1.0) as usize;
    let at = |&[x, y]: &[f32; 2]| {
        response.as_slice()[pixel(y, size.height) * size.width + pixel(x, size.width)]
    };
    keypoints.iter().map(at).collect()
}

/// ORB of the gray values of colour images.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Orb(pub OrbParams);

impl Extractor for Orb {
    fn name(&self) -> &'static str {
        "orb"
    }

    fn extract(&self, image: &RgbImage) -> Result<LocalFeatures> {
        detect(&gray(image), &self.0)
    }
}

impl OrbParams {
    fn check(&self) -> Result<()> {
        let refuse = |name, value: String, reason| Err(Error::Parameter { name, value, reason });
        if self.features == 0 {
            return refuse("features", "0".to_owned(), "must be at least 1");
        }
        if !(1..=32).contains(&self.levels) {
            return refuse("levels", self.levels.to_string(), "must be from 1 to 32");
        }
        if !(1.01..=4.0).contains(&self.scale_factor) {
            return refuse("scale_factor", self.scale_factor.to_string(), "must be from 1.01 to 4");
        }
        if self.fast_threshold == 0 {
            return refuse("fast_threshold", "0".to_owned(), "must be at least 1");
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use crate::image::ImageSize;

    use super::*;

    fn checkers(width: usize, height: usize) -> GrayImage {
        let value = |at: usize| {
            let (x, y) = (at % width, at / width);
            if (x / 9 + y / 7).is_multiple_of(2) {
                30
            } else {
                200 + u8::try_from((x + y) % 40).unwrap()
            }
        };
        GrayImage::new(ImageSize { width, height }, (0..width * height).map(value).collect())
            .unwrap()
    }

    #[test]
    fn every_small_image_is_answered() {
        for (width, height) in
            [(1, 1), (1, 60), (60, 1), (40, 200), (41, 41), (42, 60), (64, 48), (90, 500)]
        {
            for levels in [1, 8, 32] {
                let params = OrbParams { levels, ..OrbParams::default() };
                let features = detect(&checkers(width, height), &params).unwrap();
                let inside = |[x, y]: &[f32; 2]| {
                    (0.0..width as f32).contains(x) && (0.0..height as f32).contains(y)
                };
                assert!(features.keypoints().iter().all(inside), "{width}x{height}");
            }
        }
    }

    #[test]
    fn corners_are_found_and_described() {
        let features = detect(&checkers(320, 240), &OrbParams::default()).unwrap();
        assert!(features.len() > 200, "{}", features.len());
        assert_eq!(features.descriptors().as_binary().unwrap().row_bytes(), 32);
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let image = checkers(64, 64);
        let bad = |params: OrbParams| detect(&image, &params).unwrap_err().to_string();
        let default = OrbParams::default();
        assert!(bad(OrbParams { features: 0, ..default }).starts_with("`features` = 0"));
        assert!(bad(OrbParams { levels: 0, ..default }).starts_with("`levels` = 0"));
        assert!(bad(OrbParams { scale_factor: 1.0, ..default }).starts_with("`scale_factor` = 1"));
    }
}
