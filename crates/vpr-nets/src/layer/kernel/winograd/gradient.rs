//! Gradient of 3×3 kernels in the frequencies of their convolution, of which it is the adjoint:
//! `Gᵀ (Σ (A dy Aᵀ) ⊙ (Bᵀ d B)) G` over tiles, with 36 instead of 144 multiplications for each pair of
//! channels.
#![expect(
    clippy::inline_always,
    reason = "only what is inlined into the dispatch is compiled for its registers"
)]

use std::ops::Range;

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use super::{
    super::{
        geometry::Geometry,
        multiply::{Lanes, TILE, dispatch, multiply, vector_of},
    },
    input::frequencies_of_input,
    kernels::{N_FREQUENCIES, REACH},
    tiles::{Patch, STEP, Tiles},
};

/// Tiles that are transformed together; no power of two, so that the frequencies of a tile do not
/// meet in one place of the caches.
const BLOCK: usize = 240;
/// Transformed values kept at a time, in bytes.
const BYTES: usize = 16 << 20;

/// Whether this way is likely faster than lowering the input: fewer products, but tiles that reach
/// over the edge, and the way back from 36 sums for each pair of channels.
pub(in super::super) fn suits(geometry: &Geometry, output: [usize; 2]) -> bool {
    let is_3x3 =
        geometry.kernel == [3, 3] && geometry.stride == [1, 1] && geometry.dilation == [1, 1];
    if !is_3x3 || geometry.input[1] < TILE || geometry.n_out < TILE {
        return false;
    }
    let tiles = Tiles::new(geometry, output).len();
    let pixels = geometry.input[0] * output[0] * output[1];
    36 * (tiles + 8) < 9 * pixels
}

/// `[n_out, channels · 9]` from the input and the gradient `[images, n_out, pixels]` of the output. The
/// sums run over the tiles of a block, then over blocks.
pub(in super::super) fn weights_gradient(
    input: &[f32],
    gradient: &[f32],
    geometry: &Geometry,
    output: [usize; 2],
) -> Vec<f32> {
    let tiles = Tiles::new(geometry, output);
    let (n_out, n_channels) = (geometry.n_out, geometry.input[1]);
    let n_groups = [n_out.div_ceil(TILE), n_channels.div_ceil(TILE)];
    let blocks = (0..tiles.len()).step_by(BLOCK).map(|it| it..(it + BLOCK).min(tiles.len()));
    let blocks: Vec<_> = blocks.collect();
    let per_block = BLOCK * N_FREQUENCIES * size_of::<Lanes>() * (n_groups[0] + n_groups[1]);
    let mut values = vec![0.0; n_out * n_channels * 9];
    for blocks in blocks.chunks((BYTES / per_block).max(1)) {
        let slabs = |values, side, n_groups: usize| -> Vec<Vec<Lanes>> {
            let slabs = blocks.iter().flat_map(|it| (0..n_groups).map(|group| (it.clone(), group)));
            let slabs = slabs.collect::<Vec<_>>().into_par_iter();
            let slabs =
                slabs.map(|(block, group)| Slab { values, tiles: &tiles, block, group, side });
            slabs.map(dispatch).collect()
        };
        let outputs = slabs(gradient, Side::Output, n_groups[0]);
        let inputs = slabs(input, Side::Input, n_groups[1]);
        let pairs = (0..outputs.len() * n_groups[1]).into_par_iter().map(|index| {
            let (left, right) = (index / n_groups[1], index % n_groups[1]);
            let right = left / n_groups[0] * n_groups[1] + right;
            dispatch(Pair { outputs: &outputs[left], inputs: &inputs[right] })
        });
        let pairs: Vec<Vec<Kernels>> = pairs.collect();
        let per_block = pairs.chunks_exact(n_groups[0] * n_groups[1]);
        values.par_chunks_exact_mut(n_channels * 9).enumerate().for_each(|(out, values)| {
            for pairs in per_block.clone() {
                let pairs = pairs[out / TILE * n_groups[1]..].iter();
                for (values, pair) in values.chunks_mut(TILE * 9).zip(pairs) {
                    for (value, sum) in values.iter_mut().zip(pair[out % TILE]) {
                        *value += sum;
                    }
                }
            }
        });
    }
    values
}

/// The 3×3 gradients of one output channel and sixteen input channels.
type Kernels = [f32; TILE * 9];

