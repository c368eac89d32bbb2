//! Votes of gradients for orientations, weighted, summed over cells and normalised over blocks.

use pulp::Simd;

use super::{
    HogParams,
    gradient::{BAND, Gradients, LANES, padded},
};

/// No bin of a block keeps more than this part of the block's length (the clipping of L2-Hys).
const CLIP: f32 = 0.2;

/// What a pixel counts for each cell of its block: Gaussian × tent, for one axis, one padded row for each cell.
///
/// Both are separable, so the weight of a pixel is the product of two of these.
#[expect(clippy::cast_possible_truncation, reason = "weights are from 0 to 1, kept in f32")]
pub(super) fn weights(params: &HogParams) -> Vec<f32> {
    let &HogParams { block, cell, .. } = params;
    let sigma = block as f64 / 4.0;
    let weight = |at: usize, pixel: usize| {
        let gaussian = (-(pixel as f64 - block as f64 / 2.0).powi(2) / (2.0 * sigma * sigma)).exp();
        let distance = (pixel as f64 + 0.5) / cell as f64 - 0.5 - at as f64;
        let inside = if pixel < block { 1.0 } else { 0.0 };
        (inside * gaussian * (1.0 - distance.abs()).max(0.0)) as f32
    };
    let padded = block.next_multiple_of(LANES);
    (0..params.cells()).flat_map(|at| (0..padded).map(move |pixel| weight(at, pixel))).collect()
}

/// The descriptor of an image of the window's size.
///
/// Rows are visited once, a few at a time. Each adds its votes, weighted for its place in the block, to the columns
/// of the block rows it belongs to (`cell row × bin × x`); when a block row is complete, its columns are weighted and
/// summed along x.
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
    let width = padded(window);
    let open = (block + BAND - 1).div_ceil(stride);
    let mut columns = vec![0.0; open * cells * bins * width];
    let mut votes = vec![0.0; BAND * width];
    let mut descriptor = vec![0.0; params.dim()];
    let mut gradients = Gradients::new(pixels, window, bins);
    let mut complete = 0;
    for top in (0..window).step_by(BAND) {
        let bottom = (top + BAND).min(window);
        gradients.compute_rows(simd, top..bottom);
        let last = ((bottom - 1) / stride).min(across - 1);
        for bin in 0..bins {
            vote(simd, [&gradients.position, &gradients.magnitude], bin, bins, &mut votes);
            for row in complete..=last {
                for cell in 0..cells {
                    let weights = band(weights, params, cell, top, row * stride);
                    let start = ((row % open * cells + cell) * bins + bin) * width;
                    add(simd, weights, &votes, &mut columns[start..][..width]);
                }
            }
        }
        while complete < across && complete * stride + block <= bottom {
            let block_row = cells * bins * width;
            let columns = &mut columns[complete % open * block_row..][..block_row];
            sum_along_x(simd, params, weights, columns, complete, &mut descriptor);
            columns.fill(0.0);
            complete += 1;
        }
    }
    descriptor.chunks_exact_mut(cells * cells * bins).for_each(normalise);
    descriptor
}

/// Weights of the rows from `top` on for one cell of the block that starts at `start`; zero outside of the block.
fn band(weights: &[f32], params: &HogParams, cell: usize, top: usize, start: usize) -> [f32; BAND] {
    let length = params.block.next_multiple_of(LANES);
    let weights = &weights[cell * length..][..length];
    std::array::from_fn(|row| {
        (top + row).checked_sub(start).and_then(|at| weights.get(at)).copied().unwrap_or(0.0)
    })
}

