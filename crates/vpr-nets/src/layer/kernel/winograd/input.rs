//! The input as frequencies.
#![expect(
    clippy::inline_always,
    reason = "only what is inlined into the dispatch is compiled for its registers"
)]

use std::ops::Range;

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use super::{
    super::multiply::{DEPTH_BLOCK, Lanes, TILE, dispatch, vector_of},
    kernels::{N_FREQUENCIES, REACH},
    tiles::{Patch, Tiles},
};

/// The input of some panels as frequencies, `[panel][channel block][frequency][channel]`.
pub(super) struct Transformed {
    pub(super) blocks: Vec<Vec<Lanes>>,
    pub(super) channels: Vec<Range<usize>>,
}

pub(super) fn transform(input: &[f32], tiles: &Tiles, panels: Range<usize>) -> Transformed {
    let n_channels = tiles.geometry.input[1];
    // Enough pieces for all threads; the sums do not depend on where a block ends.
    let n_blocks = rayon::current_num_threads().div_ceil(panels.len());
    let per_block = n_channels.div_ceil(n_blocks).clamp(1, DEPTH_BLOCK);
    let starts = (0..n_channels).step_by(per_block);
    let channels: Vec<_> = starts.map(|it| it..(it + per_block).min(n_channels)).collect();
    let pieces: Vec<_> =
        panels.flat_map(|panel| channels.iter().map(move |it| (panel, it.clone()))).collect();
    let blocks = pieces.into_par_iter();
    let blocks = blocks.map(|(panel, channels)| dispatch(Piece { input, tiles, panel, channels }));
    Transformed { blocks: blocks.collect(), channels }
}

/// Some channels of a panel, to be transformed.
struct Piece<'a> {
    input: &'a [f32],
    tiles: &'a Tiles,
    panel: usize,
    channels: Range<usize>,
}

impl WithSimd for Piece<'_> {
    type Output = Vec<Lanes>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<Lanes> {
        let n = self.channels.len();
        let mut blocks = vec![[0.0; TILE]; N_FREQUENCIES * n];
        let [_, n_channels, height, width] = self.tiles.geometry.input;
        let last = ((self.panel + 1) * TILE).min(self.tiles.len());
        let windows: Vec<_> = (self.panel * TILE..last).map(|it| self.tiles.inputs(it)).collect();
        let mut patch = [[0.0; TILE]; N_FREQUENCIES];
        for (index, channel) in self.channels.enumerate() {
            for (lane, (image, window)) in windows.iter().enumerate() {
                let plane = &self.input[(image * n_channels + channel) * height * width..];
                window.gather(&plane[..height * width], lane, &mut patch);
            }
            frequencies_of_input(simd, &mut patch);
            for (frequency, lanes) in patch.iter().enumerate() {
                blocks[frequency * n + index] = *lanes;
            }
        }
        blocks
    }
}

/// `Bᵀ d B`, in place.
#[inline(always)]
pub(super) fn frequencies_of_input<S: Simd>(simd: S, patch: &mut Patch) {
    for row in 0..REACH {
        input_line(simd, patch, row * REACH, 1);
    }
    for column in 0..REACH {
        input_line(simd, patch, column, REACH);
    }
}

/// One axis of [`frequencies_of_input`]: six rows of lanes from `first` on, `step` apart.
#[inline(always)]
fn input_line<S: Simd>(simd: S, patch: &mut Patch, first: usize, step: usize) {
    let (two, four, five) = (simd.splat_f32s(2.0), simd.splat_f32s(4.0), simd.splat_f32s(5.0));
    for vector in 0..TILE / S::F32_LANES {
        let mut d = [two; REACH];
        for (i, d) in d.iter_mut().enumerate() {
            *d = vector_of::<S>(&patch[first + i * step], vector);
        }
        let even = simd.sub_f32s(d[4], simd.mul_f32s(four, d[2]));
        let odd = simd.sub_f32s(d[3], simd.mul_f32s(four, d[1]));
        let even_2 = simd.sub_f32s(d[4], d[2]);
        let odd_2 = simd.mul_f32s(two, simd.sub_f32s(d[3], d[1]));
        let first_end = simd.sub_f32s(simd.mul_f32s(four, d[0]), simd.mul_f32s(five, d[2]));
        let last_end = simd.sub_f32s(simd.mul_f32s(four, d[1]), simd.mul_f32s(five, d[3]));
        let line = [
            simd.add_f32s(first_end, d[4]),
            simd.add_f32s(even, odd),
            simd.sub_f32s(even, odd),
            simd.add_f32s(even_2, odd_2),
            simd.sub_f32s(even_2, odd_2),
            simd.add_f32s(last_end, d[5]),
        ];
        for (i, line) in line.into_iter().enumerate() {
            S::as_mut_simd_f32s(&mut patch[first + i * step]).0[vector] = line;
        }
    }
}
