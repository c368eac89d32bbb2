//! SIFT through kornia-rs, with the defaults and the order of keypoints of OpenCV.
//!
//! Lowe, *Distinctive Image Features from Scale-Invariant Keypoints*, IJCV 2004. Descriptors are 128 integers from
//! 0 to 255 as OpenCV's `SIFT::detectAndCompute` gives them; nearly all keypoints and descriptors agree with it
//! (`tests/sift_golden.rs`).

use kornia_imgproc::features::{
    DESCR_LEN, FirstOctave, SiftConfig, SiftKeypoint, SiftWorkspace, sift_detect_and_compute,
};
use ndarray::Array2;
use serde::{Deserialize, Serialize};
use vpr_core::{Descriptors, Error, Result};

use crate::{
    features::{Extractor, LocalDescriptors, LocalFeatures},
    image::{GrayImage, RgbImage, gray},
};

/// What counts as a keypoint.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SiftParams {
    /// At most this many keypoints, those of the highest contrast; more only if the last ones tie. 0: no limit.
    pub features: usize,
    /// Whether the image is doubled first, as OpenCV does: about twice the keypoints in four times the time.
    pub doubled: bool,
    /// Octaves of the pyramid; `None`: as many as fit.
    pub octaves: Option<usize>,
    /// Scales per octave that are searched.
    pub octave_layers: usize,
    /// Extrema of less contrast, of an intensity range of 1, are dropped (after division by `octave_layers`).
    pub contrast_threshold: f64,
    /// Extrema on edges, by their ratio of principal curvatures, are dropped above this.
    pub edge_threshold: f64,
    /// Blur of the first layer.
    pub sigma: f64,
}

impl Default for SiftParams {
    /// OpenCV's `SIFT_create()` with the thesis' 5 000 features (chapter 5).
    fn default() -> Self {
        Self {
            features: 5000,
            doubled: true,
            octaves: None,
            octave_layers: 3,
            contrast_threshold: 0.04,
            edge_threshold: 10.0,
            sigma: 1.6,
        }
    }
}

/// No pyramid starts from more pixels than this, after doubling: about 4 GiB of working memory.
pub const MAX_BASE_PIXELS: usize = 1 << 26;

/// Finds and describes the keypoints of a gray image; the order is OpenCV's, by x, then y.
///
/// # Errors
///
/// [`Error::Parameter`] if a parameter is out of range, or if the image has no pixels or, doubled, more than
/// [`MAX_BASE_PIXELS`].
pub fn detect(image: &GrayImage, params: &SiftParams) -> Result<LocalFeatures> {
    let pixels = image.width() * image.height();
    let base = if params.doubled { pixels.saturating_mul(4) } else { pixels };
    if pixels == 0 || base > MAX_BASE_PIXELS {
        return Err(Error::Parameter {
            name: "image",
            value: format!("{}x{}", image.width(), image.height()),
            reason: "SIFT takes at least one pixel, and at most 2^26 after doubling",
        });
    }
    let config = SiftConfig {
        n_features: params.features,
        n_octave_layers: params.octave_layers,
        contrast_threshold: params.contrast_threshold,
        edge_threshold: params.edge_threshold,
        sigma: params.sigma,
    };
    let first = if params.doubled { FirstOctave::Double } else { FirstOctave::Native };
    let octaves = params.octaves.unwrap_or(usize::MAX);
    params.check()?;
    let source: Vec<f32> = image.as_slice().iter().copied().map(f32::from).collect();
    let (width, height) = (image.width(), image.height());
    // A workspace is not kept: kornia 0.2 sizes it by area alone and would index past its octaves
    // when the next image is narrower.
    let mut workspace = SiftWorkspace::new();
    let found = sift_detect_and_compute(
        &mut workspace,
        &source,
        width,
        height,
        &config,
        first,
        octaves,
        false,
    );
    let found = found.map_err(|reason| Error::Parameter {
        name: "sift",
        value: reason.to_string(),
        reason: "kornia refused it",
    })?;
    let rows = Array2::from_shape_fn((found.keypoints.len(), DESCR_LEN), |(row, column)| {
        found.descriptors[row * DESCR_LEN + column]
    });
    LocalFeatures::new(
        found.keypoints.iter().map(|it: &SiftKeypoint| [it.x, it.y]).collect(),
        found.keypoints.iter().map(|it| it.response).collect(),
        LocalDescriptors::Float(Descriptors::new(rows)?),
    )
}

