//! 3×3 convolution of stride 1 by Winograd's minimal filtering `F(4×4, 3×3)`: 36 instead of 144
//! multiplications per channel for 16 outputs (Lavin and Gray, CVPR 2016).
//!
//! Each of the 36 frequencies is a matrix product over channels. The columns of a panel are 16
//! tiles of 4×4 outputs, taken in order over rows, columns and images.
#![expect(
    clippy::inline_always,
    reason = "only what is inlined into the dispatch is compiled for its registers"
)]

use std::ops::Range;

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use super::{
    finish::{Activation, Finish},
    frequencies::{Frequencies, N_FREQUENCIES, REACH},
    geometry::Geometry,
    multiply::{DEPTH_BLOCK, Lanes, TILE, Tile, dispatch, multiply, vector_of},
};

/// Outputs of one tile, per axis.
const STEP: usize = 4;
/// Transformed input kept at a time, in bytes.
const INPUT_BYTES: usize = 1 << 20;

/// The tiles of all outputs.
#[derive(Clone, Copy)]
struct Tiles {
    geometry: Geometry,
    output: [usize; 2],
    /// Tiles per image, down and across.
    grid: [usize; 2],
}

impl Tiles {
    fn new(geometry: &Geometry, output: [usize; 2]) -> Self {
        Self { geometry: *geometry, output, grid: output.map(|it| it.div_ceil(STEP)) }
    }

    fn len(&self) -> usize {
        self.geometry.input[0] * self.grid[0] * self.grid[1]
    }

    /// Image and first output row and column of a tile.
    fn place(&self, tile: usize) -> (usize, [usize; 2]) {
        let [down, across] = self.grid;
        let (image, tile) = (tile / (down * across), tile % (down * across));
        (image, [tile / across * STEP, tile % across * STEP])
    }
}

/// Whether this way is likely faster than the direct one: fewer products, but four times the
/// weights to read and tiles that reach over the edge.
pub(super) fn suits(geometry: &Geometry, output: [usize; 2]) -> bool {
    let is_3x3 =
        geometry.kernel == [3, 3] && geometry.stride == [1, 1] && geometry.dilation == [1, 1];
    if !is_3x3 || geometry.input[1] < TILE || geometry.n_out < TILE {
        return false;
    }
    let tiles = Tiles::new(geometry, output).len().next_multiple_of(TILE);
    let pixels = geometry.input[0] * (output[0] * output[1]).next_multiple_of(TILE);
    // In multiplications of one pair of channels; reading a weight costs about as much as 7.
    let weight = 7.0 / 1.0;
    let direct = 9.0 * (pixels as f64 + weight);
    let here = 36.0 * (1.3 * tiles as f64 + weight);
    here < direct
}

/// Convolves a batch into `[images, n_out, pixels]`.
pub(super) fn convolve(
    input: &[f32],
    weights: &Frequencies,
    geometry: &Geometry,
    output: [usize; 2],
    finish: Finish<'_>,
) -> Vec<f32> {
    let [n_images, n_channels, height, width] = geometry.input;
    let per_image = geometry.n_out * output[0] * output[1];
    let mut values = vec![0.0; n_images * per_image];
    // Every thread takes some images from end to end; what is left over is shared.
    let share = n_images.div_ceil(rayon::current_num_threads());
    let inputs = input.par_chunks(share * n_channels * height * width);
    values.par_chunks_mut(share * per_image).zip(inputs).enumerate().for_each(
        |(index, (values, input))| {
            let residual =
                finish.residual.map(|it| &it[index * share * per_image..][..values.len()]);
            let n_images = values.len() / per_image;
            let geometry = Geometry { input: [n_images, n_channels, height, width], ..*geometry };
            convolve_into(values, input, weights, &geometry, output, Finish { residual, ..finish });
        },
    );
    values
}

/// Convolves some images.
fn convolve_into(
    values: &mut [f32],
    input: &[f32],
    weights: &Frequencies,
    geometry: &Geometry,
    output: [usize; 2],
    finish: Finish<'_>,
) {
    let tiles = Tiles::new(geometry, output);
    let n_channels = geometry.input[1];
    let n_pixels = output[0] * output[1];
    let n_panels = tiles.len().div_ceil(TILE);
    let per_block = (INPUT_BYTES / (N_FREQUENCIES * n_channels * size_of::<Lanes>())).max(1);
    for first in (0..n_panels).step_by(per_block) {
        let panels = first..(first + per_block).min(n_panels);
        let transformed = transform(input, &tiles, panels.clone());
        let n_groups = geometry.n_out.div_ceil(TILE);
        let per_part = n_groups.div_ceil(2 * rayon::current_num_threads()).max(1);
        let mut parts: Vec<Vec<&mut [f32]>> = Vec::new();
        parts.resize_with(n_groups.div_ceil(per_part), Vec::new);
        for (index, row) in values.chunks_exact_mut(n_pixels).enumerate() {
            parts[index % geometry.n_out / (per_part * TILE)].push(row);
        }
        parts.into_par_iter().enumerate().for_each(|(part, rows)| {
            let groups = part * per_part..((part + 1) * per_part).min(n_groups);
            let panels = panels.clone();
            let part =
                Part { transformed: &transformed, weights, tiles, panels, groups, rows, finish };
            dispatch(part);
        });
    }
}

