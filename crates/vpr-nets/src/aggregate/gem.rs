//! Generalised mean pooling.

use burn::config::Config;
use burn::module::{Initializer, Module, Param};
use burn::tensor::{Device, Tensor};

/// Smallest value that is raised to a power.
const FLOOR: f32 = 1e-6;

/// Generalised mean over positions, (mean xᵖ)^(1/p), with a learned p.
///
/// Radenović et al., *Fine-tuning CNN Image Retrieval with No Human Annotation* (2018);
/// key `p` as in `filipradenovic/cnnimageretrieval-pytorch` and all that follow it.
#[derive(Module, Debug)]
pub struct Gem {
    p: Param<Tensor<1>>,
}

/// Configuration of [`Gem`].
#[derive(Config, Debug)]
pub struct GemConfig {
    /// The exponent to start from; 1 is the mean, ∞ the maximum.
    #[config(default = 3.0)]
    pub p: f64,
}

impl GemConfig {
    /// A pooling with this exponent.
    #[must_use]
    pub fn init(&self, device: &Device) -> Gem {
        Gem { p: Initializer::Constant { value: self.p }.init([1], device) }
    }
}

impl Gem {
    /// Pools `batch × channels × rows × columns` to `batch × channels`; values below 1e-6 count as 1e-6.
    #[must_use]
    pub fn forward(&self, map: Tensor<4>) -> Tensor<2> {
        let [batch, channels, rows, columns] = map.dims();
        let x = map.reshape([batch, channels, rows * columns]).clamp_min(FLOOR);
        let p = self.p.val();
        let mean = x.powf(p.clone().unsqueeze()).mean_dim(2);
        mean.powf(p.recip().unsqueeze()).reshape([batch, channels])
    }
}
