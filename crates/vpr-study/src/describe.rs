//! What a technique does with image files.

use std::{path::Path, path::PathBuf, time::Instant};

use rayon::prelude::*;
use vpr_core::{Descriptors, Error, Result, Similarities, map::About, metrics::Timing};
use vpr_vision::{
    cohog::{self, CoHogDescriptor},
    hog,
};

/// A technique that runs here on image files.
pub trait Describe: Send + Sync {
    /// Its name and all of its settings: two techniques with the same key give the same numbers.
    fn key(&self) -> String;

    /// Describes images, in order; `step` is called after each.
    ///
    /// # Errors
    ///
    /// The first image, in order, that cannot be read or decoded, by its path.
    fn encode(&self, images: &[PathBuf], step: &(dyn Fn() + Sync)) -> Result<Features>;

    /// Seconds to encode one of these images and to compare one pair of them, on one thread,
    /// each apart from the other: the median over the images, decoding left out.
    ///
    /// # Errors
    ///
    /// As [`Self::encode`]; [`Error::Empty`] without images.
    fn time(&self, images: &[PathBuf]) -> Result<Timing>;

    /// Its vectors, kept on disk, as it compares them.
    fn kept(&self, rows: Descriptors) -> Features {
        Features::Vectors(rows)
    }

    /// What to say of its descriptors where they are kept on disk; `None` if they are one vector
    /// per image but quickly made, or no vectors.
    fn about(&self) -> Option<About> {
        None
    }
}

/// The descriptors of a set of images.
#[derive(Clone, Debug)]
pub enum Features {
    /// One vector per image, compared by cosine.
    Vectors(Descriptors),
    /// One vector per image, compared by the sum of absolute differences, as AMOSNet and HybridNet.
    #[cfg(feature = "networks")]
    Differences(Descriptors),
    /// A set of regions per image.
    Regions(Vec<CoHogDescriptor>),
}

/// What a technique found on a pair of image sets.
#[derive(Clone, Debug)]
pub struct Matched {
    /// Similarity of every query with every reference.
    pub similarities: Similarities,
    /// Bytes of one reference descriptor, as kept in memory.
    pub descriptor_bytes: usize,
    /// Images where no region passed the entropy threshold, so that all were used (VB-12).
    pub n_fallbacks: usize,
}

impl Features {
    /// Number of images.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Vectors(descriptors) => descriptors.len(),
            #[cfg(feature = "networks")]
            Self::Differences(descriptors) => descriptors.len(),
            Self::Regions(descriptors) => descriptors.len(),
        }
    }

    /// Whether there is no image.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The vectors, if the technique has one per image.
    #[must_use]
    pub fn into_descriptors(self) -> Option<Descriptors> {
        match self {
            Self::Vectors(descriptors) => Some(descriptors),
            #[cfg(feature = "networks")]
            Self::Differences(descriptors) => Some(descriptors),
            Self::Regions(_) => None,
        }
    }

    /// Compares every query with every reference of the same technique.
    ///
    /// # Errors
    ///
    /// [`Error::Mismatch`] if the descriptors are of different techniques or dimensions,
    /// [`Error::Empty`] if there are none.
    pub fn match_with(&self, references: &Self) -> Result<Matched> {
        match (self, references) {
            (Self::Vectors(queries), Self::Vectors(references)) => Ok(Matched {
                similarities: hog::similarities(queries, references)?,
                descriptor_bytes: references.dim() * size_of::<f32>(),
                n_fallbacks: 0,
            }),
            #[cfg(feature = "networks")]
            (Self::Differences(queries), Self::Differences(references)) => Ok(Matched {
                similarities: vpr_nets::encode::l1::similarities(queries, references)?,
                descriptor_bytes: references.dim() * size_of::<f32>(),
                n_fallbacks: 0,
            }),
            (Self::Regions(queries), Self::Regions(references)) => {
                let first = references.first().ok_or(Error::Empty("references"))?;
                Ok(Matched {
                    similarities: cohog::similarities(queries, references)?,
                    descriptor_bytes: first.n_regions() * first.depth() * size_of::<f32>(),
                    n_fallbacks: cohog::n_fallbacks(queries),
                })
            }
            (queries, references) => Err(Error::Mismatch {
                what: "descriptors of one technique",
                expected: queries.len(),
                actual: references.len(),
            }),
        }
    }
}

/// Applies `describe` to every image in parallel and keeps the order.
pub(crate) fn each<T: Send>(
    images: &[PathBuf],
    step: &(dyn Fn() + Sync),
    describe: impl Fn(&Path) -> Result<T> + Sync,
) -> Result<Vec<T>> {
    let described: Vec<Result<T>> = images
        .par_iter()
        .map(|path| {
            let features = describe(path);
            step();
            features
        })
        .collect();
    described.into_iter().collect()
}

/// Applies `work` to every item on this thread and notes the seconds each takes.
pub(crate) fn timed<I, T>(
    items: &[I],
    seconds: &mut Vec<f64>,
    work: impl Fn(&I) -> Result<T>,
) -> Result<Vec<T>> {
    let run = |item| {
        let start = Instant::now();
        let result = work(item);
        seconds.push(start.elapsed().as_secs_f64());
        result
    };
    items.iter().map(run).collect()
}

/// The median of seconds; the upper one of an even number.
pub(crate) fn median(values: &mut [f64]) -> Result<f64> {
    if values.is_empty() {
        return Err(Error::Empty("images to time"));
    }
    values.sort_unstable_by(f64::total_cmp);
    Ok(values[values.len() / 2])
}
