//! Weights drawn from a stated seed.

use burn::{
    module::{Module, ModuleMapper, Param},
    tensor::{Tensor, TensorData},
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Draws every weight of rank 2 or more anew, in the order of the module's fields: normal with
/// variance 2 / fan-in (He, Zhang, Ren and Sun 2015). Fan-in is the first axis of a linear layer
/// (rank 2) and all axes but the first of a convolution. Biases become zero: those that a linear layer
/// is made with do not depend on the seed. Other weights of rank 1 stay.
#[must_use]
pub fn seeded<M: Module>(module: M, seed: u64) -> M {
    let random = ChaCha8Rng::seed_from_u64(seed);
    module.map(&mut Draws { random, field: String::new() })
}

struct Draws {
    random: ChaCha8Rng,
    /// The field that is being looked at.
    field: String,
}

impl Draws {
    /// Box and Muller's normal numbers.
    #[expect(clippy::cast_possible_truncation, reason = "weights are f32")]
    fn normal(&mut self) -> f32 {
        let (u, v): (f64, f64) = (self.random.random(), self.random.random());
        let radius = (-2.0 * (1.0 - u).ln()).sqrt();
        (radius * (std::f64::consts::TAU * v).cos()) as f32
    }
}

impl ModuleMapper for Draws {
    fn enter_module(&mut self, name: &str, _: &str) {
        name.clone_into(&mut self.field);
    }

    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        if D < 2 {
            if self.field != "bias" {
                return param;
            }
            return param.map(|old| {
                let tracked = old.is_require_grad();
                Tensor::zeros(old.dims(), &old.device()).set_require_grad(tracked)
            });
        }
        param.map(|old| {
            let shape = old.dims();
            let fan_in = if D == 2 { shape[0] } else { shape[1..].iter().product() };
            let deviation = (2.0 / fan_in as f32).sqrt();
            let n: usize = shape.iter().product();
            let values: Vec<f32> = (0..n).map(|_| deviation * self.normal()).collect();
            let tracked = old.is_require_grad();
            Tensor::from_data(TensorData::new(values, shape), &old.device())
                .set_require_grad(tracked)
        })
    }
}

#[cfg(test)]
mod tests {
    use burn::{
        nn::{LayerNormConfig, LinearConfig},
        tensor::Device,
    };

    use super::*;

    #[test]
    fn a_seed_decides_weights_and_leaves_nothing_to_chance() {
        let linear = |seed| seeded(LinearConfig::new(3, 2).init(&Device::flex()), seed);
        let values = |seed| -> [Vec<f32>; 2] {
            let linear = linear(seed);
            let bias = linear.bias.unwrap().val();
            [linear.weight.val().into_data(), bias.into_data()].map(|it| it.try_to_vec().unwrap())
        };
        assert_eq!(values(7), values(7));
        assert_ne!(values(7)[0], values(8)[0]);
        assert_eq!(values(7)[1], [0.0; 2]);
        let norm = seeded(LayerNormConfig::new(2).init(&Device::flex()), 7);
        let gamma: Vec<f32> = norm.gamma.val().into_data().try_to_vec().unwrap();
        assert_eq!(gamma, [1.0; 2]);
    }
}
