//! Networks of Caffe, as VPR-Bench runs them: AlexNet, AMOSNet, HybridNet, CALC, Region-VLAD.

use burn::tensor::{Device, Tensor, TensorData};
use ndarray::Array2;
use vpr_core::{Definition, Descriptors};

use super::network::{Ready, assembled};
use crate::{
    Result,
    aggregate::{GaussianProjection, Regions, pyramid as pooled},
    backbone::{
        AlexNet, AlexNetConfig, Calc,
        alexnet::{Layer, NormOrder},
    },
    layer::l2_normalize,
    weights::Weights,
};

/// Values of `conv3` of a 227×227 image: 384 × 13 × 13.
const CONV3: usize = 384 * 13 * 13;
/// What VPR-Bench projects them to: as many as CALC has.
const PROJECTED: usize = 1064;
/// The seed of its projection.
const SEED: u32 = 0;
/// Side of the images of AlexNet.
const SIDE: usize = 227;

/// The convolutions up to `end`; what else a file has is left out.
fn convolutions(weights: Weights, end: usize) -> Weights {
    let wanted = |key: &str| (1..=end).any(|at| key.starts_with(&format!("conv{at}.")));
    weights.mapped(|key, tensor| wanted(&key).then_some((key, tensor)))
}

/// Accepts images of one size only.
fn only(mut ready: Ready, [height, width]: [usize; 2]) -> Ready {
    ready.accepts = Box::new(move |rows, columns| {
        if [rows, columns] == [height, width] {
            Ok(())
        } else {
            Err(format!("takes images of height {height}, width {width} only"))
        }
    });
    ready
}

fn trunk(order: NormOrder, end: Layer, device: &Device) -> AlexNet {
    AlexNetConfig::new().with_order(order).with_end(end).init(device)
}

/// `conv3` of `bvlc_alexnet`, projected by the matrix that NumPy draws from seed 0.
pub(super) fn alexnet_conv3(weights: Weights, device: &Device) -> Result<Ready> {
    let network = trunk(NormOrder::BeforePooling, Layer::Conv3, device);
    let projection = GaussianProjection::as_numpy(CONV3, PROJECTED, SEED, device);
    let forward = move |network: &AlexNet, images| {
        l2_normalize(projection.forward(network.forward(images).flatten(1, 3)), 1)
    };
    Ok(only(assembled(network, convolutions(weights, 3), &[], forward)?, [SIDE, SIDE]))
}

/// `conv5` of AMOSNet or HybridNet under spatial pyramids.
pub(super) fn pyramid(weights: Weights, definition: Definition, device: &Device) -> Result<Ready> {
    let network = trunk(NormOrder::AfterPooling, Layer::Conv5, device);
    let forward = move |network: &AlexNet, images| pooled(network.forward(images), definition);
    Ok(only(assembled(network, convolutions(weights, 5), &[], forward)?, [SIDE, SIDE]))
}

/// The encoder of CALC, its descriptor at unit length.
pub(super) fn calc(weights: Weights, device: &Device) -> Result<Ready> {
    let forward = |network: &Calc, images| l2_normalize(network.forward(images), 1);
    let ready = assembled(Calc::new(device), convolutions(weights, 3), &[], forward)?;
    Ok(only(ready, [120, 160]))
}

/// Region-VLAD: `conv3` of AlexNet trained on Places365; the tensor `vocabulary`, `words × 384`,
/// stands beside its weights.
pub(super) fn region_vlad(
    mut weights: Weights,
    definition: Definition,
    device: &Device,
) -> Result<Ready> {
    let words = weights.take("vocabulary", &[Regions::WORDS, Regions::CHANNELS])?;
    let rows = Array2::from_shape_vec((Regions::WORDS, Regions::CHANNELS), words.data);
    let regions = Regions::new(Descriptors::new(rows.expect("it has this shape"))?, definition);
    let network = trunk(NormOrder::BeforePooling, Layer::Conv3, device);
    let forward = move |network: &AlexNet, images| {
        let map = network.forward(images);
        let [n, channels, rows, columns] = map.dims();
        let device = map.device();
        let values: Vec<f32> = map.into_data().try_into_vec().expect("the network computes in f32");
        let described: Vec<f32> = values
            .chunks_exact(channels * rows * columns)
            .flat_map(|map| regions.describe(map, [rows, columns]))
            .collect();
        let dimension = Regions::WORDS * Regions::CHANNELS;
        Tensor::<2>::from_data(TensorData::new(described, [n, dimension]), &device)
    };
    Ok(only(assembled(network, convolutions(weights, 3), &[], forward)?, [SIDE, SIDE]))
}