/// SIFT of the gray values of colour images.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sift(pub SiftParams);

impl Extractor for Sift {
    fn name(&self) -> &'static str {
        "sift"
    }

    fn extract(&self, image: &RgbImage) -> Result<LocalFeatures> {
        detect(&gray(image), &self.0)
    }
}

impl SiftParams {
    fn check(&self) -> Result<()> {
        let refuse = |name, value: String, reason| Err(Error::Parameter { name, value, reason });
        if !(1..=16).contains(&self.octave_layers) {
            return refuse("octave_layers", self.octave_layers.to_string(), "must be from 1 to 16");
        }
        if self.octaves == Some(0) {
            return refuse("octaves", "0".to_owned(), "must be at least 1");
        }
        let finite = "must be a finite number above 0";
        for (name, value) in [
            ("contrast_threshold", self.contrast_threshold),
            ("edge_threshold", self.edge_threshold),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return refuse(name, value.to_string(), finite);
            }
        }
        if !(0.5..=16.0).contains(&self.sigma) {
            return refuse("sigma", self.sigma.to_string(), "must be from 0.5 to 16");
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use crate::image::ImageSize;

    use super::*;

    fn blobs(width: usize, height: usize) -> GrayImage {
        let value = |at: usize| {
            let (x, y) = ((at % width) as f32, (at / width) as f32);
            let wave = (x * 0.31).sin() * (y * 0.23).cos() + ((x + 2.0 * y) * 0.07).sin();
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "from 0 to 255"
            )]
            let value = (127.5 + 60.0 * wave) as u8;
            value
        };
        GrayImage::new(ImageSize { width, height }, (0..width * height).map(value).collect())
            .unwrap()
    }

    #[test]
    fn every_small_image_is_answered() {
        for (width, height) in
            [(1, 1), (1, 40), (40, 1), (2, 3), (7, 7), (11, 33), (16, 16), (33, 21)]
        {
            for doubled in [false, true] {
                let params = SiftParams { doubled, ..SiftParams::default() };
                let features = detect(&blobs(width, height), &params).unwrap();
                let inside = |[x, y]: &[f32; 2]| {
                    (0.0..width as f32).contains(x) && (0.0..height as f32).contains(y)
                };
                assert!(features.keypoints().iter().all(inside), "{width}x{height}");
            }
        }
    }

    #[test]
    fn an_image_without_structure_has_no_keypoint() {
        let wall = GrayImage::from_size_val(ImageSize { width: 120, height: 90 }, 77).unwrap();
        let features = detect(&wall, &SiftParams::default()).unwrap();
        assert!(features.is_empty());
        assert_eq!(features.descriptors().as_float().unwrap().dim(), 128);
    }

    #[test]
    fn the_strongest_are_kept() {
        let image = blobs(160, 120);
        let all = detect(&image, &SiftParams { features: 0, ..SiftParams::default() }).unwrap();
        let few = detect(&image, &SiftParams { features: 10, ..SiftParams::default() }).unwrap();
        assert!(all.len() > 20, "{}", all.len());
        let weakest = few.scores().iter().copied().fold(f32::INFINITY, f32::min);
        assert_eq!(few.len(), all.scores().iter().filter(|&&it| it >= weakest).count());
        assert!(few.len() >= 10 && few.len() < 20, "{}", few.len());
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let image = blobs(20, 20);
        let bad = |params: SiftParams| detect(&image, &params).unwrap_err().to_string();
        let default = SiftParams::default();
        assert!(bad(SiftParams { octave_layers: 0, ..default }).starts_with("`octave_layers` = 0"));
        assert!(bad(SiftParams { octaves: Some(0), ..default }).starts_with("`octaves` = 0"));
        assert!(bad(SiftParams { sigma: f64::NAN, ..default }).starts_with("`sigma` = NaN"));
        assert!(
            bad(SiftParams { edge_threshold: -1.0, ..default }).starts_with("`edge_threshold`")
        );
    }
}
