//! Any encoder of one vector per image under a projection that is fitted on the references of a map.

use std::{path::PathBuf, sync::Arc};

use ndarray::{Array1, Array2};
use vpr_core::{
    Descriptors, Error as CoreError,
    map::{About, BlockDigest},
    metrics::Timing,
};
use vpr_nets::{
    encode::{Encoder, Options, encode_images},
    train::Affine,
};
use vpr_study::{Describe, Features, Network};
use vpr_vision::image::ImageSize;

use crate::{
    ReferenceSet, Result,
    net::{Whitening, features, projected},
};

/// References are changed at up to this size.
const KEPT: ImageSize = ImageSize { width: 320, height: 240 };

/// An encoder and what its descriptors go through; of length one in the end.
pub struct Adapted {
    base: Network,
    projection: Affine,
    key: String,
}

impl Adapted {
    /// Fits the projection on the references of a map and their variants; the one before is that
    /// which leaves descriptors as they are.
    ///
    /// # Errors
    ///
    /// An image that cannot be read, by its path; those of [`Whitening::fit`].
    pub fn fit(
        encoder: Arc<dyn Encoder>,
        whitening: &Whitening,
        set: &ReferenceSet,
    ) -> Result<Self> {
        let images = set.decode(KEPT)?;
        let augmentations = whitening.augmentations.augmentations();
        let encode = |images: &[_]| -> Result<Array2<f32>> {
            Ok(encode_images(encoder.as_ref(), images, &Options::default())?.into_inner())
        };
        let (features, places) = features(whitening, images.len(), |rows, variants| {
            let plain: Vec<_> = rows.iter().map(|&row| images[row].clone()).collect();
            let changed =
                variants.iter().map(|&(row, seed)| augmentations.apply(&images[row], seed));
            Ok(vec![encode(&plain)?, encode(&changed.collect::<Vec<_>>())?])
        })?;
        let same = features.ncols();
        let before = Affine { weight: Array2::eye(same), bias: Array1::zeros(same) };
        let projection = whitening.fit(features.view(), &places, &before)?;
        let bytes =
            projection.weight.iter().chain(&projection.bias).flat_map(|it| it.to_le_bytes());
        let digest = BlockDigest::of(&bytes.collect::<Vec<u8>>()).to_hex();
        let base = Network::new(encoder);
        let key = format!("{} projected by {digest}", base.key());
        Ok(Self { base, projection, key })
    }
}

impl Describe for Adapted {
    fn key(&self) -> String {
        self.key.clone()
    }

    fn encode(&self, images: &[PathBuf], step: &(dyn Fn() + Sync)) -> vpr_core::Result<Features> {
        let rows = self.base.encode(images, step)?.into_descriptors();
        let rows = rows.ok_or(CoreError::Empty("descriptors"))?;
        let rows = Descriptors::new(projected(&self.projection, rows.view()))?;
        Ok(Features::Vectors(rows.normalized()))
    }

    fn about(&self) -> Option<About> {
        self.base.about()
    }

    fn time(&self, images: &[PathBuf]) -> vpr_core::Result<Timing> {
        self.base.time(images)
    }
}
