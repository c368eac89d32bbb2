//! 3×3 convolution of stride 1 by Winograd's minimal filtering `F(4×4, 3×3)`: 36 instead of 144
//! multiplications per channel for 16 outputs (Lavin and Gray, CVPR 2016), and the gradient of its
//! kernels, which is the adjoint.
//!
//! Each of the 36 frequencies is a matrix product: over channels, where the columns of a panel are 16
//! tiles of 4×4 outputs, taken in order over rows, columns and images; for the gradient over tiles.

pub(super) mod gradient;
mod input;
mod kernels;
mod output;
mod tiles;

use rayon::prelude::*;

use self::{input::transform, kernels::N_FREQUENCIES, output::Part, tiles::Tiles};
use super::{
    finish::Finish,
    geometry::Geometry,
    multiply::{Lanes, TILE, dispatch},
};
pub(super) use kernels::Frequencies;

/// Transformed input kept at a time, in bytes.
const INPUT_BYTES: usize = 1 << 20;

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
