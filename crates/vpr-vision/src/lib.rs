//! Images and hand-crafted vision for visual place recognition.
//!
//! ```
//! use vpr_vision::{image, matching, ransac, sift};
//!
//! let size = image::ImageSize { width: 160, height: 120 };
//! let pixels = (0..160 * 120).map(|at| ((at % 160 / 9 * 37) ^ (at / 160 / 7 * 91)) as u8).collect();
//! let street = image::GrayImage::new(size, pixels).unwrap();
//! let features = sift::detect(&street, &sift::SiftParams::default())?;
//!
//! let matches = matching::match_features(&features, &features, &matching::MatchParams::MUTUAL)?;
//! let points = ransac::correspondences(&features, &features, &matches);
//! let inliers = ransac::homography(&points, &ransac::RansacParams::HOMOGRAPHY)?;
//! assert_eq!(inliers.count(), matches.len());
//! # Ok::<(), vpr_core::Error>(())
//! ```

pub mod cohog;
pub mod dense_sift;
pub mod features;
pub mod hog;
pub mod image;
pub mod matching;
pub mod orb;
pub mod ransac;
pub mod sift;
pub mod vlad;

/// Version of the numbers: raised when a feature, matcher or estimator gives other bits for the
/// same input. Whoever keeps results keeps it with them, so that they are not taken for another
/// version's.
pub const NUMERICS: u32 = 3;

/// The examples of the README, as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
