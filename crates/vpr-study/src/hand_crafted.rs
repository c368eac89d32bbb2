//! HOG and `CoHOG`, run on image files.

use std::path::{Path, PathBuf};

use ndarray::Array2;
use vpr_core::{Descriptors, Result, metrics::Timing};
use vpr_vision::{
    cohog::{self, CoHog, CoHogParams},
    hog::{self, Hog, HogParams},
    image,
};

use crate::describe::{Describe, Features, each, median, timed};

/// A technique without a network, with its configuration.
#[derive(Clone, Debug, PartialEq)]
pub enum HandCrafted {
    /// One HOG descriptor per image, compared by cosine.
    Hog(HogParams),
    /// Regional HOG, compared region by region.
    CoHog(CoHogParams),
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
