//! Networks on DINOv2.

use burn::tensor::{Device, Tensor};

use super::{Describe, Loaded, Parts};
use crate::Result;
use crate::aggregate::{
    Boq, BoqConfig, CricaVpr, CricaVprConfig, Salad, SaladConfig, cricavpr as cross_image,
    salad as transport,
};
use crate::backbone::{DinoV2, DinoV2Config};
use crate::weights::Weights;

impl Describe for Parts<DinoV2, Boq> {
    fn describe(&self, images: Tensor<4>) -> Tensor<2> {
        self.aggregator.forward(self.backbone.forward_unnormalised(images).map())
    }

    fn accepts(&self, height: usize, width: usize) -> Result<(), String> {
        patches(&self.backbone, height, width).map(|_| ())
    }
}

impl Describe for Parts<DinoV2, Salad> {
    fn describe(&self, images: Tensor<4>) -> Tensor<2> {
        let tokens = self.backbone.forward(images);
        self.aggregator.forward(tokens.clone().map(), tokens.class)
    }

    fn accepts(&self, height: usize, width: usize) -> Result<(), String> {
        let [rows, columns] = patches(&self.backbone, height, width)?;
        match self.aggregator.clusters() {
            clusters if rows * columns > clusters => Ok(()),
            clusters => Err(format!("SALAD needs more patches than its {clusters} clusters")),
        }
    }
}

impl Describe for Parts<DinoV2, CricaVpr> {
    fn describe(&self, images: Tensor<4>) -> Tensor<2> {
        let tokens = self.backbone.forward(images);
        self.aggregator.forward(tokens.class.clone(), tokens.map()).for_this_batch()
    }

    fn accepts(&self, height: usize, width: usize) -> Result<(), String> {
        let least = cross_image::SMALLEST_SIDE;
        match patches(&self.backbone, height, width)? {
            sides if sides.iter().all(|&side| side >= least) => Ok(()),
            _ => Err(format!("CricaVPR needs at least {least} patches along each side")),
        }
    }
}

fn patches(backbone: &DinoV2, height: usize, width: usize) -> Result<[usize; 2], String> {
    let patch = backbone.patch();
    if height > 0 && width > 0 && height.is_multiple_of(patch) && width.is_multiple_of(patch) {
        return Ok([height / patch, width / patch]);
    }
    Err(format!("DINOv2 needs height and width to be multiples of {patch}"))
}

/// BoQ on ViT-B/14: `dinov2_12288.pth` of `amaralibey/Bag-of-Queries`.
///
/// # Errors
///
/// As [`open`](super::open).
pub fn boq_dinov2(weights: Weights, device: &Device) -> Result<Loaded<Parts<DinoV2, Boq>>> {
    let weights = weights.renamed(&[(r"^backbone\.dino\.", "backbone.")])?;
    let backbone = DinoV2Config::from_weights(&weights, "backbone.")?;
    let head = BoqConfig::from_weights(&weights, "aggregator.")?;
    Loaded::new(backbone.init(device), head.init(device), head.dimension(), weights)
}

/// SALAD on ViT-B/14: `dino_salad.ckpt` of `serizba/salad`.
///
/// # Errors
///
/// As [`open`](super::open).
pub fn salad(weights: Weights, device: &Device) -> Result<Loaded<Parts<DinoV2, Salad>>> {
    let weights = weights.renamed(&[(r"^backbone\.model\.", "backbone.")])?;
    let weights = transport::from_official(weights)?;
    let backbone = DinoV2Config::from_weights(&weights, "backbone.")?;
    let head = SaladConfig::from_weights(&weights, "aggregator.")?;
    Loaded::new(backbone.init(device), head.init(device), head.dimension(), weights)
}

/// CricaVPR on ViT-B/14: `CricaVPR.pth` of `Lu-Feng/CricaVPR`. Descriptors depend on the batch.
///
/// # Errors
///
/// As [`open`](super::open).
pub fn cricavpr(weights: Weights, device: &Device) -> Result<Loaded<Parts<DinoV2, CricaVpr>>> {
    let own =
        [(r"^aggregation\.", "aggregator.aggregation."), (r"^encoder\.", "aggregator.encoder.")];
    let weights = cross_image::from_official(weights.renamed(&own)?)?;
    let backbone = DinoV2Config::from_weights(&weights, "backbone.")?;
    let head = CricaVprConfig::from_weights(&weights, "aggregator.")?;
    Loaded::new(backbone.init(device), head.init(device), head.dimension(), weights)
}
