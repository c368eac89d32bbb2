//! Other heads on the default network's trunk, `BoQ` and SALAD: every clone has three networks.

use std::path::Path;

use burn::{
    module::{Module, ModuleDisplay, ModuleVisitor, Param},
    tensor::{Device, Tensor, TensorData},
};

use ndarray::Array2;

use super::{
    Describe, Tunable,
    default::{DefaultEncoderConfig, Trunk, rows},
};
use crate::{
    Result,
    aggregate::{Boq, BoqConfig, Salad, SaladConfig},
    encode::registry::Method,
    loss::SupervisedContrastive,
    train::{Learner, seeded},
    weights::{self, Precision, Report, Weights},
};

/// What the keys of the trunk begin with.
const TRUNK: &str = "trunk.";

/// What makes descriptors of the trunk's last map.
pub trait Head: Module + ModuleDisplay {
    /// Length of a descriptor.
    const DIMENSION: usize;

    /// A head with random weights, for a map of so many channels.
    fn init(channels: usize, device: &Device) -> Self;

    /// `batch × channels × rows × columns` to unit rows, `batch × DIMENSION`.
    fn describe(&self, map: Tensor<4>) -> Tensor<2>;
}

/// The default network's trunk under another head.
///
/// Two channels say where in the image a position is, column and row from −1 to 1: unlike those of
/// `DINOv2`, the trunk's features do not know it, and neither head would.
#[derive(Module, Debug)]
pub struct Headed<H: Module + ModuleDisplay> {
    trunk: Trunk,
    head: H,
}

/// `BoQ` with 64 channels, 32 queries in each of 2 blocks and 8 rows.
pub type BoqDefault = Headed<Boq>;
/// SALAD with 16 clusters of 32 channels and a token of 64, which is made of the map's mean.
pub type SaladDefault = Headed<Salad>;

impl Head for Boq {
    const DIMENSION: usize = 512;

    fn init(channels: usize, device: &Device) -> Self {
        let config = BoqConfig::new(channels).with_projected(64).with_queries(32).with_rows(8);
        config.init(device)
    }

    fn describe(&self, map: Tensor<4>) -> Tensor<2> {
        self.forward(map)
    }
}

impl Head for Salad {
    const DIMENSION: usize = 576;

    fn init(channels: usize, device: &Device) -> Self {
        // Draws of dropout would not be those of a run that was killed.
        let config = SaladConfig::new(channels).with_hidden(256).with_dropout(0.0);
        config.with_clusters(16).with_cluster_dim(32).with_token_dim(64).init(device)
    }

    fn describe(&self, map: Tensor<4>) -> Tensor<2> {
        let token = map.clone().mean_dim(3).mean_dim(2).flatten(1, 3);
        self.forward(map, token)
    }
}

impl<H: Head> Headed<H> {
    /// The trunk that every clone has, under a head with weights drawn from `seed`.
    ///
    /// # Errors
    ///
    /// Never, as long as the built-in weights are those of the default network.
    pub fn fresh(seed: u64, device: &Device) -> Result<Self> {
        let head = seeded(Self::init(device).head, seed);
        Ok(Self { trunk: built_in_trunk(device)?, head })
    }

    /// With random weights.
    #[must_use]
    pub fn init(device: &Device) -> Self {
        let trunk = DefaultEncoderConfig::new().trunk(device);
        let head = H::init(trunk.channels() + 2, device);
        Self { trunk, head }
    }

    /// What the head gets of images, `batch × 3 × height × width` in 0 to 1: the trunk's last map and
    /// where its positions are.
    #[must_use]
    pub fn located_map(&self, images: Tensor<4>) -> Tensor<4> {
        located(self.trunk.last_map(images))
    }

    /// [`Self::located_map`] of images without tensors, as [`Tunable::rows`] takes them: a row each, and
    /// channels, rows and columns of a map.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::Format`] if the images are not of that size.
    pub fn maps(
        &self,
        images: &[f32],
        size: (usize, usize),
        batch: usize,
    ) -> Result<(Array2<f32>, [usize; 3])> {
        let trunk = self.trunk.valid();
        let maps = rows(images, size, batch, |it| located(trunk.last_map(it)).flatten(1, 3))?;
        let along = |side: usize| side.div_ceil(4).div_ceil(2).div_ceil(2);
        Ok((maps, [self.trunk.channels() + 2, along(size.1), along(size.0)]))
    }

    /// The head.
    #[must_use]
    pub fn head(&self) -> &H {
        &self.head
    }
}

impl<H: Head> Describe for Headed<H> {
    fn describe(&self, images: Tensor<4>) -> Tensor<2> {
        self.head.describe(self.located_map(images))
    }
}

impl<H: Head> Tunable for Headed<H> {
    /// As every network, but a file without a trunk leaves the one that every clone has.
    fn take(&mut self, weights: Weights) -> Result<Report> {
        if weights.iter().any(|(key, _)| key.starts_with(TRUNK)) {
            return weights.apply(self);
        }
        let mut alone = Alone { head: self.head.clone() };
        let report = weights.apply(&mut alone)?;
        let device = self.trunk.devices().into_iter().next().unwrap_or_else(crate::device);
        *self = Self { trunk: built_in_trunk(&device)?, head: alone.head };
        Ok(report)
    }

