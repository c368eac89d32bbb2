//! Layers that give the same bits on every processor.
//!
//! burn-flex and the matrix products below it add as many numbers side by side as the registers
//! hold, so that AVX2 and AVX-512 round sums differently; a difference of 1e-7 in a descriptor
//! then swaps two nearly equal references, and a table moves. Where nothing records gradients and
//! tensors lie in memory, these add in a fixed order instead; elsewhere they are burn's layers.

use burn::{
    nn::{GroupNorm, Linear},
    tensor::Tensor,
};

use super::{
    memory::{InMemory, tensor},
    normalize,
    one_pass::{self, Affine},
};

/// Rows through a linear layer: `n × from` to `n × to`.
///
/// # Panics
///
/// If the rows have another length than the layer takes.
#[must_use]
pub fn linear(layer: &Linear, rows: Tensor<2>) -> Tensor<2> {
    let [n, length] = rows.dims();
    let [from, to] = layer.weight.dims();
    assert_eq!(length, from, "values of a row");
    let values = || {
        let weight = InMemory::new(&layer.weight.val())?;
        let bias = match &layer.bias {
            Some(bias) => InMemory::new(&bias.val())?.values().to_vec(),
            None => vec![0.0; to],
        };
        Some(one_pass::affine_map(InMemory::new(&rows)?.values(), weight.values(), &bias))
    };
    match values() {
        Some(values) => tensor(values, [n, to], &rows.device()),
        None => layer.forward(rows),
    }
}

/// Group normalisation of `images × channels × height × width` (Wu and He, ECCV 2018).
///
/// # Panics
///
/// If the map has another number of channels than the layer takes.
#[must_use]
pub fn group_norm(norm: &GroupNorm, map: Tensor<4>) -> Tensor<4> {
    let shape @ [_, channels, height, width] = map.dims();
    assert_eq!(channels, norm.num_channels, "channels of a map");
    let per_group = channels / norm.num_groups;
    let values = || {
        let gamma = InMemory::new(&norm.gamma.as_ref()?.val())?;
        let beta = InMemory::new(&norm.beta.as_ref()?.val())?;
        #[expect(clippy::cast_possible_truncation, reason = "a small constant")]
        let epsilon = norm.epsilon as f32;
        let affine = Affine { gamma: gamma.values(), beta: beta.values(), epsilon };
        let (run, map) = (per_group * height * width, InMemory::new(&map)?);
        Some(one_pass::standardize(map.values(), run, per_group, affine))
    };
    match values() {
        Some(values) => tensor(values, shape, &map.device()),
        None => normalize::group_norm(norm, &map).unwrap_or_else(|| norm.forward(map)),
    }
}

/// Every channel of every image (`images × channels × height × width`) with mean 0 and variance 1;
/// `epsilon` is added to the variance.
#[must_use]
pub fn standardize(images: Tensor<4>, epsilon: f32) -> Tensor<4> {
    let shape @ [batch, channels, height, width] = images.dims();
    if let Some(values) = InMemory::new(&images) {
        let affine = Affine { gamma: &[1.0], beta: &[0.0], epsilon };
        let values = one_pass::standardize(values.values(), height * width, 1, affine);
        return tensor(values, shape, &images.device());
    }
    let flat = images.reshape([batch, channels, height * width]);
    let centred = flat.clone() - flat.mean_dim(2);
    let variance = centred.clone().square().mean_dim(2);
    (centred / (variance + epsilon).sqrt()).reshape(shape)
}

#[cfg(test)]
mod tests {
    use burn::{
        module::Param,
        nn::{GroupNormConfig, LinearConfig},
        tensor::{Device, Distribution},
    };

    use super::*;

    const NORMAL: Distribution = Distribution::Normal(0.3, 2.0);

    fn assert_close<const D: usize>(ours: Tensor<D>, burns: Tensor<D>) {
        assert_eq!(ours.dims(), burns.dims());
        let gap: f32 = (ours - burns).abs().max().into_scalar();
        assert!(gap < 1e-5, "{gap}");
    }

    #[test]
    fn a_linear_layer_is_burns() {
        let device = Device::flex();
        for has_bias in [true, false] {
            let layer = LinearConfig::new(37, 21).with_bias(has_bias).init(&device);
            let rows = Tensor::random([70, 37], NORMAL, &device);
            assert_close(linear(&layer, rows.clone()), layer.forward(rows));
        }
    }

    #[test]
    fn group_normalisation_is_burns() {
        let device = Device::flex();
        let mut norm = GroupNormConfig::new(3, 12).init(&device);
        norm.gamma = Some(Param::from_tensor(Tensor::random([12], NORMAL, &device)));
        norm.beta = Some(Param::from_tensor(Tensor::random([12], NORMAL, &device)));
        let map = Tensor::random([5, 12, 7, 9], NORMAL, &device);
        assert_close(group_norm(&norm, map.clone()), norm.forward(map));
    }

    #[test]
    fn without_gradients_is_as_with() {
        let (device, recording) = (Device::flex(), Device::flex().autodiff());
        let images = Tensor::<4>::random([2, 3, 8, 11], NORMAL, &device);
        let recorded = Tensor::from_data(images.to_data(), &recording);
        assert_close(standardize(images, 1e-4), standardize(recorded, 1e-4).inner());
    }
}
