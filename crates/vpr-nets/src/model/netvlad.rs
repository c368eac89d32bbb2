//! NetVLAD on VGG16, as hloc and VPR-methods-evaluation run the original weights.

use burn::module::Module;
use burn::tensor::{Device, Tensor};

use super::keys::SEQUENTIAL_VGG;
use super::{Describe, Loaded, Parts};
use crate::Result;
use crate::aggregate::{NetVlad, NetVladConfig, Whitening};
use crate::backbone::vgg::Crop;
use crate::backbone::{Vgg16, Vgg16Config};
use crate::weights::Shapes;
use crate::weights::Weights;

/// NetVLAD and the whitening behind it.
#[derive(Module, Debug)]
pub struct NetVladHead {
    netvlad: NetVlad,
    whiten: Option<Whitening>,
}

impl NetVladHead {
    /// `batch × dim × rows × columns` to unit descriptors.
    #[must_use]
    pub fn forward(&self, map: Tensor<4>) -> Tensor<2> {
        let descriptors = self.netvlad.forward(map.flatten(2, 3));
        match &self.whiten {
            Some(whiten) => whiten.forward(descriptors),
            None => descriptors,
        }
    }
}

impl Describe for Parts<Vgg16, NetVladHead> {
    fn describe(&self, images: Tensor<4>) -> Tensor<2> {
        self.aggregator.forward(self.backbone.forward(images))
    }
}

/// NetVLAD on VGG16 under hloc's keys (`backbone.0.weight`, `netvlad.score_proj.weight`,
/// `netvlad.centers`, `whiten.weight`), with or without whitening.
///
/// The original `Pitts30K_struct.mat` is read by hloc, which negates the centres; its state saved as
/// `.pth` or `.safetensors` is what this function reads.
///
/// # Errors
///
/// As [`open`](super::open).
pub fn netvlad(weights: Weights, device: &Device) -> Result<Loaded<Parts<Vgg16, NetVladHead>>> {
    let own = [(r"^(netvlad|whiten)\.", "aggregator.$1.")];
    let weights = weights.renamed(&own)?.renamed(&SEQUENTIAL_VGG)?;
    let config = NetVladConfig::from_weights(&weights, "aggregator.netvlad.")?;
    let full = config.dim * config.clusters;
    let shapes = Shapes::new(&weights, "aggregator.");
    let whitened =
        if shapes.has("whiten.weight") { Some(shapes.axis("whiten.weight", 0)?) } else { None };
    let head = NetVladHead {
        netvlad: config.with_normalise_input(true).init(device),
        whiten: whitened.map(|to| Whitening::zeros(full, to, device)),
    };
    let backbone = Vgg16Config::new().with_crop(Crop::Conv5).init(device);
    Loaded::new(backbone, head, whitened.unwrap_or(full), weights)
}