/// Which planes are transformed.
#[derive(Clone, Copy)]
enum Side {
    Input,
    Output,
}

/// Sixteen channels of some tiles, to be transformed: `[frequency][tile]`, a lane per channel.
struct Slab<'a> {
    values: &'a [f32],
    tiles: &'a Tiles,
    block: Range<usize>,
    group: usize,
    side: Side,
}

impl WithSimd for Slab<'_> {
    type Output = Vec<Lanes>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<Lanes> {
        let n = self.block.len();
        let geometry = self.tiles.geometry;
        let (n_channels, size) = match self.side {
            Side::Input => (geometry.input[1], geometry.input[2] * geometry.input[3]),
            Side::Output => (geometry.n_out, self.tiles.output[0] * self.tiles.output[1]),
        };
        let first = self.group * TILE;
        let n_lanes = TILE.min(n_channels - first);
        let mut slab = vec![[0.0; TILE]; N_FREQUENCIES * n];
        // Lanes without a channel stay zero.
        let mut patch = [[0.0; TILE]; N_FREQUENCIES];
        for (index, tile) in self.block.enumerate() {
            let planes = |image: usize| {
                let planes = &self.values[(image * n_channels + first) * size..];
                planes.chunks_exact(size).take(n_lanes).enumerate()
            };
            match self.side {
                Side::Input => {
                    let (image, window) = self.tiles.inputs(tile);
                    planes(image).for_each(|(lane, plane)| window.gather(plane, lane, &mut patch));
                    frequencies_of_input(simd, &mut patch);
                }
                Side::Output => {
                    let (image, window) = self.tiles.outputs(tile);
                    planes(image).for_each(|(lane, plane)| window.gather(plane, lane, &mut patch));
                    frequencies_of_gradient(simd, &mut patch);
                }
            }
            for (frequency, lanes) in patch.iter().enumerate() {
                slab[frequency * n + index] = *lanes;
            }
        }
        slab
    }
}

/// `A dy Aᵀ` of the first four rows and columns, in place.
#[inline(always)]
fn frequencies_of_gradient<S: Simd>(simd: S, patch: &mut Patch) {
    for row in 0..STEP {
        gradient_line(simd, patch, row * REACH, 1);
    }
    for column in 0..REACH {
        gradient_line(simd, patch, column, REACH);
    }
}

/// One axis of [`frequencies_of_gradient`]: from four rows of lanes to six, from `first` on, `step` apart.
#[inline(always)]
fn gradient_line<S: Simd>(simd: S, patch: &mut Patch, first: usize, step: usize) {
    let (two, four) = (simd.splat_f32s(2.0), simd.splat_f32s(4.0));
    for vector in 0..TILE / S::F32_LANES {
        let mut d = [two; STEP];
        for (i, d) in d.iter_mut().enumerate() {
            *d = vector_of::<S>(&patch[first + i * step], vector);
        }
        let (even, odd) = (simd.add_f32s(d[0], d[2]), simd.add_f32s(d[1], d[3]));
        let even_2 = simd.mul_add_e_f32s(four, d[2], d[0]);
        let odd_2 = simd.mul_f32s(two, simd.mul_add_e_f32s(four, d[3], d[1]));
        let line = [
            d[0],
            simd.add_f32s(even, odd),
            simd.sub_f32s(even, odd),
            simd.add_f32s(even_2, odd_2),
            simd.sub_f32s(even_2, odd_2),
            d[3],
        ];
        for (i, line) in line.into_iter().enumerate() {
            S::as_mut_simd_f32s(&mut patch[first + i * step]).0[vector] = line;
        }
    }
}

/// Sixteen output channels and sixteen input channels, over the tiles of a block.
struct Pair<'a> {
    /// `[frequency][tile]`.
    outputs: &'a [Lanes],
    inputs: &'a [Lanes],
}

/// A value of 16 input channels.
type Wide = [f64; TILE];

