//! Convolution as a matrix product of the kernel and lowered panels.
#![expect(
    clippy::inline_always,
    reason = "only what is inlined into the dispatch is compiled for its registers"
)]

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use super::{
    finish::Finish,
    geometry::Geometry,
    lower::Planes,
    multiply::{DEPTH_BLOCK, Lanes, Packed, TILE, Tile, dispatch, multiply},
};

/// Panels that share one pass over the weights.
const PANELS: usize = 8;

/// Convolves a batch with packed weights (`[n_out, channels · kernel]`) into `[images, n_out, pixels]`.
pub(super) fn convolve(
    input: &[f32],
    weights: &Packed,
    geometry: &Geometry,
    output: [usize; 2],
    finish: Finish<'_>,
) -> Vec<f32> {
    let [n_images, n_channels, height, width] = geometry.input;
    let n_pixels = output[0] * output[1];
    let mut values = vec![0.0; n_images * geometry.n_out * n_pixels];
    let planes: Vec<Planes<'_>> = input
        .par_chunks_exact(n_channels * height * width)
        .map(|image| Planes::new(image, geometry, output))
        .collect();
    // Whole images are independent; one image is split by groups of output channels.
    let n_groups = geometry.n_out.div_ceil(TILE);
    let n_parts = (2 * rayon::current_num_threads()).div_ceil(n_images).clamp(1, n_groups);
    let per_part = n_groups.div_ceil(n_parts) * TILE;
    let images = values.par_chunks_exact_mut(geometry.n_out * n_pixels).zip(&planes).enumerate();
    images.for_each(|(image, (values, planes))| {
        values.par_chunks_mut(per_part * n_pixels).enumerate().for_each(|(part, values)| {
            let first = part * per_part;
            let at = (image * geometry.n_out + first) * n_pixels;
            dispatch(Part { planes, weights, first, values, n_pixels, at, finish });
        });
    });
    values
}

/// Some output channels of one image.
struct Part<'a> {
    planes: &'a Planes<'a>,
    weights: &'a Packed,
    /// First output channel, a multiple of 16.
    first: usize,
    /// `[channels of this part, pixels]`.
    values: &'a mut [f32],
    n_pixels: usize,
    /// Where `values` lie in the whole output.
    at: usize,
    finish: Finish<'a>,
}

impl WithSimd for Part<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let n_groups = (self.values.len() / self.n_pixels).div_ceil(TILE);
        let n_panels = self.n_pixels.div_ceil(TILE);
        let mut panels = vec![[0.0; TILE]; PANELS.min(n_panels) * DEPTH_BLOCK];
        let mut sums = vec![[[0.0; TILE]; TILE]; PANELS.min(n_panels) * n_groups];
        for first_panel in (0..n_panels).step_by(PANELS) {
            let n = PANELS.min(n_panels - first_panel);
            products(
                simd,
                &self,
                first_panel,
                &mut panels[..n * DEPTH_BLOCK],
                &mut sums[..n * n_groups],
            );
            store(
                self.values,
                &sums[..n * n_groups],
                (first_panel * TILE, n),
                &Place {
                    first: self.first,
                    n_pixels: self.n_pixels,
                    at: self.at,
                    finish: self.finish,
                },
            );
        }
    }
}

/// Sums of some panels, `[group][panel]`.
#[inline(always)]
fn products<S: Simd>(
    simd: S,
    part: &Part<'_>,
    first_panel: usize,
    panels: &mut [Lanes],
    sums: &mut [Tile],
) {
    let depth = part.weights.depth();
    let n_panels = panels.len() / DEPTH_BLOCK;
    for start in (0..depth).step_by(DEPTH_BLOCK) {
        let depths = start..(start + DEPTH_BLOCK).min(depth);
        for (index, panel) in panels.chunks_exact_mut(DEPTH_BLOCK).enumerate() {
            part.planes.lower((first_panel + index) * TILE, depths.clone(), panel);
        }
        for (group, sums) in sums.chunks_exact_mut(n_panels).enumerate() {
            let rows = part.weights.group(part.first / TILE + group, depths.clone());
            for (panel, sums) in panels.chunks_exact(DEPTH_BLOCK).zip(sums) {
                let panel = &panel[..rows.len()];
                multiply(simd, rows, panel, sums, start == 0);
            }
        }
    }
}

/// Where a part of the output lies in the whole.
struct Place<'a> {
    first: usize,
    n_pixels: usize,
    at: usize,
    finish: Finish<'a>,
}

#[inline(always)]
fn store(values: &mut [f32], sums: &[Tile], (pixel, n_panels): (usize, usize), place: &Place<'_>) {
    for (channel, row) in values.chunks_exact_mut(place.n_pixels).enumerate() {
        let end = (pixel + n_panels * TILE).min(place.n_pixels);
        let at = place.at + channel * place.n_pixels + pixel;
        let tiles = &sums[channel / TILE * n_panels..][..n_panels];
        for (index, (out, tile)) in row[pixel..end].chunks_mut(TILE).zip(tiles).enumerate() {
            let sums = &tile[channel % TILE];
            place.finish.store(place.first + channel, sums, at + index * TILE, out);
        }
    }
}
