//! Networks on ResNet and VGG16.

use burn::module::Module;
use burn::nn::{Linear, LinearConfig};
use burn::tensor::{Device, Tensor};

use super::keys::{SEQUENTIAL_RESNET, SEQUENTIAL_VGG, resnet};
use super::{Describe, Loaded, Parts};
use crate::Result;
use crate::aggregate::{
    Boq, BoqConfig, ConvAp, ConvApConfig, CosPlace, CosPlaceConfig, Gem, GemConfig, MixVpr,
    MixVprConfig, Whitening, mixvpr as mixing,
};
use crate::backbone::vgg::Crop;
use crate::backbone::{ResNet, Vgg16, Vgg16Config};
use crate::layer::l2_normalize;
use crate::weights::Shapes;
use crate::weights::{Tensor as Stored, Weights};

/// A convolutional backbone: what CosPlace and EigenPlaces were published on.
#[derive(Module, Debug)]
#[expect(clippy::large_enum_variant, reason = "there is one per network")]
pub enum Trunk {
    /// Any ResNet.
    ResNet(ResNet),
    /// VGG16 to its last convolution.
    Vgg16(Vgg16),
}

impl Trunk {
    fn forward(&self, images: Tensor<4>) -> Tensor<4> {
        match self {
            Self::ResNet(network) => network.forward(images),
            Self::Vgg16(network) => network.forward(images),
        }
    }
}

impl Describe for Parts<ResNet, Boq> {
    fn describe(&self, images: Tensor<4>) -> Tensor<2> {
        self.aggregator.forward(self.backbone.forward(images))
    }
}

impl Describe for Parts<ResNet, MixVpr> {
    fn describe(&self, images: Tensor<4>) -> Tensor<2> {
        self.aggregator.forward(self.backbone.forward(images))
    }

    fn accepts(&self, height: usize, width: usize) -> Result<(), String> {
        /// Pixels per position behind layer3.
        const STRIDE: usize = 16;
        match self.aggregator.positions() {
            positions if height.div_ceil(STRIDE) * width.div_ceil(STRIDE) == positions => Ok(()),
            positions => Err(format!(
                "MixVPR was trained on {positions} positions of {STRIDE} pixels, such as 320×320 for 400"
            )),
        }
    }
}

impl Describe for Parts<ResNet, ConvAp> {
    fn describe(&self, images: Tensor<4>) -> Tensor<2> {
        self.aggregator.forward(self.backbone.forward(images))
    }
}

impl Describe for Parts<Trunk, CosPlace> {
    fn describe(&self, images: Tensor<4>) -> Tensor<2> {
        self.aggregator.forward(self.backbone.forward(images))
    }
}

impl Describe for Parts<ResNet, Gem> {
    fn describe(&self, images: Tensor<4>) -> Tensor<2> {
        l2_normalize(self.aggregator.forward(self.backbone.forward(images)), 1)
    }
}

/// BoQ on ResNet-50 to layer3: `resnet50_16384.pth` of `amaralibey/Bag-of-Queries`.
///
/// # Errors
///
/// As [`open`](super::open).
pub fn boq_resnet50(weights: Weights, device: &Device) -> Result<Loaded<Parts<ResNet, Boq>>> {
    let weights = weights.renamed(&SEQUENTIAL_RESNET)?;
    let backbone = resnet(&weights, "backbone.")?;
    let head = BoqConfig::from_weights(&weights, "aggregator.")?;
    Loaded::new(backbone.init(device), head.init(device), head.dimension(), weights)
}

/// MixVPR on ResNet-50 to layer3: `resnet50_MixVPR_4096_channels(1024)_rows(4).ckpt` and the smaller
/// ones of `amaralibey/MixVPR`.
///
/// # Errors
///
/// As [`open`](super::open).
pub fn mixvpr(weights: Weights, device: &Device) -> Result<Loaded<Parts<ResNet, MixVpr>>> {
    let weights = weights.renamed(&[(r"^backbone\.model\.", "backbone.")])?;
    let weights = mixing::from_official(weights)?;
    let backbone = resnet(&weights, "backbone.")?;
    let head = MixVprConfig::from_weights(&weights, "aggregator.")?;
    let dimension = head.out_channels * head.out_rows;
    Loaded::new(backbone.init(device), head.init(device), dimension, weights)
}

/// ConvAP on ResNet-50: `resnet50_ConvAP_1024_2x2.ckpt` and others of `amaralibey/gsv-cities`.
///
/// # Errors
///
/// As [`open`](super::open).
pub fn convap(weights: Weights, device: &Device) -> Result<Loaded<Parts<ResNet, ConvAp>>> {
    let weights = weights.renamed(&[(r"^backbone\.model\.", "backbone.")])?;
    let backbone = resnet(&weights, "backbone.")?;
    let head = ConvApConfig::from_weights(&weights, "aggregator.")?;
    let dimension = head.reduced * head.cells[0] * head.cells[1];
    Loaded::new(backbone.init(device), head.init(device), dimension, weights)
}