/// What the pixels of a row vote for one bin: their magnitude, shared linearly between the two nearest bins.
#[expect(clippy::inline_always, reason = "takes the instruction set of the caller")]
#[inline(always)]
fn vote<S: Simd>(simd: S, gradients: [&[f32]; 2], bin: usize, bins: usize, votes: &mut [f32]) {
    let [position, magnitude] = gradients.map(|it| S::as_simd_f32s(it).0);
    let (votes, _) = S::as_mut_simd_f32s(votes);
    let votes = votes.iter_mut().zip(position).zip(magnitude);
    let before = simd.splat_f32s(bin as f32 - 1.0);
    let after = simd.splat_f32s(bin as f32 + 1.0);
    let last = simd.splat_f32s(bins as f32 - 1.0);
    let zero = simd.splat_f32s(0.0);
    let tent =
        |position| simd.min_f32s(simd.sub_f32s(position, before), simd.sub_f32s(after, position));
    if bin == 0 {
        for ((vote, &position), &magnitude) in votes {
            let around = simd.max_f32s(simd.sub_f32s(position, last), zero);
            *vote = simd.mul_f32s(magnitude, simd.max_f32s(tent(position), around));
        }
    } else if bin + 1 == bins {
        for ((vote, &position), &magnitude) in votes {
            let around = simd.max_f32s(simd.sub_f32s(zero, position), zero);
            *vote = simd.mul_f32s(magnitude, simd.max_f32s(tent(position), around));
        }
    } else {
        for ((vote, &position), &magnitude) in votes {
            *vote = simd.mul_f32s(magnitude, simd.max_f32s(tent(position), zero));
        }
    }
}

#[expect(clippy::inline_always, reason = "takes the instruction set of the caller")]
#[inline(always)]
fn add<S: Simd>(simd: S, weights: [f32; BAND], votes: &[f32], column: &mut [f32]) {
    if weights.iter().all(|&it| it == 0.0) {
        return;
    }
    let weights = weights.map(|it| simd.splat_f32s(it));
    let (column, _) = S::as_mut_simd_f32s(column);
    let (votes, _) = S::as_simd_f32s(votes);
    let (first, votes) = votes.split_at(column.len());
    let (second, votes) = votes.split_at(column.len());
    let (third, fourth) = votes.split_at(column.len());
    let votes = first.iter().zip(second).zip(third).zip(fourth);
    for (sum, (((&first, &second), &third), &fourth)) in column.iter_mut().zip(votes) {
        let upper =
            simd.add_f32s(simd.mul_f32s(weights[0], first), simd.mul_f32s(weights[1], second));
        let lower =
            simd.add_f32s(simd.mul_f32s(weights[2], third), simd.mul_f32s(weights[3], fourth));
        *sum = simd.add_f32s(*sum, simd.add_f32s(upper, lower));
    }
}

/// Fills the histograms of one row of blocks; blocks are ordered by column, then row, and so are cells in a block.
#[expect(clippy::inline_always, reason = "takes the instruction set of the caller")]
#[inline(always)]
fn sum_along_x<S: Simd>(
    simd: S,
    params: &HogParams,
    weights: &[f32],
    columns: &[f32],
    row: usize,
    descriptor: &mut [f32],
) {
    let &HogParams { window, block, stride, bins, .. } = params;
    let cells = params.cells();
    let padded_block = block.next_multiple_of(LANES);
    let histogram = cells * bins;
    let block_column = params.blocks() * cells * histogram;
    for (at, column) in columns.chunks_exact(padded(window)).enumerate() {
        let lefts = column.windows(padded_block).step_by(stride);
        for (pixels, blocks) in lefts.zip(descriptor.chunks_exact_mut(block_column)) {
            let (pixels, _) = S::as_simd_f32s(pixels);
            let histograms = blocks[row * cells * histogram..].chunks_exact_mut(histogram);
            for (weights, histograms) in weights.chunks_exact(padded_block).zip(histograms) {
                let (weights, _) = S::as_simd_f32s(weights);
                let mut sum = simd.splat_f32s(0.0);
                for (&weight, &pixel) in weights.iter().zip(pixels) {
                    sum = simd.add_f32s(sum, simd.mul_f32s(weight, pixel));
                }
                histograms[at] = simd.reduce_sum_f32s(sum);
            }
        }
    }
}

/// L2-Hys: to unit length, clipped, to unit length again; the two small constants are OpenCV's.
fn normalise(block: &mut [f32]) {
    let length = |block: &[f32]| block.iter().map(|it| it * it).sum::<f32>().sqrt();
    let scale = 1.0 / (length(block) + 0.1 * block.len() as f32);
    for it in &mut *block {
        *it = (*it * scale).min(CLIP);
    }
    let scale = 1.0 / (length(block) + 1e-3);
    for it in block {
        *it *= scale;
    }
}
