//! Learning rates by step.

use std::f64::consts::PI;

/// The learning rate of every step, counted from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Schedule {
    /// Always the same.
    Constant(f64),
    /// Multiplied by `factor` after every `every` steps.
    Steps {
        /// Rate of the first step.
        rate: f64,
        /// Steps between two changes.
        every: usize,
        /// What a change multiplies by.
        factor: f64,
    },
    /// Rises linearly over `warmup` steps, then falls as a half cosine to `last` at step `steps`.
    Cosine {
        /// Highest rate.
        rate: f64,
        /// Rate at the end.
        last: f64,
        /// Steps of the rise.
        warmup: usize,
        /// Steps of all.
        steps: usize,
    },
}

/// Longest warm-up of [`Schedule::warm_cosine`], steps.
const LONGEST_WARMUP: usize = 200;

impl Schedule {
    /// A cosine over `steps` steps from `rate` to a hundredth of it, after a warm-up over the first
    /// twentieth, of at most 200 steps.
    #[must_use]
    pub fn warm_cosine(steps: usize, rate: f64) -> Self {
        let warmup = steps.div_ceil(20).min(LONGEST_WARMUP);
        Self::Cosine { rate, last: 0.01 * rate, warmup, steps }
    }

    /// The rate of a step.
    #[must_use]
    pub fn rate(&self, step: usize) -> f64 {
        match *self {
            Self::Constant(rate) => rate,
            Self::Steps { rate, every, factor } => {
                let changes = i32::try_from(step / every.max(1)).unwrap_or(i32::MAX);
                rate * factor.powi(changes)
            }
            Self::Cosine { rate, warmup, .. } if step < warmup => {
                rate * (step + 1) as f64 / warmup as f64
            }
            Self::Cosine { rate, last, warmup, steps } => {
                let span = steps.saturating_sub(warmup).max(1);
                let done = ((step - warmup) as f64 / span as f64).min(1.0);
                last + 0.5 * (rate - last) * (1.0 + (PI * done).cos())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_divide_and_cosines_rise_and_fall() {
        let steps = Schedule::Steps { rate: 1.0, every: 10, factor: 0.5 };
        assert_eq!(
            [steps.rate(0), steps.rate(9), steps.rate(10), steps.rate(25)],
            [1.0, 1.0, 0.5, 0.25]
        );
        let cosine = Schedule::Cosine { rate: 2.0, last: 0.0, warmup: 4, steps: 104 };
        assert_eq!([cosine.rate(0), cosine.rate(3), cosine.rate(4)], [0.5, 2.0, 2.0]);
        assert!((cosine.rate(54) - 1.0).abs() < 1e-12 && cosine.rate(104) < 1e-12);
        assert!(cosine.rate(5_000) < 1e-12);
        assert_eq!(Schedule::Constant(0.1).rate(7), 0.1);
        let warm = |steps, warmup| Schedule::Cosine { rate: 2.0, last: 0.02, warmup, steps };
        for (steps, warmup) in [(1, 1), (600, 30), (3_000, 150), (4_000, 200), (9_000, 200)] {
            assert_eq!(Schedule::warm_cosine(steps, 2.0), warm(steps, warmup));
        }
    }
}
