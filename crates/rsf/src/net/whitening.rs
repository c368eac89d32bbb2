//! Adaptation in closed form: another projection of the pooled features, fitted on references alone.

use ndarray::{Array1, Array2, Axis, concatenate, s};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;
use vpr_nets::{
    model::default::{DefaultEncoder, INPUT},
    train::{Affine, learned_whitening},
};

use super::Material;
use crate::{Error, Preset, Result};

/// References that are described at a time.
const BATCH: usize = 16;

/// How the projection is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Whitening {
    /// Variants of each reference, besides itself.
    pub variants: usize,
    /// What they may look like.
    pub augmentations: Preset,
    /// Decides them.
    pub seed: u64,
}

impl Default for Whitening {
    fn default() -> Self {
        Self { variants: 6, augmentations: Preset::All, seed: 1 }
    }
}

/// The network under learned whitening of its pooled features (Radenović, Tolias and Chum 2019,
/// section 3.3): what differs between variants of one reference counts little, what differs between
/// references much. The trunk stays. A map of `n` references tells `n − 1` directions apart; if the
/// descriptor has more, the others are zero.
///
/// # Errors
///
/// [`Error::TooFew`] without a variant; those of [`learned_whitening`].
pub fn whiten(
    settings: &Whitening,
    network: DefaultEncoder,
    material: &Material,
) -> Result<DefaultEncoder> {
    if settings.variants == 0 {
        let purpose = "variants of each reference, to see what changes within a place";
        return Err(Error::TooFew { n: 0, needed: 1, purpose });
    }
    let augmentations = settings.augmentations.augmentations();
    let mut random = ChaCha8Rng::seed_from_u64(settings.seed);
    let rows: Vec<usize> = (0..material.len()).collect();
    let (mut parts, mut places) = (Vec::new(), Vec::new());
    for part in rows.chunks(BATCH) {
        parts.push(network.pooled(&material.plain(part)?, INPUT, BATCH)?);
        places.extend_from_slice(part);
        let variants = part.iter().flat_map(|&row| std::iter::repeat_n(row, settings.variants));
        let drawn: Vec<(usize, u64)> = variants.map(|row| (row, random.random())).collect();
        parts.push(network.pooled(&material.changed(&augmentations, &drawn)?, INPUT, BATCH)?);
        places.extend(drawn.iter().map(|it| it.0));
    }
    let views: Vec<_> = parts.iter().map(|part| part.view()).collect();
    let features = concatenate(Axis(0), &views)
        .map_err(|cause| vpr_core::Error::format("features", "shape", cause.to_string()))?;
    let dimension = network.dimension();
    let to = dimension.min(material.len() - 1);
    let fitted = learned_whitening(features.view(), &places, to)?;
    let mut weight = Array2::zeros((fitted.weight.nrows(), dimension));
    weight.slice_mut(s![.., ..to]).assign(&fitted.weight);
    let mut bias = Array1::zeros(dimension);
    bias.slice_mut(s![..to]).assign(&fitted.bias);
    Ok(network.with_projection(&Affine { weight, bias })?)
}