impl WithSimd for Pair<'_> {
    type Output = Vec<Kernels>;

    /// The sums at every frequency, then `Gᵀ m G`, in f64 as the kernels' own frequencies.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "gradients are f32")]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<Kernels> {
        let n = self.outputs.len() / N_FREQUENCIES;
        let mut sums = vec![[[0.0; TILE]; TILE]; N_FREQUENCIES];
        let slabs = self.outputs.chunks_exact(n).zip(self.inputs.chunks_exact(n));
        for (sums, (outputs, inputs)) in sums.iter_mut().zip(slabs) {
            multiply(simd, outputs, inputs, sums, true);
        }
        let mut kernels = vec![[0.0; TILE * 9]; TILE];
        let mut half = [[[0.0; TILE]; REACH]; 3];
        for (row, kernels) in kernels.iter_mut().enumerate() {
            for x in 0..REACH {
                let m = std::array::from_fn(|y| sums[y * REACH + x][row].map(f64::from));
                let column = kernel_line(&m);
                for y in 0..3 {
                    half[y][x] = column[y];
                }
            }
            for y in 0..3 {
                let line = kernel_line(&half[y]);
                for x in 0..3 {
                    for lane in 0..TILE {
                        kernels[lane * 9 + y * 3 + x] = line[x][lane] as f32;
                    }
                }
            }
        }
        kernels
    }
}

/// One axis of `Gᵀ m G`.
#[inline(always)]
fn kernel_line(m: &[Wide; REACH]) -> [Wide; 3] {
    const SIXTH: f64 = 1.0 / 6.0;
    let mut line = [[0.0; TILE]; 3];
    for lane in 0..TILE {
        let (sum, difference) = (m[1][lane] + m[2][lane], m[2][lane] - m[1][lane]);
        let (sum_2, difference_2) = (m[3][lane] + m[4][lane], m[3][lane] - m[4][lane]);
        line[0][lane] = 0.25 * m[0][lane] + SIXTH * (0.25 * sum_2 - sum);
        line[1][lane] = SIXTH * (0.5 * difference_2 + difference);
        line[2][lane] = SIXTH * (sum_2 - sum) + m[5][lane];
    }
    line
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::{super::super::tests::noise, *};

    /// The definition, in f64.
    fn slow(input: &[f32], gradient: &[f32], geometry: &Geometry, output: [usize; 2]) -> Vec<f64> {
        let [n_images, n_channels, height, width] = geometry.input;
        let mut values = Vec::new();
        for out in 0..geometry.n_out {
            for at in 0..n_channels * 9 {
                let (channel, y, x) = (at / 9, at / 3 % 3, at % 3);
                let mut sum = 0.0;
                for image in 0..n_images {
                    for pixel in 0..output[0] * output[1] {
                        let row = (pixel / output[1] + y).checked_sub(geometry.before[0]);
                        let column = (pixel % output[1] + x).checked_sub(geometry.before[1]);
                        let (Some(row), Some(column)) = (row, column) else { continue };
                        if row < height && column < width {
                            let plane = (image * n_channels + channel) * height * width;
                            let seen = input[plane + row * width + column];
                            let plane = (image * geometry.n_out + out) * output[0] * output[1];
                            sum += f64::from(seen) * f64::from(gradient[plane + pixel]);
                        }
                    }
                }
                values.push(sum);
            }
        }
        values
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        /// Channels that leave lanes empty, planes smaller than a tile, several blocks.
        #[test]
        fn equals_the_definition(
            (n, c, k) in (1usize..20, 1usize..36, 1usize..36),
            (h, w) in (1usize..18, 1usize..18),
            before in prop::array::uniform2(0usize..4),
            after in prop::array::uniform2(0usize..4),
            seed in 0u32..1000,
        ) {
            let geometry = Geometry {
                input: [n, c, h, w], n_out: k, kernel: [3, 3], stride: [1, 1], before, after,
                dilation: [1, 1],
            };
            prop_assume!(geometry.output().is_some());
            let output = geometry.output().unwrap();
            let input = noise(n * c * h * w, seed);
            let gradient = noise(n * k * output[0] * output[1], seed + 1);
            let fast = weights_gradient(&input, &gradient, &geometry, output);
            let slow = slow(&input, &gradient, &geometry, output);
            prop_assert_eq!(fast.len(), slow.len());
            let norm = slow.iter().map(|it| it * it).sum::<f64>().sqrt();
            let off = fast.iter().zip(&slow).map(|(&a, b)| (f64::from(a) - b).powi(2)).sum::<f64>();
            prop_assert!(off.sqrt() <= 5e-6 * norm + 1e-9, "{} of {norm}", off.sqrt());
        }
    }
}