/// The input of some panels as frequencies, `[panel][channel block][frequency][channel]`.
struct Transformed {
    blocks: Vec<Vec<Lanes>>,
    channels: Vec<Range<usize>>,
}

fn transform(input: &[f32], tiles: &Tiles, panels: Range<usize>) -> Transformed {
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
        let windows: Vec<_> = (self.panel * TILE..last).map(|it| self.tiles.window(it)).collect();
        let mut patch = [[0.0; TILE]; N_FREQUENCIES];
        for (index, channel) in self.channels.enumerate() {
            for (lane, (image, window)) in windows.iter().enumerate() {
                let plane = &self.input[(image * n_channels + channel) * height * width..];
                window.gather(&plane[..height * width], width, lane, &mut patch);
            }
            frequencies_of_input(simd, &mut patch);
            for (frequency, lanes) in patch.iter().enumerate() {
                blocks[frequency * n + index] = *lanes;
            }
        }
        blocks
    }
}

/// The 6×6 inputs of a tile, as far as they lie within their plane.
struct Window {
    /// Rows and columns of the patch that do.
    rows: Range<usize>,
    columns: Range<usize>,
    /// The first of them in the plane.
    start: usize,
}

impl Tiles {
    /// The image of a tile and its inputs there.
    fn window(&self, tile: usize) -> (usize, Window) {
        let (image, at) = self.place(tile);
        let Geometry { input: [_, _, height, width], before, .. } = self.geometry;
        let inside = |axis: usize, length: usize| {
            let first = before[axis].saturating_sub(at[axis]).min(REACH);
            let last = (length + before[axis]).saturating_sub(at[axis]).clamp(first, REACH);
            (first..last, (at[axis] + first).saturating_sub(before[axis]))
        };
        let ((rows, top), (columns, left)) = (inside(0, height), inside(1, width));
        (image, Window { rows, columns, start: top * width + left })
    }
}

impl Window {
    /// Copies the inputs into one lane, zeros where the padding is.
    #[inline(always)]
    fn gather(&self, plane: &[f32], width: usize, lane: usize, patch: &mut [Lanes; N_FREQUENCIES]) {
        let lines = patch.as_chunks_mut::<REACH>().0;
        if self.rows.len() == REACH && self.columns.len() == REACH {
            for (row, lines) in lines.iter_mut().enumerate() {
                let source: &[f32] = &plane[self.start + row * width..][..REACH];
                for (lanes, &value) in lines.iter_mut().zip(source) {
                    lanes[lane] = value;
                }
            }
            return;
        }
        for (row, lines) in lines.iter_mut().enumerate() {
            let mut values = [0.0; REACH];
            if self.rows.contains(&row) {
                let source = &plane[self.start + (row - self.rows.start) * width..];
                for (value, &source) in values[self.columns.clone()].iter_mut().zip(source) {
                    *value = source;
                }
            }
            for (lanes, value) in lines.iter_mut().zip(values) {
                lanes[lane] = value;
            }
        }
    }
}

/// `Bᵀ d B`, in place.
#[inline(always)]
fn frequencies_of_input<S: Simd>(simd: S, patch: &mut [Lanes; N_FREQUENCIES]) {
    for row in 0..REACH {
        input_line(simd, patch, row * REACH, 1);
    }
    for column in 0..REACH {
        input_line(simd, patch, column, REACH);
    }
}

/// One axis of [`frequencies_of_input`]: six rows of lanes from `first` on, `step` apart.
#[inline(always)]
fn input_line<S: Simd>(simd: S, patch: &mut [Lanes; N_FREQUENCIES], first: usize, step: usize) {
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
struct Part<'a> {
    transformed: &'a Transformed,
    weights: &'a Frequencies,
    tiles: Tiles,
    panels: Range<usize>,
    groups: Range<usize>,
    /// Planes of these channels, `[image][channel]`.
    rows: Vec<&'a mut [f32]>,
    finish: Finish<'a>,
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
