//! PCA whitening as a layer.

use burn::module::{Initializer, Module, Param};
use burn::tensor::module::linear;
use burn::tensor::{Device, Tensor, TensorData};
use vpr_core::knn::{Pca, PcaParams};
use vpr_core::{Descriptors, Result};

use crate::layer::l2_normalize;

/// An affine map to fewer values and a final normalisation; keys `weight` and `bias` as a torch linear layer.
///
/// Jégou and Chum, *Negative Evidences and Co-occurences in Image Retrieval: the Benefit of PCA and
/// Whitening* (2012).
#[derive(Module, Debug)]
pub struct Whitening {
    /// `to × from`, not transposed: it is as large as a network.
    weight: Param<Tensor<2>>,
    bias: Param<Tensor<1>>,
}

impl Whitening {
    /// A layer from `from` to `to` values, to be loaded; all zero.
    #[must_use]
    pub fn zeros(from: usize, to: usize, device: &Device) -> Self {
        Self {
            weight: Initializer::Zeros.init([to, from], device),
            bias: Initializer::Zeros.init([to], device),
        }
    }

    /// Fits the `to` principal components of descriptors, each divided by its standard deviation.
    ///
    /// # Errors
    ///
    /// As [`Pca::fit`]: the descriptors must vary in that many directions.
    pub fn fit(descriptors: &Descriptors, to: usize, device: &Device) -> Result<Self> {
        let pca = Pca::fit(descriptors, &PcaParams { n_components: to, whiten: true })?;
        Ok(Self::from_pca(&pca, device))
    }

    /// The same projection as a layer.
    #[must_use]
    pub fn from_pca(pca: &Pca, device: &Device) -> Self {
        let (to, from) = (pca.n_components(), pca.mean().len());
        let shift = |row: &[f64]| -row.iter().zip(pca.mean()).map(|(a, b)| a * b).sum::<f64>();
        let bias: Vec<f64> = pca.projection().chunks_exact(from).map(shift).collect();
        let tensor = |data: TensorData| data.convert::<f32>();
        let weight = tensor(TensorData::new(pca.projection().to_vec(), [to, from]));
        let bias = tensor(TensorData::new(bias, [to]));
        Self { weight: Param::from_data(weight, device), bias: Param::from_data(bias, device) }
    }

    /// `batch × from` to unit descriptors, `batch × to`.
    #[must_use]
    pub fn forward(&self, descriptors: Tensor<2>) -> Tensor<2> {
        let weight = self.weight.val().transpose();
        l2_normalize(linear(descriptors, weight, Some(self.bias.val())), 1)
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::Distribution;
    use ndarray::Array2;

    use super::*;

    #[test]
    fn the_layer_is_the_normalised_projection() {
        let device = Device::flex();
        device.seed(3);
        let values = Tensor::<2>::random([40, 6], Distribution::Default, &device);
        let rows = values.clone().into_data().try_to_vec::<f32>().unwrap();
        let descriptors = Descriptors::new(Array2::from_shape_vec((40, 6), rows).unwrap()).unwrap();

        let layer = Whitening::fit(&descriptors, 4, &device).unwrap().forward(values);
        let pca = Pca::fit(&descriptors, &PcaParams { n_components: 4, whiten: true }).unwrap();
        let direct = pca.apply(&descriptors).unwrap().normalized();
        for (a, b) in layer.into_data().try_to_vec::<f32>().unwrap().iter().zip(direct.as_slice()) {
            approx::assert_abs_diff_eq!(a, b, epsilon = 1e-5);
        }
    }
}
