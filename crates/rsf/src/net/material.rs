//! References in memory, as the network takes them.

use std::path::Path;

use rayon::prelude::*;
use vpr_core::{Descriptors, Error as CoreError, Poses, map::BlockDigest};
use vpr_nets::{
    encode::{Preprocessing, registry::Method},
    model::{
        Tunable,
        default::{DefaultEncoder, DefaultEncoderConfig, INPUT},
    },
    train::device,
    weights::Weights,
};
use vpr_vision::image::{ImageSize, RgbImage};

use crate::{Augmentations, ReferenceSet, Result};

/// References are kept at up to this size, a quarter larger than the network's input, so that a crop
/// of them is not blurred.
fn kept((width, height): (usize, usize)) -> ImageSize {
    ImageSize { width: width + width / 4, height: height + height / 4 }
}

/// Images that are described at a time.
const BATCH: usize = 32;

/// The references of a map, decoded.
#[derive(Clone)]
pub struct Material {
    images: Vec<RgbImage>,
    poses: Option<Poses>,
    preprocessing: Preprocessing,
    size: (usize, usize),
}

/// The default network with these weights, or with those that every clone has, on a device that
/// records gradients.
///
/// # Errors
///
/// [`vpr_nets::Error::Weights`] with the file and its keys that do not fit; those of
/// [`Weights::open`].
pub fn default_network(weights: Option<&Path>) -> Result<(DefaultEncoder, String)> {
    let weights = match weights {
        Some(path) => Weights::open(path)?,
        None => Method::find("default", None)?.built_in_weights()?,
    };
    let digest = weights.digest().to_owned();
    let mut network = DefaultEncoderConfig::new().init(&device());
    weights.apply(&mut network)?;
    Ok((network, digest))
}

impl Material {
    /// Decodes the images of a map, for the default network.
    ///
    /// # Errors
    ///
    /// The first file that cannot be read or decoded, by its path.
    pub fn open(set: &ReferenceSet) -> Result<Self> {
        Self::open_for(set, Method::find("default", None)?.preprocessing(), INPUT)
    }

    /// The same for a network with this preprocessing, whose input has this width and height.
    ///
    /// # Errors
    ///
    /// As [`Self::open`].
    pub fn open_for(
        set: &ReferenceSet,
        preprocessing: Preprocessing,
        size: (usize, usize),
    ) -> Result<Self> {
        let (images, poses) = (set.decode(kept(size))?, set.poses().cloned());
        Ok(Self { images, poses, preprocessing, size })
    }

    /// Width and height of the network's input.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        self.size
    }

    /// Number of references.
    #[must_use]
    pub fn len(&self) -> usize {
        self.images.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.images.is_empty()
    }

    /// Where they were taken, if that is known.
    #[must_use]
    pub fn poses(&self) -> Option<&Poses> {
        self.poses.as_ref()
    }

    /// The network's input of some references as they are, one after another.
    ///
    /// # Errors
    ///
    /// An image without pixels.
    pub fn plain(&self, rows: &[usize]) -> Result<Vec<f32>> {
        let input = |&row: &usize| self.input(&self.images[row]);
        joined(rows.par_iter().map(input).collect())
    }

    /// The same of variants: a reference and the seed of its change.
    ///
    /// # Errors
    ///
    /// An image without pixels.
    pub fn changed(&self, changes: &Augmentations, of: &[(usize, u64)]) -> Result<Vec<f32>> {
        let input =
            |&(row, seed): &(usize, u64)| self.input(&changes.apply(&self.images[row], seed));
        joined(of.par_iter().map(input).collect())
    }

    /// Descriptors of all references.
    ///
    /// # Errors
    ///
    /// [`CoreError::NotFinite`] if the network gives a number that is none.
    pub fn describe<N: Tunable>(&self, network: &N) -> Result<Descriptors> {
        let rows: Vec<usize> = (0..self.len()).collect();
        let mut values = Vec::new();
        for part in rows.chunks(BATCH) {
            let part = network.rows(&self.plain(part)?, self.size, BATCH)?;
            values.extend_from_slice(part.as_slice());
        }
        descriptors(values, self.len())
    }

    /// Stands for images and poses, so that a run on others is another run.
    #[must_use]
    pub fn digest(&self) -> String {
        let mut bytes = Vec::new();
        for image in &self.images {
            bytes.extend(BlockDigest::of(image.as_slice()).to_hex().into_bytes());
        }
        if let Some(poses) = &self.poses {
            let number = |at: usize| poses.position(at).coords.map(f64::to_le_bytes);
            let numbers = (0..poses.len()).flat_map(|at| number(at).as_slice().concat());
            bytes.extend(numbers);
        }
        BlockDigest::of(&bytes).to_hex()
    }

    fn input(&self, image: &RgbImage) -> Result<Vec<f32>> {
        Ok(self.preprocessing.apply(image)?.0)
    }
}

/// Rows that were described in parts.
pub(super) fn descriptors(values: Vec<f32>, n: usize) -> Result<Descriptors> {
    let dim = values.len() / n.max(1);
    let rows = ndarray::Array2::from_shape_vec((n, dim), values)
        .map_err(|cause| CoreError::format("descriptors", "shape", cause.to_string()))?;
    Ok(Descriptors::new(rows)?)
}

fn joined(parts: Vec<Result<Vec<f32>>>) -> Result<Vec<f32>> {
    Ok(parts.into_iter().collect::<Result<Vec<_>>>()?.concat())
}
