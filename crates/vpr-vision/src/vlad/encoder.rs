//! From an image to its VLAD.

use std::{borrow::Cow, sync::LazyLock};

use ndarray::Array2;
use serde::{Deserialize, Serialize};
use vpr_core::{Descriptors, Error, Result};

use super::{Projection, Vocabulary};
use crate::{
    dense_sift::{self, DenseSiftParams},
    hog::{Hog, HogParams},
    image::{ImageSize, RgbImage, gray, resize_bilinear},
};

/// The vocabularies every clone has.
const DENSE_VLAD: &[u8] = include_bytes!("../../models/dense-vlad.safetensors");
const HOG_VLAD: &[u8] = include_bytes!("../../models/hog-vlad.safetensors");

/// The local features of a VLAD.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Local {
    /// The square roots of dense SIFT on an image of `size`, `width × height`: `DenseVLAD`.
    RootSift {
        /// Images are resized to it; the aspect ratio is not kept.
        size: [usize; 2],
        /// Grid and scales.
        sift: DenseSiftParams,
    },
    /// The normalised blocks of HOG at several cell sizes.
    Hog {
        /// One per scale; all with as many numbers per block.
        scales: Vec<HogParams>,
    },
}

impl Local {
    /// `DenseVLAD`'s as the thesis and 24/7's code have them: 640×480, bins of 4, 6, 8 and 10 pixels,
    /// every second pixel.
    #[must_use]
    pub fn dense_vlad() -> Self {
        Self::RootSift { size: [640, 480], sift: DenseSiftParams::default() }
    }

    /// Blocks of two by two cells of 8, 16 and 32 pixels on 256×256, a cell apart.
    #[must_use]
    pub fn hog_vlad() -> Self {
        let scale = |cell| HogParams { window: 256, ..HogParams::THESIS.with_cell_size(cell) };
        Self::Hog { scales: [8, 16, 32].map(scale).to_vec() }
    }

    /// The features of an image, one set per scale, each `n × dim`.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] for parameters out of range or an image without pixels.
    pub fn describe(&self, image: &RgbImage) -> Result<Vec<Descriptors>> {
        match self {
            Self::RootSift { size: [width, height], sift } => {
                let size = ImageSize { width: *width, height: *height };
                let resized = if image.size() == size {
                    Cow::Borrowed(image)
                } else {
                    Cow::Owned(resize_bilinear(image, size)?)
                };
                dense_sift::describe(&gray(&resized), sift, true)
            }
            Self::Hog { scales } => {
                let blocks = |params: &HogParams| {
                    let values = Hog::new(*params)?.describe(image)?;
                    let block = (params.block / params.cell).pow(2) * params.bins;
                    let shape = (values.len() / block, block);
                    let rows = Array2::from_shape_vec(shape, values);
                    Descriptors::new(
                        rows.map_err(|err| Error::format("HOG", "blocks", err.to_string()))?,
                    )
                };
                scales.iter().map(blocks).collect()
            }
        }
    }
}

/// Local features, their vocabulary, and a projection of what they add to it.
///
/// Torii et al., *24/7 Place Recognition by View Synthesis* (2015): every feature belongs to its
/// nearest word, the sum of differences of each word is scaled to unit length (intra-normalisation),
/// and so is the whole, before and after the projection.
#[derive(Clone, Debug, PartialEq)]
pub struct VladEncoder {
    pub(super) local: Local,
    pub(super) vocabulary: Vocabulary,
    pub(super) projection: Option<Projection>,
}

impl VladEncoder {
    /// An encoder of these parts.
    ///
    /// # Errors
    ///
    /// [`Error::Mismatch`] if the projection is of another dimension than the vocabulary.
    pub fn new(
        local: Local,
        vocabulary: Vocabulary,
        projection: Option<Projection>,
    ) -> Result<Self> {
        let expected = vocabulary.centres().len() * vocabulary.centres().dim();
        match &projection {
            Some(projection) if projection.mean.len() != expected => {
                let (what, actual) = ("dimension of the projection", projection.mean.len());
                Err(Error::Mismatch { what, expected, actual })
            }
            _ => Ok(Self { local, vocabulary, projection }),
        }
    }

    /// `DenseVLAD` with the vocabulary every clone has, trained on generated places.
    ///
    /// # Panics
    ///
    /// Never: the vocabulary is part of the program and tested.
    #[must_use]
    pub fn dense_vlad() -> Self {
        static ENCODER: LazyLock<VladEncoder> = LazyLock::new(|| {
            VladEncoder::read("dense-vlad.safetensors".as_ref(), DENSE_VLAD).expect("it is tested")
        });
        ENCODER.clone()
    }

    /// A VLAD of HOG cells with the vocabulary every clone has.
    ///
    /// # Panics
    ///
    /// Never: the vocabulary is part of the program and tested.
    #[must_use]
    pub fn hog_vlad() -> Self {
        static ENCODER: LazyLock<VladEncoder> = LazyLock::new(|| {
            VladEncoder::read("hog-vlad.safetensors".as_ref(), HOG_VLAD).expect("it is tested")
        });
        ENCODER.clone()
    }

    /// Length of a descriptor.
    #[must_use]
    pub fn dim(&self) -> usize {
        let centres = self.vocabulary.centres();
        let whole = centres.len() * centres.dim();
        self.projection.as_ref().map_or(whole, Projection::n_components)
    }

    /// The local features.
    #[must_use]
    pub fn local(&self) -> &Local {
        &self.local
    }

    /// The vocabulary.
    #[must_use]
    pub fn vocabulary(&self) -> &Vocabulary {
        &self.vocabulary
    }

    /// The VLAD of an image before the projection, `words · dim`, of unit length or zero.
    ///
    /// # Errors
    ///
    /// Those of [`Local::describe`].
    pub fn vlad(&self, image: &RgbImage) -> Result<Vec<f32>> {
        let features = self.local.describe(image)?;
        Ok(self.vocabulary.encode_all(&features, true)?.to_vec())
    }

    /// Describes an image by [`Self::dim`] numbers of unit length, or zero.
    ///
    /// # Errors
    ///
    /// Those of [`Local::describe`].
    pub fn describe(&self, image: &RgbImage) -> Result<Vec<f32>> {
        let vlad = self.vlad(image)?;
        match &self.projection {
            Some(projection) => projection.apply(&vlad),
            None => Ok(vlad),
        }
    }
}
