//! Products of frequencies, and from there to outputs.
#![expect(
    clippy::inline_always,
    reason = "only what is inlined into the dispatch is compiled for its registers"
)]

use std::ops::Range;

use pulp::{Simd, WithSimd};

use super::{
    super::{
        finish::{Activation, Finish},
        multiply::{Lanes, TILE, Tile, multiply, vector_of},
    },
    input::Transformed,
    kernels::{Frequencies, N_FREQUENCIES, REACH},
    tiles::{STEP, Tiles},
};

/// One axis of `Aᵀ m A`.
#[inline(always)]
fn output_line<S: Simd>(simd: S, m: [S::f32s; REACH]) -> [S::f32s; STEP] {
    let (two, four, eight) = (simd.splat_f32s(2.0), simd.splat_f32s(4.0), simd.splat_f32s(8.0));
    let (sum, difference) = (simd.add_f32s(m[1], m[2]), simd.sub_f32s(m[1], m[2]));
    let (sum_2, difference_2) = (simd.add_f32s(m[3], m[4]), simd.sub_f32s(m[3], m[4]));
    let last = simd.add_f32s(difference, simd.mul_f32s(eight, difference_2));
    [
        simd.add_f32s(simd.add_f32s(m[0], sum), sum_2),
        simd.add_f32s(difference, simd.mul_f32s(two, difference_2)),
        simd.add_f32s(sum, simd.mul_f32s(four, sum_2)),
        simd.add_f32s(last, m[5]),
    ]
}

/// Some output channels of some panels.
pub(super) struct Part<'a> {
    pub(super) transformed: &'a Transformed,
    pub(super) weights: &'a Frequencies,
    pub(super) tiles: Tiles,
    pub(super) panels: Range<usize>,
    pub(super) groups: Range<usize>,
    /// Planes of these channels, `[image][channel]`.
    pub(super) rows: Vec<&'a mut [f32]>,
    pub(super) finish: Finish<'a>,
}

impl WithSimd for Part<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let n_blocks = self.transformed.channels.len();
        let n_panels = self.panels.len();
        let mut sums = vec![[[0.0; TILE]; TILE]; N_FREQUENCIES * n_panels];
        for group in self.groups.clone() {
            for frequency in 0..N_FREQUENCIES {
                for (block, channels) in self.transformed.channels.iter().enumerate() {
                    let rows = self.weights.group(group, frequency, channels.clone());
                    for panel in 0..n_panels {
                        let lanes = &self.transformed.blocks[panel * n_blocks + block];
                        let lanes = &lanes[frequency * rows.len()..][..rows.len()];
                        let sums = &mut sums[panel * N_FREQUENCIES + frequency];
                        multiply(simd, rows, lanes, sums, block == 0);
                    }
                }
            }
            for (index, sums) in sums.as_chunks::<N_FREQUENCIES>().0.iter().enumerate() {
                self.store(simd, self.panels.start + index, group, sums);
            }
        }
    }
}

impl Part<'_> {
    /// Transforms the sums of 16 channels and 16 tiles back and stores what lies inside.
    #[inline(always)]
    fn store<S: Simd>(
        &mut self,
        simd: S,
        panel: usize,
        group: usize,
        sums: &[Tile; N_FREQUENCIES],
    ) {
        let n_out = self.tiles.geometry.n_out;
        let per_image = (self.groups.end * TILE).min(n_out) - self.groups.start * TILE;
        let last = ((panel + 1) * TILE).min(self.tiles.len());
        for channel in group * TILE..((group + 1) * TILE).min(n_out) {
            let scale = self.finish.scale.map_or(1.0, |it| it[channel]);
            let shift = self.finish.shift.map_or(0.0, |it| it[channel]);
            let whole = outputs(simd, sums, channel % TILE, [scale, shift]);
            for (lane, tile) in (panel * TILE..last).enumerate() {
                let (image, [top, left]) = self.tiles.place(tile);
                let at = (image * n_out + channel) * self.tiles.output[0] * self.tiles.output[1];
                let plane = &mut *self.rows[image * per_image + channel - self.groups.start * TILE];
                scatter(&whole, lane, plane, at, [top, left], self.tiles.output, &self.finish);
            }
        }
    }
}

/// `scale · Aᵀ m A + shift` of one channel, `[row][column]`, a lane per tile.
#[inline(always)]
fn outputs<S: Simd>(
    simd: S,
    sums: &[Tile; N_FREQUENCIES],
    channel: usize,
    [scale, shift]: [f32; 2],
) -> [[Lanes; STEP]; STEP] {
    let (scale, shift) = (simd.splat_f32s(scale), simd.splat_f32s(shift));
    let mut half = [[[0.0; TILE]; STEP]; REACH];
    let mut whole = [[[0.0; TILE]; STEP]; STEP];
    for vector in 0..TILE / S::F32_LANES {
        for (x, half) in half.iter_mut().enumerate() {
            let mut m = [scale; REACH];
            for (y, m) in m.iter_mut().enumerate() {
                *m = vector_of::<S>(&sums[y * REACH + x][channel], vector);
            }
            for (half, line) in half.iter_mut().zip(output_line(simd, m)) {
                S::as_mut_simd_f32s(half).0[vector] = line;
            }
        }
        for (y, whole) in whole.iter_mut().enumerate() {
            let mut m = [scale; REACH];
            for (m, half) in m.iter_mut().zip(&half) {
                *m = vector_of::<S>(&half[y], vector);
            }
            for (whole, line) in whole.iter_mut().zip(output_line(simd, m)) {
                let value = simd.add_f32s(simd.mul_f32s(line, scale), shift);
                S::as_mut_simd_f32s(whole).0[vector] = value;
            }
        }
    }
    whole
}

/// Stores one lane's 4×4 outputs as far as they lie inside.
#[inline(always)]
fn scatter(
    whole: &[[Lanes; STEP]; STEP],
    lane: usize,
    plane: &mut [f32],
    at: usize,
    [top, left]: [usize; 2],
    [height, width]: [usize; 2],
    finish: &Finish<'_>,
) {
    let n = STEP.min(width - left);
    for (row, line) in whole.iter().enumerate().take(height - top) {
        let start = (top + row) * width + left;
        let mut values = [0.0; STEP];
        for (value, lanes) in values.iter_mut().zip(line) {
            *value = lanes[lane];
        }
        if let Some(residual) = finish.residual {
            for (value, residual) in values.iter_mut().zip(&residual[at + start..][..n]) {
                *value += residual;
            }
        }
        match finish.activation {
            Activation::None => {}
            Activation::Relu => values.iter_mut().for_each(|it| *it = it.max(0.0)),
            Activation::Relu6 => values.iter_mut().for_each(|it| *it = it.clamp(0.0, 6.0)),
        }
        if n == STEP {
            plane[start..start + STEP].copy_from_slice(&values);
        } else {
            plane[start..start + n].copy_from_slice(&values[..n]);
        }
    }
}
