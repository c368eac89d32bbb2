//! Which optimiser, as data.

use burn::optim::ModuleOptimizer;

use super::adam::Adam;

/// An optimiser and its numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Optimizer {
    /// Adam (Kingma and Ba 2015), β 0.9 and 0.999, ε 1e-8.
    Adam,
    /// Adam with decoupled weight decay (Loshchilov and Hutter 2019).
    AdamW {
        /// What a step takes off every weight, over the learning rate.
        decay: f32,
    },
}

impl Optimizer {
    /// An optimiser without a past.
    #[must_use]
    pub fn init(&self) -> ModuleOptimizer {
        ModuleOptimizer::from(match *self {
            Self::Adam => Adam { decay: None },
            Self::AdamW { decay } => Adam { decay: Some(decay) },
        })
    }
}

#[cfg(test)]
mod tests {
    use burn::{
        module::{Initializer, Module, Param},
        optim::GradientsParams,
        tensor::{Device, Tensor},
    };

    use super::*;

    #[derive(Module, Debug)]
    struct Point {
        at: Param<Tensor<1>>,
    }

    /// Three steps on x² by the papers' formulas, in f64.
    fn by_hand(decay: f64, rate: f64) -> f64 {
        let (mut x, mut m, mut v) = (1.0_f64, 0.0, 0.0);
        for step in 1..=3 {
            let gradient = 2.0 * x;
            m = 0.9 * m + 0.1 * gradient;
            v = 0.999 * v + 0.001 * gradient * gradient;
            let (m_hat, v_hat) = (m / (1.0 - 0.9_f64.powi(step)), v / (1.0 - 0.999_f64.powi(step)));
            x = x * (1.0 - rate * decay) - rate * m_hat / (v_hat.sqrt() + 1e-8);
        }
        x
    }

    #[test]
    fn three_steps_are_those_of_the_papers() {
        for (optimizer, decay) in [(Optimizer::Adam, 0.0), (Optimizer::AdamW { decay: 0.5 }, 0.5)] {
            let device = Device::flex().autodiff();
            let mut point = Point { at: Initializer::Ones.init([1], &device) };
            let mut state = optimizer.init();
            for _ in 0..3 {
                let loss = point.at.val().square().sum();
                let gradients = GradientsParams::from_grads(loss.backward(), &point);
                point = state.step(0.1, point, gradients);
            }
            let found = f64::from(point.at.val().into_scalar::<f32>());
            let expected = by_hand(decay, 0.1);
            assert!((found - expected).abs() < 1e-5, "{optimizer:?}: {found} {expected}");
        }
    }
}
