//! HOG and `CoHOG`, run on image files.

use std::{
    path::{Path, PathBuf},
    time::Instant,
};

use ndarray::Array2;
use rayon::prelude::*;
use vpr_core::{Descriptors, Result, Similarities, metrics::Timing};
use vpr_vision::{
    cohog::{self, CoHog, CoHogDescriptor, CoHogParams},
    hog::{self, Hog, HogParams},
    image,
};

/// A technique that runs here, with its configuration.
#[derive(Clone, Debug, PartialEq)]
pub enum HandCrafted {
    /// One HOG descriptor per image, compared by cosine.
    Hog(HogParams),
    /// Regional HOG, compared region by region.
    CoHog(CoHogParams),
}

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
    /// As [`Self::encode`]; [`vpr_core::Error::Empty`] without images.
    fn time(&self, images: &[PathBuf]) -> Result<Timing>;
}

/// The descriptors of a set of images.
#[derive(Clone, Debug)]
pub enum Features {
    /// One vector per image, compared by cosine.
    Vectors(Descriptors),
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

impl Describe for HandCrafted {
    fn key(&self) -> String {
        format!("{self:?}")
    }

    fn encode(&self, images: &[PathBuf], step: &(dyn Fn() + Sync)) -> Result<Features> {
        match self {
            Self::Hog(params) => {
                let hog = Hog::new(*params)?;
                let rows = each(images, step, |path| hog.describe(&image::decode(path)?))?;
                let shape = (images.len(), params.dim());
                let rows = Array2::from_shape_fn(shape, |(row, column)| rows[row][column]);
                Descriptors::new(rows).map(Features::Vectors)
            }
            Self::CoHog(params) => {
                let cohog = CoHog::new(params.clone())?;
                let describe = |path: &Path| cohog.describe(&image::decode(path)?);
                each(images, step, describe).map(Features::Regions)
            }
        }
    }

    fn time(&self, images: &[PathBuf]) -> Result<Timing> {
        let decoded = images.iter().map(|path| image::decode(path)).collect::<Result<Vec<_>>>()?;
        let mut encoding = Vec::new();
        let mut matching = Vec::new();
        match self {
            Self::Hog(params) => {
                let hog = Hog::new(*params)?;
                let rows = timed(&decoded, &mut encoding, |image| hog.describe(image))?;
                let pairs: Vec<_> = rows.iter().zip(rows.iter().skip(1)).collect();
                timed(&pairs, &mut matching, |(a, b)| hog::similarity(a, b))?;
            }
            Self::CoHog(params) => {
                let cohog = CoHog::new(params.clone())?;
                let rows = timed(&decoded, &mut encoding, |image| cohog.describe(image))?;
                let pairs: Vec<_> = rows.iter().zip(rows.iter().skip(1)).collect();
                timed(&pairs, &mut matching, |(a, b)| cohog::similarity(a, b))?;
            }
        }
        Ok(Timing { encoding: median(&mut encoding)?, matching: median(&mut matching)? })
    }
}

impl Features {
    /// Number of images.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Vectors(descriptors) => descriptors.len(),
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
            Self::Regions(_) => None,
        }
    }

    /// Compares every query with every reference of the same technique.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::Mismatch`] if the descriptors are of different techniques or dimensions,
    /// [`vpr_core::Error::Empty`] if there are none.
    pub fn match_with(&self, references: &Self) -> Result<Matched> {
        match (self, references) {
            (Self::Vectors(queries), Self::Vectors(references)) => Ok(Matched {
                similarities: hog::similarities(queries, references)?,
                descriptor_bytes: references.dim() * size_of::<f32>(),
                n_fallbacks: 0,
            }),
            (Self::Regions(queries), Self::Regions(references)) => {
                let first = references.first().ok_or(vpr_core::Error::Empty("references"))?;
                Ok(Matched {
                    similarities: cohog::similarities(queries, references)?,
                    descriptor_bytes: first.n_regions() * first.depth() * size_of::<f32>(),
                    n_fallbacks: cohog::n_fallbacks(queries),
                })
            }
            (queries, references) => Err(vpr_core::Error::Mismatch {
                what: "descriptors of one technique",
                expected: queries.len(),
                actual: references.len(),
            }),
        }
    }
}

/// Applies `describe` to every image in parallel and keeps the order.
fn each<T: Send>(
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
fn timed<I, T>(
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

pub(super) fn median(values: &mut [f64]) -> Result<f64> {
    if values.is_empty() {
        return Err(vpr_core::Error::Empty("images to time"));
    }
    values.sort_unstable_by(f64::total_cmp);
    Ok(values[values.len() / 2])
}
