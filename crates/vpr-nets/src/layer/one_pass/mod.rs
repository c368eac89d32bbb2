//! The steps of a network between its matrix products and convolutions, over slices and on all
//! threads.
//!
//! burn-flex takes these in separate passes, most of them on one thread, and with the exponential
//! and error functions of libm, value by value (`docs/performance.md`). Here each pass is one loop
//! that the compiler vectorises for the registers found at run time. Sums are taken in a fixed
//! order, so that the bits do not depend on the number of threads.
#![expect(
    clippy::inline_always,
    reason = "only what is inlined into the dispatch is compiled for its registers"
)]

mod gelu;
mod moments;
mod norm;
mod rows;

pub(crate) use gelu::{gelu, gelu_gradient};
pub(crate) use moments::{Moments, Sets, Sharing};
pub(crate) use norm::{Affine, add_row, add_scaled_in_place, layer_norm};
pub(crate) use rows::{affine_map, standardize, unit};

use pulp::Arch;
use rayon::prelude::*;

/// Values that are summed side by side.
const LANES: usize = 16;

/// Rows that one thread takes at a time.
const ROWS_PER_TASK: usize = 32;

/// Runs `task` on chunks of whole rows of `out`, with the index of each chunk's first row.
fn for_rows(out: &mut [f32], width: usize, task: impl Fn(usize, &mut [f32]) + Sync) {
    out.par_chunks_mut(width * ROWS_PER_TASK).enumerate().for_each(|(index, rows)| {
        Arch::new().dispatch(
            #[inline(always)]
            || task(index * ROWS_PER_TASK, rows),
        );
    });
}

/// Σ f(x), by 16 partial sums.
#[inline(always)]
fn sum(values: &[f32], f: impl Fn(f32) -> f32) -> f32 {
    let (chunks, rest) = values.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for chunk in chunks {
        for (sum, &value) in sums.iter_mut().zip(chunk) {
            *sum += f(value);
        }
    }
    for (sum, &value) in sums.iter_mut().zip(rest) {
        *sum += f(value);
    }
    sums.iter().sum()
}

/// eˣ for x ≤ 0 to about one unit in the last place; what is below e⁻⁸⁷ becomes e⁻⁸⁷.
///
/// x = n ln 2 + r with |r| ≤ ln 2 / 2; the power of two is put together from its bits.
#[inline(always)]
pub(crate) fn exp_of_negative(x: f32) -> f32 {
    /// Adding it rounds to a whole number, which then stands in the lowest bits.
    const ROUND: f32 = 12_582_912.0;
    /// ln 2 in two parts, the first with zeros at its end.
    const LN_2: [f32; 2] = [0.693_359_4, -2.121_944_4e-4];
    let x = x.max(-87.0);
    let shifted = x * std::f32::consts::LOG2_E + ROUND;
    let n = shifted - ROUND;
    let r = x - n * LN_2[0] - n * LN_2[1];
    let tail = 1.0 / 24.0 + r * (1.0 / 120.0 + r * (1.0 / 720.0));
    let series = 1.0 + r * (1.0 + r * (0.5 + r * (1.0 / 6.0 + r * tail)));
    let power = f32::from_bits((shifted.to_bits() << 23).wrapping_add(1.0_f32.to_bits()));
    series * power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_is_that_of_f64() {
        for step in 0..870_000 {
            let x = -(step as f32) * 1e-4;
            let exact = f64::from(x).exp();
            let relative = (f64::from(exp_of_negative(x)) - exact).abs() / exact;
            assert!(relative < 3e-7, "e^{x}: {relative:e}");
        }
        assert!(exp_of_negative(f32::NEG_INFINITY) < 2e-38);
        assert_eq!(exp_of_negative(0.0), 1.0);
    }
}
