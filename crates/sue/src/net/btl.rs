//! The network of the Bayesian triplet loss.

use burn::{
    module::{Module, ModuleDisplay},
    tensor::{Device, Int, Tensor, TensorData},
};
use ndarray::Array2;
use vpr_nets::{
    loss::BayesianTriplet,
    model::default::{DefaultEncoder, DefaultEncoderConfig},
    train::{Trainable, seeded},
};

use super::{Backbone, Negatives, ResNetGem, ResNetTwoGem, VarianceHead, mine};

/// Width of the variance head's hidden layer on the default network.
const HIDDEN: usize = 64;

/// A descriptor and one variance for all its dimensions (BTL; Warburg, Jørgensen, Civera and
/// Hauberg, *Bayesian Triplet Loss*, ICCV 2021).
///
/// No code of the authors could be had, and the thesis found none (§5.3.1): the layers are those of
/// the paper, the names of the keys are ours.
#[derive(Module, Debug)]
pub struct Btl<B: Module + ModuleDisplay> {
    encoder: B,
    variance: VarianceHead,
}

impl Btl<DefaultEncoder> {
    /// On the default network, random weights.
    ///
    /// # Panics
    ///
    /// As [`DefaultEncoderConfig::init`].
    #[must_use]
    pub fn init(config: &DefaultEncoderConfig, device: &Device) -> Self {
        let variance = VarianceHead::init(config.pooled(), HIDDEN, device);
        Self { encoder: config.init(device), variance }
    }

    /// The same with this encoder and a variance head drawn from `seed`, whose variances begin near
    /// 1 / dimension on these images, the variance of the loss's prior: where training starts.
    #[must_use]
    pub fn start(self, encoder: DefaultEncoder, seed: u64, images: Tensor<4>) -> Self {
        let pooled = encoder.trunk().forward(images);
        let prior = 1.0 / encoder.dimension() as f64;
        Self { variance: seeded(self.variance, seed).centred(pooled, prior), encoder }
    }
}

impl Btl<ResNetTwoGem> {
    /// On ResNet-50, random weights: descriptors of 2048 values.
    #[must_use]
    pub fn resnet50(device: &Device) -> Self {
        let size = ResNetGem::DIMENSION;
        let variance = VarianceHead::init(size, size, device);
        Self { encoder: ResNetTwoGem::init(device), variance }
    }
}

impl<B: Backbone> Btl<B> {
    /// Images, `batch × 3 × height × width`, to descriptors of length one, `batch × dimension`, and
    /// their variances, `batch × 1`.
    #[must_use]
    pub fn forward(&self, images: Tensor<4>) -> (Tensor<2>, Tensor<2>) {
        let features = self.encoder.features(images);
        (features.descriptors, self.variance.forward(features.pooled))
    }
}

impl<B: Backbone> Trainable for Btl<B> {
    /// The Bayesian triplet loss over all pairs of a place with their semi-hard negative; 0 if the
    /// batch has no pair.
    fn loss(&self, images: Tensor<4>, places: &[usize]) -> Tensor<1> {
        let (means, variances) = self.forward(images);
        let device = means.device();
        let [n, dimension] = means.dims();
        let values: Vec<f32> = means.clone().detach().into_data().iter::<f32>().collect();
        // The shape is that of the tensor the values are from.
        let rows = Array2::from_shape_vec((n, dimension), values).unwrap_or_default();
        let triplets = mine(rows.view(), places, Negatives::SemiHard);
        if triplets.anchors.is_empty() {
            return (means.sum() + variances.sum()) * 0.0;
        }
        let [anchors, positives, negatives] =
            [triplets.anchors, triplets.positives, triplets.negatives].map(|rows| {
                let rows: Vec<i64> =
                    rows.into_iter().filter_map(|row| i64::try_from(row).ok()).collect();
                let shape = [rows.len()];
                let rows = Tensor::<1, Int>::from_data(TensorData::new(rows, shape), &device);
                (means.clone().select(0, rows.clone()), variances.clone().select(0, rows))
            });
        BayesianTriplet::default().forward(anchors, positives, negatives)
    }
}
