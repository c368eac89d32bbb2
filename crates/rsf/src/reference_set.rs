//! The images of a map and where they were taken: all that fine-tuning sees.

use std::path::PathBuf;

use rand::{SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use vpr_core::{Error as CoreError, Poses};
use vpr_vision::image::{self, ImageSize, RgbImage, resize_bilinear};

use crate::{Error, Result};

/// References that lie behind one another are held out together: this many.
const RUN: usize = 5;

/// The references of a map, with poses if they are known (thesis eqs. 4.1 and 4.2).
///
/// There is no place in it for a query: queries of fine-tuning are made of these images, so what is
/// learned cannot depend on an image that the map does not have.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceSet {
    images: Vec<PathBuf>,
    poses: Option<Poses>,
}

/// References that are learned from, and those that only judge; both in rising order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Split {
    /// Learned from.
    pub training: Vec<usize>,
    /// Held out.
    pub held_out: Vec<usize>,
}

impl ReferenceSet {
    /// Image files of a map and the poses of their cameras.
    ///
    /// # Errors
    ///
    /// [`Error::TooFew`] below two images; [`CoreError::Mismatch`] if there is not a pose for every
    /// image; [`CoreError::NotFinite`] for a pose with a number that is none.
    pub fn new(images: Vec<PathBuf>, poses: Option<Poses>) -> Result<Self> {
        if images.len() < 2 {
            let purpose = "to tell places apart";
            return Err(Error::TooFew { n: images.len(), needed: 2, purpose });
        }
        if let Some(poses) = &poses {
            let (expected, actual) = (images.len(), poses.len());
            if expected != actual {
                let what = "poses of the references";
                return Err(CoreError::Mismatch { what, expected, actual }.into());
            }
            poses.check_finite()?;
        }
        Ok(Self { images, poses })
    }

    /// Number of images.
    #[must_use]
    pub fn len(&self) -> usize {
        self.images.len()
    }

    /// Whether there is no image; there always are two.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.images.is_empty()
    }

    /// The files.
    #[must_use]
    pub fn images(&self) -> &[PathBuf] {
        &self.images
    }

    /// Where they were taken, if that is known.
    #[must_use]
    pub fn poses(&self) -> Option<&Poses> {
        self.poses.as_ref()
    }

    /// The same images without poses.
    #[must_use]
    pub fn without_poses(self) -> Self {
        Self { poses: None, ..self }
    }

    /// Decodes all images, in parallel and in order. Those that are larger than `most` are resized
    /// to it; the aspect ratio is not kept, as networks do not keep it.
    ///
    /// # Errors
    ///
    /// The first file, in order, that cannot be read or decoded, by its path.
    pub fn decode(&self, most: ImageSize) -> Result<Vec<RgbImage>> {
        let one = |path: &PathBuf| -> vpr_core::Result<RgbImage> {
            let decoded = image::decode(path)?;
            if decoded.width() <= most.width && decoded.height() <= most.height {
                return Ok(decoded);
            }
            resize_bilinear(&decoded, most)
        };
        let decoded: Vec<vpr_core::Result<RgbImage>> = self.images.par_iter().map(one).collect();
        Ok(decoded.into_iter().collect::<vpr_core::Result<_>>()?)
    }

    /// Holds out about this share of the references, in runs of five neighbours in the order of the
    /// map, drawn from `seed`; at least one and at most half.
    ///
    /// # Errors
    ///
    /// [`CoreError::Parameter`] if the share is not in 0 to 0.5.
    pub fn split(&self, share: f64, seed: u64) -> Result<Split> {
        if !(share > 0.0 && share <= 0.5) {
            let reason = "must be above 0 and at most 0.5";
            let (name, value) = ("held_out", share.to_string());
            return Err(CoreError::Parameter { name, value, reason }.into());
        }
        let n = self.len();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
        let wanted = ((n as f64 * share).round() as usize).clamp(1, n / 2);
        let mut runs: Vec<usize> = (0..n.div_ceil(RUN)).collect();
        runs.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
        let chosen = runs.into_iter().flat_map(|run| run * RUN..n.min((run + 1) * RUN));
        let mut held_out: Vec<usize> = chosen.take(wanted).collect();
        held_out.sort_unstable();
        let training = (0..n).filter(|it| held_out.binary_search(it).is_err()).collect();
        Ok(Split { training, held_out })
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use vpr_core::PlanarPosition;
    use vpr_vision::image::{from_pixels, write_png};

    use super::*;

    fn named(n: usize) -> Vec<PathBuf> {
        (0..n).map(|at| PathBuf::from(format!("{at}.png"))).collect()
    }

    #[test]
    fn poses_are_of_the_images_or_refused() {
        assert!(matches!(
            ReferenceSet::new(named(1), None),
            Err(Error::TooFew { n: 1, needed: 2, .. })
        ));
        let poses = |n: usize, x: f64| Poses::Planar(vec![PlanarPosition::new(x, 0.0); n]);
        let err = ReferenceSet::new(named(3), Some(poses(2, 0.0))).unwrap_err().to_string();
        assert!(err.contains("expected 3, got 2"), "{err}");
        assert!(ReferenceSet::new(named(3), Some(poses(3, f64::NAN))).is_err());
        let set = ReferenceSet::new(named(3), Some(poses(3, 1.0))).unwrap();
        assert!(set.poses().is_some() && set.without_poses().poses().is_none());
    }

    #[test]
    fn a_split_is_decided_by_its_seed_and_leaves_nothing_out() {
        for n in [2, 3, 7, 40, 203] {
            let set = ReferenceSet::new(named(n), None).unwrap();
            let split = set.split(0.2, 5).unwrap();
            assert_eq!(split, set.split(0.2, 5).unwrap());
            assert!(!split.held_out.is_empty() && split.training.len() >= split.held_out.len());
            let mut all = [&split.training[..], &split.held_out].concat();
            all.sort_unstable();
            assert_eq!(all, (0..n).collect::<Vec<_>>());
        }
        let set = ReferenceSet::new(named(203), None).unwrap();
        assert_ne!(set.split(0.2, 5).unwrap(), set.split(0.2, 6).unwrap());
        assert_eq!(set.split(0.2, 5).unwrap().held_out.len(), 41);
        for share in [0.0, 0.6, f64::NAN] {
            assert!(set.split(share, 5).is_err());
        }
    }

    #[test]
    fn large_images_become_small_and_a_broken_one_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let paths: Vec<PathBuf> = named(3).iter().map(|it| folder.path().join(it)).collect();
        for (path, side) in paths.iter().zip([1, 8, 40]) {
            let size = ImageSize { width: side, height: side };
            write_png(&from_pixels(size, vec![90; 3 * side * side]), path).unwrap();
        }
        let set = ReferenceSet::new(paths.clone(), None).unwrap();
        let most = ImageSize { width: 16, height: 12 };
        let sizes: Vec<_> = set.decode(most).unwrap().iter().map(RgbImage::width).collect();
        assert_eq!(sizes, [1, 8, 16]);
        fs::write(&paths[1], "no image").unwrap();
        let err = set.decode(most).err().unwrap().to_string();
        assert!(err.contains("1.png"), "{err}");
    }
}