    /// As every network, but the trunk that every clone has is not repeated.
    fn write(&self, path: &Path, facts: &[(&str, String)], precision: Precision) -> Result<()> {
        if values(&self.trunk) != values(&built_in_trunk(&crate::device())?) {
            return weights::save(self, path, facts, precision);
        }
        weights::save(&Alone { head: self.head.clone() }, path, facts, precision)
    }
}

/// What [`Headed::maps`] made of some images, and which place each shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Maps {
    /// `n × channels × rows × columns` values.
    pub values: Vec<f32>,
    /// Channels, rows and columns.
    pub size: [usize; 3],
    /// The places, n.
    pub places: Vec<usize>,
}

/// A head learns from maps of the trunk as it is, under the loss of the default network.
impl<H: Head> Learner for Headed<H> {
    type Batch = Maps;

    fn learn(&self, batch: Maps, device: &Device) -> Tensor<1> {
        let Maps { values, size: [channels, rows, columns], places } = batch;
        let values = TensorData::new(values, [places.len(), channels, rows, columns]);
        let rows = self.head.describe(Tensor::from_data(values, device));
        SupervisedContrastive::default().forward(rows, &places)
    }
}

/// A head under the names that it has in its network.
#[derive(Module, Debug)]
struct Alone<H: Module + ModuleDisplay> {
    head: H,
}

fn built_in_trunk(device: &Device) -> Result<Trunk> {
    let mut network = DefaultEncoderConfig::new().init(device);
    Method::find("default", None)?.built_in_weights()?.apply(&mut network)?;
    Ok(network.trunk().clone())
}

/// All values of a trunk.
fn values(trunk: &Trunk) -> Vec<f32> {
    struct Values(Vec<f32>);
    impl ModuleVisitor for Values {
        fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
            self.0.extend(param.val().into_data().iter::<f32>());
        }
    }
    let mut values = Values(Vec::new());
    trunk.visit(&mut values);
    values.0
}

/// A map with two more channels: column and row of every position, from −1 to 1.
fn located(map: Tensor<4>) -> Tensor<4> {
    let [batch, _, rows, columns] = map.dims();
    let along = |at: usize, n: usize| (2 * at + 1) as f32 / n as f32 - 1.0;
    let across = (0..rows).flat_map(|_| (0..columns).map(|column| along(column, columns)));
    let down = (0..rows).flat_map(|row| (0..columns).map(move |_| along(row, rows)));
    let places: Vec<f32> = across.chain(down).collect();
    let places = Tensor::<1>::from_floats(places.as_slice(), &map.device());
    let places = places.reshape([1, 2, rows, columns]).expand([batch, 2, rows, columns]);
    Tensor::cat(vec![map, places], 1)
}

#[cfg(test)]
mod tests {
    use burn::tensor::Distribution;

    use super::*;
    use crate::model::default::INPUT;

    fn images(device: &Device) -> Tensor<4> {
        device.seed(5);
        Tensor::random([2, 3, INPUT.1, INPUT.0], Distribution::Default, device)
    }

    fn described<H: Head>(network: &Headed<H>) -> Vec<f32> {
        let rows = Describe::describe(network, images(&crate::device()));
        assert_eq!(rows.dims(), [2, H::DIMENSION]);
        rows.into_data().try_to_vec().unwrap()
    }

    fn a_file_has_the_head_alone<H: Head>() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("head.safetensors");
        let network = Headed::<H>::fresh(3, &crate::device()).unwrap();
        network.write(&path, &[], Precision::Single).unwrap();
        let weights = Weights::open(&path).unwrap();
        assert!(weights.iter().all(|(key, _)| key.starts_with("head.")));
        let mut other = Headed::<H>::init(&crate::device());
        assert_ne!(described(&other), described(&network));
        other.take(weights).unwrap();
        assert_eq!(described(&other), described(&network));
        // Another trunk is part of the file.
        let whole = Headed::<H>::init(&crate::device());
        whole.write(&path, &[], Precision::Single).unwrap();
        other.take(Weights::open(&path).unwrap()).unwrap();
        assert_eq!(described(&other), described(&whole));
    }

    #[test]
    fn a_file_has_no_trunk_that_every_clone_has() {
        a_file_has_the_head_alone::<Boq>();
        a_file_has_the_head_alone::<Salad>();
    }

    #[test]
    fn maps_are_those_that_a_head_gets() {
        let network = BoqDefault::fresh(1, &crate::device()).unwrap();
        let values: Vec<f32> = images(&crate::device()).into_data().try_to_vec().unwrap();
        let (maps, size) = network.maps(&values, INPUT, 1).unwrap();
        assert_eq!(size, [130, 6, 8]);
        assert_eq!(maps.dim(), (2, 130 * 48));
        let places = vec![0, 0];
        let batch = Maps { values: maps.iter().copied().collect(), size, places };
        let loss: f32 = network.learn(batch, &crate::device()).into_scalar();
        assert!(loss.is_finite());
    }

    #[test]
    fn positions_are_columns_and_rows() {
        let map = Tensor::<4>::zeros([1, 1, 2, 4], &crate::device());
        let values: Vec<f32> = located(map).into_data().try_to_vec().unwrap();
        let columns = [-0.75, -0.25, 0.25, 0.75];
        assert_eq!(values[8..12], columns);
        assert_eq!(values[12..16], columns);
        assert_eq!(values[16..], [-0.5, -0.5, -0.5, -0.5, 0.5, 0.5, 0.5, 0.5]);
    }
}
