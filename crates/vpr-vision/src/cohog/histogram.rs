//! Histograms of gradient orientations: one per cell, four normalised together per region.

use ndarray::{Array2, Array3, ArrayView3, Axis, s};
use vpr_core::Definition;

use super::{CoHogParams, gradient::Gradient};

/// A region whose histograms are shorter than this holds nothing but rounding: a step of one gray level gives
/// more than 10, rounding noise less than 1e-9.
const NO_CONTRAST: f64 = 1e-6;

/// Strength of every orientation in every cell, rows × columns × bins.
///
/// A pixel's strength is split between the two nearest of the bins that start at 0°, `360 / bins`, …
pub(super) fn cells(gradient: &Gradient, params: &CoHogParams) -> Array3<f64> {
    let (cell, n_cells, bins) =
        (params.cell_size, params.image_size / params.cell_size, params.bins);
    let width = 360.0 / bins as f32;
    let used = s![..n_cells * cell, ..n_cells * cell];
    let (strengths, angles) = (gradient.strength.slice(used), gradient.angle.slice(used));
    let mut cells = Array3::zeros((n_cells, n_cells, bins));
    for (y, (strengths, angles)) in strengths.outer_iter().zip(angles.outer_iter()).enumerate() {
        let mut row = cells.index_axis_mut(Axis(0), y / cell);
        let histograms = row.as_slice_mut().expect("standard layout").chunks_exact_mut(bins);
        let strengths = strengths.to_slice().expect("standard layout").chunks_exact(cell);
        let angles = angles.to_slice().expect("standard layout").chunks_exact(cell);
        for (histogram, (strengths, angles)) in histograms.zip(strengths.zip(angles)) {
            for (&strength, &angle) in strengths.iter().zip(angles) {
                let (lower, upper, share) = split(angle, width, bins, params.definition);
                histogram[lower] += f64::from(strength * (1.0 - share));
                histogram[upper] += f64::from(strength * share);
            }
        }
    }
    cells
}

/// The two bins nearest to an angle of 0 to 360° and the share of the second.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an angle of 0 to 360")]
fn split(angle: f32, width: f32, bins: usize, definition: Definition) -> (usize, usize, f32) {
    let lower = (angle / width) as usize;
    let share = (angle - lower as f32 * width) / width;
    if lower < bins {
        return (lower, if lower + 1 < bins { lower + 1 } else { 0 }, share);
    }
    match definition {
        Definition::Published => (bins - 1, 0, share),
        Definition::Corrected => (0, 1 % bins, share),
    }
}

/// Regions of 2 × 2 cells with one cell of overlap, row by row, each scaled to length one.
pub(super) fn regions(cells: &Array3<f64>, definition: Definition) -> Array2<f32> {
    let (rows, columns, bins) = cells.dim();
    let mut regions = Array2::zeros(((rows - 1) * (columns - 1), 4 * bins));
    let shortest = match definition {
        Definition::Published => 0.0,
        Definition::Corrected => NO_CONTRAST,
    };
    for (index, mut region) in regions.outer_iter_mut().enumerate() {
        let (y, x) = (index / (columns - 1), index % (columns - 1));
        let block: ArrayView3<'_, f64> = cells.slice(s![y..y + 2, x..x + 2, ..]);
        let length = block.iter().map(|value| value * value).sum::<f64>().sqrt();
        if length > shortest {
            #[expect(clippy::cast_possible_truncation, reason = "descriptors are f32")]
            region.iter_mut().zip(block).for_each(|(to, from)| *to = (from / length) as f32);
        }
    }
    regions
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these values are exact")]
mod tests {
    use super::*;

    fn gradient(angle: f32) -> Gradient {
        Gradient { strength: Array2::ones((32, 32)), angle: Array2::from_elem((32, 32), angle) }
    }

    fn first_cell(angle: f32, definition: Definition) -> Vec<f64> {
        let params = CoHogParams { image_size: 32, definition, ..CoHogParams::default() };
        cells(&gradient(angle), &params).slice(s![0, 0, ..]).to_vec()
    }

    #[test]
    fn strength_is_split_between_the_two_nearest_bins() {
        let published = |angle| first_cell(angle, Definition::Published);
        assert_eq!(published(0.0), [256.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(published(56.25), [0.0, 192.0, 64.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(published(337.5), [128.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 128.0]);
    }

    #[test]
    fn a_full_circle_is_the_last_bin_as_published_and_the_first_when_corrected() {
        assert_eq!(first_cell(360.0, Definition::Published)[7], 256.0);
        assert_eq!(first_cell(360.0, Definition::Corrected)[0], 256.0);
    }

    #[test]
    fn regions_go_row_by_row_and_hold_their_cells_row_by_row() {
        let cells =
            Array3::from_shape_fn((3, 3, 2), |(y, x, bin)| (10 * y + x) as f64 * bin as f64);
        let regions = regions(&cells, Definition::Published);
        assert_eq!(regions.dim(), (4, 8));
        let length = (1.0f32 + 4.0 + 121.0 + 144.0).sqrt();
        let expected = [0.0, 1.0, 0.0, 2.0, 0.0, 11.0, 0.0, 12.0].map(|value| value / length);
        for (actual, expected) in regions.row(1).iter().zip(expected) {
            assert!((actual - expected).abs() < 1e-6);
        }
    }

    #[test]
    fn noise_is_normalised_as_published_and_dropped_when_corrected() {
        let noise = Array3::from_elem((2, 2, 8), 1e-12);
        assert!(
            (regions(&noise, Definition::Published)[(0, 0)] - 32f32.sqrt().recip()).abs() < 1e-6
        );
        assert_eq!(regions(&noise, Definition::Corrected), Array2::<f32>::zeros((1, 32)));
        assert_eq!(regions(&Array3::zeros((2, 2, 8)), Definition::Published)[(0, 0)], 0.0);
    }
}
