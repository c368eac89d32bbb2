//! Gradient of a convolution's weights: a matrix product over the output's pixels.
#![expect(
    clippy::inline_always,
    reason = "only what is inlined into the dispatch is compiled for its registers"
)]

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use super::{
    geometry::Geometry,
    lower::Planes,
    multiply::{DEPTH_BLOCK, Packed, TILE, Tile, dispatch, multiply},
    winograd,
};

/// Panels of 16 weights that share one pass over the output's gradient.
const PANELS: usize = 4;

/// `[n_out, channels · kernel]` from the input and the gradient `[images, n_out, pixels]` of the
/// output. The sums run over images, then pixels.
pub(crate) fn weights_gradient(
    input: &[f32],
    gradient: &[f32],
    geometry: &Geometry,
    output: [usize; 2],
) -> Vec<f32> {
    if winograd::gradient::suits(geometry, output) {
        return winograd::gradient::weights_gradient(input, gradient, geometry, output);
    }
    let [_, n_channels, height, width] = geometry.input;
    let (n_out, depth, n_pixels) = (geometry.n_out, geometry.depth(), output[0] * output[1]);
    let images = input.par_chunks_exact(n_channels * height * width);
    let images: Vec<_> = images.map(|image| Planes::new(image, geometry, output)).collect();
    let gradient = &Packed::of_images(gradient, n_out, n_pixels);
    let n_panels = depth.div_ceil(TILE);
    let blocks: Vec<usize> = (0..n_panels).step_by(PANELS).collect();
    let sums = blocks.into_par_iter().map(|first| {
        let n = PANELS.min(n_panels - first);
        dispatch(Block {
            images: &images,
            gradient,
            first,
            n,
            n_groups: n_out.div_ceil(TILE),
            n_pixels,
        })
    });
    let sums: Vec<Vec<Tile>> = sums.collect();
    let mut values = vec![0.0; n_out * depth];
    values.par_chunks_exact_mut(depth).enumerate().for_each(|(row, values)| {
        for (panel, values) in values.chunks_mut(TILE).enumerate() {
            let block = &sums[panel / PANELS];
            let n = block.len() / n_out.div_ceil(TILE);
            let tile = &block[row / TILE * n + panel % PANELS];
            values.copy_from_slice(&tile[row % TILE][..values.len()]);
        }
    });
    values
}

/// Some panels of weights, over all images.
struct Block<'a> {
    images: &'a [Planes<'a>],
    gradient: &'a Packed,
    first: usize,
    n: usize,
    n_groups: usize,
    n_pixels: usize,
}

impl WithSimd for Block<'_> {
    /// `[group][panel]`.
    type Output = Vec<Tile>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<Tile> {
        let mut sums = vec![[[0.0; TILE]; TILE]; self.n_groups * self.n];
        let mut panels = vec![[0.0; TILE]; self.n * DEPTH_BLOCK];
        let last = self.images.len() * self.n_pixels;
        for start in (0..last).step_by(DEPTH_BLOCK) {
            let depths = start..(start + DEPTH_BLOCK).min(last);
            for (index, panel) in panels.chunks_exact_mut(DEPTH_BLOCK).enumerate() {
                // Small images share a block.
                let mut depth = start;
                while depth < depths.end {
                    let (image, pixel) = (depth / self.n_pixels, depth % self.n_pixels);
                    let pixels = pixel..self.n_pixels.min(pixel + depths.end - depth);
                    let panel = &mut panel[depth - start..][..pixels.len()];
                    depth += pixels.len();
                    self.images[image].lower_weights((self.first + index) * TILE, pixels, panel);
                }
            }
            for (group, sums) in sums.chunks_exact_mut(self.n).enumerate() {
                let rows = self.gradient.group(group, depths.clone());
                for (panel, sums) in panels.chunks_exact(DEPTH_BLOCK).zip(sums) {
                    multiply(simd, rows, &panel[..rows.len()], sums, false);
                }
            }
        }
        sums
    }
}
