//! Networks of Caffe, as VPR-Bench runs them: AlexNet, AMOSNet, HybridNet, CALC, Region-VLAD.

use std::path::Path;

use burn::tensor::{Device, Tensor, TensorData};
use ndarray::Array2;
use vpr_core::{Definition, Descriptors};

use super::network::{Ready, assembled};
use crate::weights::{MEAN_IMAGE, Tensor as Stored};
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

/// `conv5` of AMOSNet or HybridNet under spatial pyramids; the mean image that lies beside the weights is
/// subtracted, if it does.
pub(super) fn pyramid(
    mut weights: Weights,
    definition: Definition,
    device: &Device,
) -> Result<Ready> {
    let path = weights.path().to_owned();
    let mean = weights.take_any(MEAN_IMAGE).map(|it| mean_of(&path, &it, device)).transpose()?;
    let network = trunk(NormOrder::AfterPooling, Layer::Conv5, device);
    let has_mean = mean.is_some();
    let forward = move |network: &AlexNet, images: Tensor<4>| {
        let images = match &mean {
            Some(mean) => images - mean.clone(),
            None => images,
        };
        pooled(network.forward(images), definition)
    };
    let ready = assembled(network, convolutions(weights, 5), &[], forward)?;
    Ok(Ready { has_mean, ..only(ready, [SIDE, SIDE]) })
}

/// A mean image, blue first, at the size of the network's images.
///
/// It is resized bilinearly, without a filter, as the change of Caffe's `io.py` does that VPR-Bench
/// asks its users to make: the published mean is 256×256, and Caffe itself refuses it.
fn mean_of(path: &Path, mean: &Stored, device: &Device) -> Result<Tensor<4>> {
    let &[channels @ 3, rows, columns] = &mean.shape[..] else {
        let reason = format!("{:?} is not 3 × rows × columns", mean.shape);
        return Err(crate::Error::format(path, MEAN_IMAGE, reason));
    };
    let planes = mean.data.chunks_exact(rows * columns);
    let resized: Vec<f32> =
        planes.flat_map(|plane| bilinear(plane, [rows, columns], SIDE)).collect();
    Ok(Tensor::from_data(TensorData::new(resized, [1, channels, SIDE, SIDE]), device))
}

/// A plane at `side` × `side`, centres of pixels on centres; beyond the border, the border.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "places in a plane")]
fn bilinear(plane: &[f32], [rows, columns]: [usize; 2], side: usize) -> Vec<f32> {
    let between = |at: usize, len: usize| {
        let exact = (at as f64 + 0.5) * len as f64 / side as f64 - 0.5;
        let exact = exact.clamp(0.0, (len - 1) as f64);
        let lower = exact as usize;
        (lower, (lower + 1).min(len - 1), exact - lower as f64)
    };
    let across: Vec<_> = (0..side).map(|x| between(x, columns)).collect();
    let at = |y: usize, x: usize| f64::from(plane[y * columns + x]);
    let mut resized = Vec::with_capacity(side * side);
    for (top, bottom, down) in (0..side).map(|y| between(y, rows)) {
        for &(left, right, along) in &across {
            let on = |y: usize| at(y, left) * (1.0 - along) + at(y, right) * along;
            resized.push((on(top) * (1.0 - down) + on(bottom) * down) as f32);
        }
    }
    resized
}

/// The encoder of CALC, its descriptor at unit length.
pub(super) fn calc(weights: Weights, device: &Device) -> Result<Ready> {
    let forward = |network: &Calc, images| l2_normalize(network.forward(images), 1);
    let ready = assembled(Calc::new(device), convolutions(weights, 3), &[], forward)?;
    Ok(only(ready, [120, 160]))
}

/// Region-VLAD: `conv3` of AlexNet trained on Places365; the tensor `vocabulary`, `words × 384`,
/// stands beside its weights, or the estimators of `Vocabulary_400_Protocol2.pkl`.
pub(super) fn region_vlad(
    weights: Weights,
    definition: Definition,
    device: &Device,
) -> Result<Ready> {
    let mut weights = weights
        .renamed(&[(r"^400\.256\.conv3\.cluster_centers_$", "vocabulary"), (r"^\d+\..*$", "")])?;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_stays_a_ramp_when_it_is_resized() {
        let ramp: Vec<f32> =
            (0..8).flat_map(|y| (0..4_u8).map(move |x| 10.0 * f32::from(x) + y as f32)).collect();
        let small = bilinear(&ramp, [8, 4], 2);
        // Centres of the two pixels: 0.5 and 2.5 of four columns, 1.5 and 5.5 of eight rows.
        assert_eq!(small, [6.5, 26.5, 10.5, 30.5]);
        assert_eq!(bilinear(&[7.0], [1, 1], 3), [7.0; 9]);
    }
}
