//! 3×3 kernels as the frequencies that Winograd's filtering multiplies with.
#![expect(
    clippy::inline_always,
    reason = "only what is inlined into the dispatch is compiled for its registers"
)]

use std::ops::Range;

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use super::super::multiply::{Lanes, TILE, dispatch};

/// Inputs of one tile, per axis.
pub(super) const REACH: usize = 6;
/// Frequencies.
pub(super) const N_FREQUENCIES: usize = REACH * REACH;

/// Kernels as frequencies: for every 16 output channels a matrix per frequency, a row per channel.
#[derive(Clone, Debug)]
pub(in super::super) struct Frequencies {
    /// `[frequency][channel]` of every group of output channels; rows that fill the last are zero.
    groups: Vec<Vec<Lanes>>,
    n_channels: usize,
}

impl Frequencies {
    /// Transforms `[n_out, channels, 3, 3]`, in f64.
    pub(in super::super) fn new(weights: &[f32], n_out: usize, n_channels: usize) -> Self {
        let kernels = weights.as_chunks::<9>().0;
        let groups = kernels.par_chunks(TILE * n_channels.max(1)).take(n_out.div_ceil(TILE));
        let groups = groups.map(|kernels| dispatch(Kernels { kernels, n_channels })).collect();
        Self { groups, n_channels }
    }

    /// 16 output channels at one frequency, from one channel to another.
    pub(super) fn group(&self, group: usize, frequency: usize, channels: Range<usize>) -> &[Lanes] {
        &self.groups[group][frequency * self.n_channels..][channels]
    }
}

/// The kernels of up to 16 output channels, `[channel out][channel in]`.
struct Kernels<'a> {
    kernels: &'a [[f32; 9]],
    n_channels: usize,
}

/// A value of 16 output channels.
type Wide = [f64; TILE];

impl WithSimd for Kernels<'_> {
    /// `G g Gᵀ`, `[frequency][channel in]`.
    type Output = Vec<Lanes>;

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "weights are f32")]
    #[expect(clippy::needless_range_loop, reason = "counted loops over constants are vectorised")]
    fn with_simd<S: Simd>(self, _: S) -> Vec<Lanes> {
        let mut frequencies = vec![[0.0; TILE]; N_FREQUENCIES * self.n_channels];
        let mut kernel = [[0.0; TILE]; 9];
        let mut half = [[[0.0; TILE]; REACH]; 3];
        let mut line = [[0.0; TILE]; REACH];
        for channel in 0..self.n_channels {
            for lane in 0..self.kernels.len() / self.n_channels {
                let values = &self.kernels[lane * self.n_channels + channel];
                for element in 0..9 {
                    kernel[element][lane] = f64::from(values[element]);
                }
            }
            for row in 0..3 {
                let (a, b, c) = (&kernel[3 * row], &kernel[3 * row + 1], &kernel[3 * row + 2]);
                kernel_line(a, b, c, &mut half[row]);
            }
            for column in 0..REACH {
                kernel_line(&half[0][column], &half[1][column], &half[2][column], &mut line);
                for row in 0..REACH {
                    let at = (row * REACH + column) * self.n_channels + channel;
                    let lanes = &mut frequencies[at];
                    for lane in 0..TILE {
                        lanes[lane] = line[row][lane] as f32;
                    }
                }
            }
        }
        frequencies
    }
}

/// One axis of `G g Gᵀ`: the rows of `G` are (¼, 0, 0), (−⅙, ∓⅙, −⅙), (1/24, ±1/12, ⅙) and
/// (0, 0, 1).
#[inline(always)]
fn kernel_line(a: &Wide, b: &Wide, c: &Wide, line: &mut [Wide; REACH]) {
    for lane in 0..TILE {
        let (a, b, c) = (a[lane], b[lane], c[lane]);
        let (even, odd) = (-sixth(a + c), sixth(b));
        let (even_2, odd_2) = (0.25 * sixth(a) + sixth(c), 0.5 * odd);
        line[0][lane] = 0.25 * a;
        line[1][lane] = even - odd;
        line[2][lane] = even + odd;
        line[3][lane] = even_2 + odd_2;
        line[4][lane] = even_2 - odd_2;
        line[5][lane] = c;
    }
}

/// `x / 6` to the last bit, by an inverse and what it leaves (Markstein 1990): divisions took a fifth of
/// a training step.
#[inline(always)]
fn sixth(x: f64) -> f64 {
    const INVERSE: f64 = 1.0 / 6.0;
    let quotient = x * INVERSE;
    (-quotient).mul_add(6.0, x).mul_add(INVERSE, quotient)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sixth_is_that_of_a_division() {
        let mut bits = 1_u64;
        for _ in 0..1_000_000 {
            bits = bits
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            // Weights are f32: exponents far from the ends of f64.
            let x = f64::from_bits(bits >> 2 & 0x800f_ffff_ffff_ffff | 0x3fb0_0000_0000_0000)
                * f64::from((bits >> 54) as u32 as f32 - 512.0);
            assert_eq!(sixth(x).to_bits(), (x / 6.0).to_bits(), "{x:e}");
        }
        assert_eq!(sixth(0.0).to_bits(), 0.0_f64.to_bits());
    }
}
