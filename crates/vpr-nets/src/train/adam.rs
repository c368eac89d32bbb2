//! Adam and `AdamW` in one pass over each parameter, on all threads.
//!
//! burn takes a dozen passes. The arithmetic is burn's, and so is every bit.
#![expect(
    clippy::inline_always,
    reason = "only what is inlined into the dispatch is compiled for its registers"
)]

use burn::{
    optim::{
        Adam as BurnAdam, AdamConfig, AdamState, AdamW as BurnAdamW, AdamWConfig, AdamWState,
        AdaptiveMomentumState, LearningRate, Optimizer,
    },
    tensor::{Device, Tensor},
};
use pulp::Arch;
use rayon::prelude::*;

use crate::layer::memory::{InMemory, InMemoryMut};

/// Share of the last moments that is kept.
const BETA: [f32; 2] = [0.9, 0.999];

/// Added to the root of the second moment.
const EPSILON: f32 = 1e-8;

/// Values that one thread takes at a time.
const CHUNK: usize = 1 << 14;

/// Adam (Kingma and Ba 2015), or `AdamW` (Loshchilov and Hutter 2019) if there is a decay.
#[derive(Clone, Copy, Debug)]
pub(super) struct Adam {
    /// What a step of `AdamW` takes off every weight, over the learning rate.
    pub(super) decay: Option<f32>,
}

/// The same of burn, for tensors that do not lie in memory.
fn burns() -> BurnAdam {
    AdamConfig::new().with_beta_1(BETA[0]).with_beta_2(BETA[1]).with_epsilon(EPSILON).build()
}

fn burns_with_decay(decay: f32) -> BurnAdamW {
    let config = AdamWConfig::new().with_beta_1(BETA[0]).with_beta_2(BETA[1]);
    config.with_epsilon(EPSILON).with_weight_decay(decay).build()
}

impl Optimizer for Adam {
    type State<const D: usize> = AdamState<D>;

    fn step<const D: usize>(
        &self,
        rate: LearningRate,
        weights: Tensor<D>,
        gradient: Tensor<D>,
        state: Option<AdamState<D>>,
    ) -> (Tensor<D>, Option<AdamState<D>>) {
        if let Some(gradient) = InMemory::new(&gradient)
            && InMemory::new(&weights).is_some()
        {
            let zeros = || weights.zeros_like();
            let (time, first, second) = match state {
                Some(AdamState { momentum: it }) => (it.time, it.moment_1, it.moment_2),
                None => (0, zeros(), zeros()),
            };
            let [mut weights, mut first, mut second] =
                [weights, first, second].map(InMemoryMut::new);
            let step = Step::new(rate, time + 1, self.decay);
            step.take_all(weights.values(), first.values(), second.values(), gradient.values());
            let past = AdaptiveMomentumState::new(time + 1, first.tensor(), second.tensor());
            return (weights.tensor(), Some(AdamState::new(past)));
        }
        let Some(decay) = self.decay else {
            return burns().step(rate, weights, gradient, state);
        };
        let state = state.map(|it| AdamWState::new(it.momentum));
        let (weights, state) = burns_with_decay(decay).step(rate, weights, gradient, state);
        (weights, state.map(|it| AdamState::new(it.momentum)))
    }

    fn to_device<const D: usize>(state: AdamState<D>, device: &Device) -> AdamState<D> {
        BurnAdam::to_device(state, device)
    }
}

/// The numbers of one step.
#[derive(Clone, Copy, Debug)]
struct Step {
    rate: f32,
    /// What the moments are divided by, as sums of geometric series.
    corrections: [f32; 2],
    /// Share of a weight that stays; `None` is Adam, which also divides in another order.
    kept: Option<f32>,
}

impl Step {
    #[expect(clippy::cast_possible_truncation, reason = "as burn has it")]
    fn new(rate: f64, time: usize, decay: Option<f32>) -> Self {
        let power = i32::try_from(time).unwrap_or(i32::MAX);
        Self {
            rate: rate as f32,
            corrections: BETA.map(|beta| 1.0 - beta.powi(power)),
            kept: decay.map(|decay| (1.0 - rate * f64::from(decay)) as f32),
        }
    }

    /// The step of all weights of a parameter, with its moments and gradient.
    fn take_all(
        &self,
        weights: &mut [f32],
        first: &mut [f32],
        second: &mut [f32],
        gradient: &[f32],
    ) {
        let moments = first.par_chunks_mut(CHUNK).zip(second.par_chunks_mut(CHUNK));
        let chunks = weights.par_chunks_mut(CHUNK).zip(moments).zip(gradient.par_chunks(CHUNK));
        chunks.for_each(|((weights, (first, second)), gradient)| {
            Arch::new().dispatch(
                #[inline(always)]
                || self.take(weights, first, second, gradient),
            );
        });
    }

    #[inline(always)]
    fn take(&self, weights: &mut [f32], first: &mut [f32], second: &mut [f32], gradient: &[f32]) {
        let moments = first.iter_mut().zip(second.iter_mut());
        for ((first, second), &gradient) in moments.zip(gradient) {
            *first = *first * BETA[0] + gradient * (1.0 - BETA[0]);
            *second = *second * BETA[1] + gradient * gradient * (1.0 - BETA[1]);
        }
        let moments = weights.iter_mut().zip(first.iter().zip(second.iter()));
        let [of_first, of_second] = self.corrections;
        match self.kept {
            None => {
                let root = of_second.sqrt();
                let (factor, epsilon) = (root / of_first, EPSILON * root);
                for (weight, (first, second)) in moments {
                    *weight -= first * factor / (second.sqrt() + epsilon) * self.rate;
                }
            }
            Some(kept) => {
                for (weight, (first, second)) in moments {
                    let step = first / of_first / ((second / of_second).sqrt() + EPSILON);
                    *weight = *weight * kept - step * self.rate;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The weights after some steps with gradients of either sign.
    fn run<O: Optimizer>(optimizer: &O, steps: usize) -> Vec<f32> {
        let tensor = |step: usize| {
            let value = |index: usize| ((index * 37 + step * 61) % 1009) as f32 / 500.0 - 1.0;
            let values: Vec<f32> = (0..37_037).map(value).collect();
            Tensor::<1>::from_floats(&values[..], &Device::flex()).reshape([37, 1001])
        };
        let (mut weights, mut state) = (tensor(0), None);
        for step in 1..=steps {
            (weights, state) = optimizer.step(3e-3, weights, tensor(step), state);
        }
        weights.into_data().try_to_vec().unwrap()
    }

    #[test]
    fn bits_are_burns() {
        for steps in [1, 2, 7] {
            let adam = Adam { decay: None };
            assert_eq!(run(&adam, steps), run(&burns(), steps), "Adam, {steps} steps");
            let adam = Adam { decay: Some(0.3) };
            let burns = burns_with_decay(0.3);
            assert_eq!(run(&adam, steps), run(&burns, steps), "AdamW, {steps} steps");
        }
    }
}
