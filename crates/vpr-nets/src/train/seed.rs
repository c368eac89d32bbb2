//! Weights drawn from a stated seed.

use burn::{
    module::{Module, ModuleMapper, Param},
    tensor::{Tensor, TensorData},
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Draws every weight of rank 2 or more anew, in the order of the module's fields: normal with
/// variance 2 / fan-in (He, Zhang, Ren and Sun 2015). Fan-in is the first axis of a linear layer
/// (rank 2) and all axes but the first of a convolution. What is called `bias` becomes zero, which
/// burn would draw without our seed; other weights of rank 1, those of normalisations, stay.
#[must_use]
pub fn seeded<M: Module>(module: M, seed: u64) -> M {
    module.map(&mut Draws { random: ChaCha8Rng::seed_from_u64(seed), path: Vec::new() })
}

struct Draws {
    random: ChaCha8Rng,
    /// Names of the fields around the weight at hand, the innermost last.
    path: Vec<String>,
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
    fn enter_module(&mut self, name: &str, _container_type: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _name: &str, _container_type: &str) {
        self.path.pop();
    }

    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        if D < 2 {
            let is_bias = self.path.last().is_some_and(|name| name == "bias");
            return if is_bias {
                param.map(|old| old.zeros_like().set_require_grad(old.is_require_grad()))
            } else {
                param
            };
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
