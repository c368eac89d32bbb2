//! HOG, `CoHOG` and VLADs of local features, run on image files.

use std::path::{Path, PathBuf};

use ndarray::Array2;
use vpr_core::{Descriptors, Result, map::About, metrics::Timing};
use vpr_vision::{
    cohog::{self, CoHog, CoHogParams},
    hog::{self, Hog, HogParams},
    image,
    vlad::VladEncoder,
};

use crate::describe::{Describe, Features, each, median, timed};

/// A technique without a network, with its configuration.
#[derive(Clone, Debug, PartialEq)]
pub enum HandCrafted {
    /// One HOG descriptor per image, compared by cosine.
    Hog(HogParams),
    /// Regional HOG, compared region by region.
    CoHog(CoHogParams),
    /// What local features add to a vocabulary, one vector per image, compared by cosine.
    Vlad(Vlad),
}

/// The vocabularies every clone has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vlad {
    /// `DenseVLAD`.
    Dense,
    /// Of HOG cells.
    Hog,
}

impl Vlad {
    /// The encoder with its vocabulary.
    #[must_use]
    pub fn encoder(self) -> VladEncoder {
        match self {
            Self::Dense => VladEncoder::dense_vlad(),
            Self::Hog => VladEncoder::hog_vlad(),
        }
    }
}

impl Describe for HandCrafted {
    fn key(&self) -> String {
        match self {
            Self::Vlad(vlad) => {
                let encoder = vlad.encoder();
                format!("{self:?} {:?} {}", encoder.local(), encoder.digest())
            }
            _ => format!("{self:?}"),
        }
    }

    fn encode(&self, images: &[PathBuf], step: &(dyn Fn() + Sync)) -> Result<Features> {
        match self {
            Self::Hog(params) => {
                let hog = Hog::new(*params)?;
                let rows = each(images, step, |path| hog.describe(&image::decode(path)?))?;
                vectors(&rows, params.dim())
            }
            Self::Vlad(vlad) => {
                let encoder = vlad.encoder();
                let rows = each(images, step, |path| encoder.describe(&image::decode(path)?))?;
                vectors(&rows, encoder.dim())
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
            Self::Vlad(vlad) => {
                let encoder = vlad.encoder();
                let rows = timed(&decoded, &mut encoding, |image| encoder.describe(image))?;
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
    fn about(&self) -> Option<About> {
        let Self::Vlad(vlad) = self else { return None };
        let encoder = Some(format!("{vlad:?} VLAD"));
        let weights_digest = Some(vlad.encoder().digest());
        Some(About { encoder, weights_digest, ..About::default() })
    }
}

/// One vector of `dim` numbers per image.
fn vectors(rows: &[Vec<f32>], dim: usize) -> Result<Features> {
    let rows = Array2::from_shape_fn((rows.len(), dim), |(row, column)| rows[row][column]);
    Descriptors::new(rows).map(Features::Vectors)
}