/// CosPlace and EigenPlaces, which are one network, on any ResNet or VGG16:
/// `ResNet50_2048_cosplace.pth`, … of `gmberton/CosPlace`, `ResNet50_2048_eigenplaces.pth`, … of
/// `gmberton/EigenPlaces`.
///
/// # Errors
///
/// As [`open`](super::open).
pub fn cosplace(weights: Weights, device: &Device) -> Result<Loaded<Parts<Trunk, CosPlace>>> {
    let head =
        [(r"^aggregation\.1\.p$", "aggregator.gem.p"), (r"^aggregation\.3\.", "aggregator.fc.")];
    let weights = weights.renamed(&head)?;
    // VGG16 begins with a 3×3 convolution, a ResNet with one of 7×7.
    let shapes = Shapes::new(&weights, "");
    // What was trained further here has names of its own.
    let is_ours = shapes.has("backbone.conv1.weight");
    let (weights, backbone) = if shapes.has("backbone.features.0.weight")
        || (!is_ours && shapes.axis("backbone.0.weight", 2)? == 3)
    {
        let network = Vgg16Config::new().with_crop(Crop::Conv5).init(device);
        (weights.renamed(&SEQUENTIAL_VGG)?, Trunk::Vgg16(network))
    } else {
        let weights = weights.renamed(&SEQUENTIAL_RESNET)?;
        let network = resnet(&weights, "backbone.")?.init(device);
        (weights, Trunk::ResNet(network))
    };
    let head = CosPlaceConfig::from_weights(&weights, "aggregator.")?;
    Loaded::new(backbone, head.init(device), head.dimension, weights)
}

/// GeM on ResNet-50, the network of STUN without its variance: `teacher_triplet/ckpt.pth.tar` of
/// `ramdrop/stun`; the variance head of a student is left out.
///
/// # Errors
///
/// As [`open`](super::open).
pub fn gem_resnet50(weights: Weights, device: &Device) -> Result<Loaded<Parts<ResNet, Gem>>> {
    let own = [(r"^backbone\.8\.p$", "aggregator.p"), (r"^var_head\..*$", "")];
    let weights = weights.renamed(&own)?.renamed(&SEQUENTIAL_RESNET)?;
    let backbone = resnet(&weights, "backbone.")?;
    let dimension = backbone.channels();
    Loaded::new(backbone.init(device), GemConfig::new().init(device), dimension, weights)
}

/// The exponent of the variances in AP-GeM's whitening.
const WHITENING_POWER: f32 = 0.25;

/// AP-GeM on ResNet-101: `Resnet-101-AP-GeM.pt` of `naver/deep-image-retrieval`, with the whitening that
/// lies beside its weights, `pca['Landmarks_clean']`, or as tensors `pca.mean`, `pca.components` and
/// `pca.explained_variance`.
///
/// # Errors
///
/// As [`open`](super::open).
pub fn ap_gem(weights: Weights, device: &Device) -> Result<Loaded<Parts<ResNet, GemWhitened>>> {
    // The checkpoint's own names; of its other whitenings, and of what else a PCA holds, nothing is used.
    let mut weights = weights.renamed(&[
        (r"^pca\.Landmarks_clean\.(mean|components|explained_variance)_$", "pca.$1"),
        (r"^pca\..*_$", ""),
    ])?;
    let shapes = Shapes::new(&weights, "");
    let (to, from) = (shapes.axis("pca.components", 0)?, shapes.axis("pca.components", 1)?);
    let mean = weights.take("pca.mean", &[from])?;
    let mut components = weights.take("pca.components", &[to, from])?;
    let variance = weights.take("pca.explained_variance", &[to])?;
    let mut shift = Vec::with_capacity(to);
    for (row, variance) in components.data.chunks_exact_mut(from).zip(&variance.data) {
        let scale = variance.powf(WHITENING_POWER);
        for it in row.iter_mut() {
            *it /= scale;
        }
        let dot = |(a, b): (&f32, &f32)| f64::from(*a) * f64::from(*b);
        #[expect(clippy::cast_possible_truncation, reason = "weights are f32")]
        shift.push(-row.iter().zip(&mean.data).map(dot).sum::<f64>() as f32);
    }
    let mut weights = weights.renamed(&[
        (r"^adpool\.p$", "aggregator.gem.p"),
        (r"^fc\.", "aggregator.fc."),
        (r"^((conv|bn|layer)\d.*)$", "backbone.$1"),
    ])?;
    weights.put("aggregator.whitening.weight", components);
    weights.put("aggregator.whitening.bias", Stored { shape: vec![to], data: shift });
    let backbone = resnet(&weights, "backbone.")?;
    let channels = backbone.channels();
    let middle = Shapes::new(&weights, "aggregator.").axis("fc.weight", 0)?;
    let head = GemWhitened {
        gem: GemConfig::new().init(device),
        fc: LinearConfig::new(channels, middle).init(device),
        whitening: Whitening::zeros(middle, to, device),
    };
    Loaded::new(backbone.init(device), head, to, weights)
}

/// What AP-GeM makes of a feature map: generalised means, a layer, unit length, whitening, unit length.
#[derive(Module, Debug)]
pub struct GemWhitened {
    gem: Gem,
    fc: Linear,
    whitening: Whitening,
}

impl Describe for Parts<ResNet, GemWhitened> {
    fn describe(&self, images: Tensor<4>) -> Tensor<2> {
        let head = &self.aggregator;
        let pooled = head.gem.forward(self.backbone.forward(images));
        head.whitening.forward(l2_normalize(head.fc.forward(pooled), 1))
    }
}
