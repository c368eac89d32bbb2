//! Votes of gradients for orientations, weighted, summed over cells and normalised over blocks.

use pulp::Simd;

use super::{
    HogParams,
    gradient::{Gradients, LANES, abs},
};

/// No bin of a block keeps more than this part of the block's length (the clipping of L2-Hys).
const CLIP: f32 = 0.2;

/// What a pixel counts for each cell of its block: Gaussian × tent, for one axis, `cells × block`.
///
/// Both are separable, so the weight of a pixel is the product of two of these.
pub(super) fn weights(params: &HogParams) -> Vec<f32> {
    let &HogParams { block, cell, .. } = params;
    let sigma = block as f64 / 4.0;
    let weight = |(at, pixel): (usize, usize)| {
        let gaussian = (-(pixel as f64 - block as f64 / 2.0).powi(2) / (2.0 * sigma * sigma)).exp();
        let distance = (pixel as f64 + 0.5) / cell as f64 - 0.5 - at as f64;
        (gaussian * (1.0 - distance.abs()).max(0.0)) as f32
    };
    (0..params.cells()).flat_map(|at| (0..block).map(move |pixel| (at, pixel))).map(weight).collect()
}

/// The descriptor of an image of the window's size.
///
/// Rows are visited once. Each adds its votes, weighted for its place in the block, to the columns of the block rows
/// it belongs to (`cell row × bin × x`); when a block row is complete its columns are weighted and summed along x.
#[expect(clippy::inline_always, reason = "takes the instruction set of the caller")]
#[inline(always)]
pub(super) fn describe<S: Simd, const C: usize>(
    simd: S,
    params: &HogParams,
    weights: &[f32],
    pixels: &[[u8; C]],
) -> Vec<f32> {
    let &HogParams { window, block, stride, bins, .. } = params;
    let (cells, across) = (params.cells(), params.blocks());
    let padded = window.next_multiple_of(LANES);
    let open = block.div_ceil(stride);
    let block_row = cells * bins * padded;
    let mut columns = vec![0.0; open * block_row];
    let mut votes = vec![0.0; padded];
    let mut turned = Turned::new::<S>(params);
    let mut descriptor = vec![0.0; params.dim()];
    let mut gradients = Gradients::new(pixels, window, bins);
    for y in 0..window {
        gradients.compute_row(simd, y);
        let first = (y + 1).saturating_sub(block).div_ceil(stride);
        let last = (y / stride).min(across - 1);
        for bin in 0..bins {
            let [bin_at, bins_at] = [bin as f32, bins as f32];
            vote(simd, &gradients.position, &gradients.magnitude, bin_at, bins_at, &mut votes);
            for row in first..=last {
                for cell in 0..cells {
                    let weight = weights[cell * block + y - row * stride];
                    let start = row % open * block_row + (cell * bins + bin) * padded;
                    if weight > 0.0 {
                        add(simd, weight, &votes, &mut columns[start..][..padded]);
                    }
                }
            }
        }
        if y + 1 == first * stride + block {
            let columns = &mut columns[first % open * block_row..][..block_row];
            turned.turn(columns, padded);
            turned.sum_along_x(simd, params, weights, first, &mut descriptor);
            columns.fill(0.0);
        }
    }
    descriptor.chunks_exact_mut(cells * cells * bins).for_each(normalise);
    descriptor
}

/// What the pixels of a row vote for one bin: their magnitude, shared linearly between the two nearest bins.
#[expect(clippy::inline_always, reason = "takes the instruction set of the caller")]
#[inline(always)]
fn vote<S: Simd>(
    simd: S,
    position: &[f32],
    magnitude: &[f32],
    bin: f32,
    bins: f32,
    votes: &mut [f32],
) {
    let [bin, bins, one, zero] = [bin, bins, 1.0, 0.0].map(|it| simd.splat_f32s(it));
    let (position, _) = S::as_simd_f32s(position);
    let (magnitude, _) = S::as_simd_f32s(magnitude);
    let (votes, _) = S::as_mut_simd_f32s(votes);
    for ((&position, &magnitude), vote) in position.iter().zip(magnitude).zip(votes) {
        let distance = abs(simd, simd.sub_f32s(position, bin));
        let distance = simd.min_f32s(distance, simd.sub_f32s(bins, distance));
        let share = simd.max_f32s(simd.sub_f32s(one, distance), zero);
        *vote = simd.mul_f32s(magnitude, share);
    }
}

#[expect(clippy::inline_always, reason = "takes the instruction set of the caller")]
#[inline(always)]
fn add<S: Simd>(simd: S, weight: f32, votes: &[f32], column: &mut [f32]) {
    let weight = simd.splat_f32s(weight);
    let (votes, _) = S::as_simd_f32s(votes);
    let (column, _) = S::as_mut_simd_f32s(column);
    for (sum, &vote) in column.iter_mut().zip(votes) {
        *sum = simd.add_f32s(*sum, simd.mul_f32s(weight, vote));
    }
}

/// The columns of one block row with bins, not pixels, next to each other, so that no sum crosses lanes.
struct Turned {
    /// Numbers at one x: cells × bins, padded to whole registers.
    depth: usize,
    /// `x × depth`.
    values: Vec<f32>,
}

impl Turned {
    fn new<S: Simd>(params: &HogParams) -> Self {
        let depth = (params.cells() * params.bins).next_multiple_of(S::F32_LANES);
        Self { depth, values: vec![0.0; depth * params.window] }
    }

    #[expect(clippy::inline_always, reason = "takes the instruction set of the caller")]
    #[inline(always)]
    fn turn(&mut self, columns: &[f32], padded: usize) {
        for (at, column) in columns.chunks_exact(padded).enumerate() {
            for (values, sum) in self.values.chunks_exact_mut(self.depth).zip(column) {
                values[at] = *sum;
            }
        }
    }

    /// Fills the histograms of one row of blocks; blocks are ordered by column, then row, and so are their cells.
    #[expect(clippy::inline_always, reason = "takes the instruction set of the caller")]
    #[inline(always)]
    fn sum_along_x<S: Simd>(
        &self,
        simd: S,
        params: &HogParams,
        weights: &[f32],
        row: usize,
        descriptor: &mut [f32],
    ) {
        let (cells, across) = (params.cells(), params.blocks());
        let histogram = cells * params.bins;
        let (values, _) = S::as_simd_f32s(&self.values);
        let registers = self.depth / S::F32_LANES;
        for left in 0..across {
            let values = &values[left * params.stride * registers..];
            for (cell, weights) in weights.chunks_exact(params.block).enumerate() {
                let start = ((left * across + row) * cells + cell) * histogram;
                let sums = descriptor[start..][..histogram].chunks_mut(S::F32_LANES);
                for (register, sums) in sums.enumerate() {
                    let mut sum = simd.splat_f32s(0.0);
                    for (&weight, &value) in weights.iter().zip(values[register..].iter().step_by(registers)) {
                        sum = simd.add_f32s(sum, simd.mul_f32s(simd.splat_f32s(weight), value));
                    }
                    simd.partial_store_f32s(sums, sum);
                }
            }
        }
    }
}

/// L2-Hys: to unit length, clipped, to unit length again; the two small constants are OpenCV's.
fn normalise(block: &mut [f32]) {
    let length = |block: &[f32]| block.iter().map(|it| it * it).sum::<f32>().sqrt();
    let scale = 1.0 / (length(block) + 0.1 * block.len() as f32);
    block.iter_mut().for_each(|it| *it = (*it * scale).min(CLIP));
    let scale = 1.0 / (length(block) + 1e-3);
    block.iter_mut().for_each(|it| *it *= scale);
}
