//! Rows times a matrix: the linear layers of a transformer.
//!
//! The rows are packed, the matrix is copied a strip of columns and a block of depth at a time. So
//! each of its values is read from memory once, and nothing is kept from call to call.
#![expect(
    clippy::inline_always,
    reason = "only what is inlined into the dispatch is compiled for its registers"
)]

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use super::multiply::{DEPTH_BLOCK, Lanes, Packed, TILE, Tile, dispatch, multiply};

/// Panels of 16 columns that share one pass over the rows: their block stays in the second cache.
const PANELS: usize = 4;

/// Rows of `depth` values times a matrix of `depth` rows; both and the result are row by row.
///
/// Terms are added in the order of the depth.
pub(crate) fn product(rows: &[f32], matrix: &[f32], depth: usize) -> Vec<f32> {
    let (n_rows, width) = (rows.len() / depth, matrix.len() / depth);
    let packed = Packed::new(rows, depth);
    let n_panels = width.div_ceil(TILE);
    let strips = (0..n_panels).into_par_iter().step_by(PANELS).map(|first| {
        let n_panels = PANELS.min(n_panels - first);
        dispatch(Strip {
            rows: &packed,
            n_groups: n_rows.div_ceil(TILE),
            matrix,
            width,
            first,
            n_panels,
        })
    });
    let strips: Vec<Vec<Tile>> = strips.collect();
    let mut values = vec![0.0; n_rows * width];
    values.par_chunks_mut(TILE * width).enumerate().for_each(|(group, rows)| {
        for (row, values) in rows.chunks_exact_mut(width).enumerate() {
            for (strip, values) in strips.iter().zip(values.chunks_mut(PANELS * TILE)) {
                let n_panels = values.len().div_ceil(TILE);
                let tiles = &strip[group * n_panels..][..n_panels];
                for (tile, values) in tiles.iter().zip(values.chunks_mut(TILE)) {
                    values.copy_from_slice(&tile[row][..values.len()]);
                }
            }
        }
    });
    values
}

/// Some columns of the result.
struct Strip<'a> {
    rows: &'a Packed,
    n_groups: usize,
    matrix: &'a [f32],
    /// Columns of the matrix.
    width: usize,
    /// First panel.
    first: usize,
    n_panels: usize,
}

impl WithSimd for Strip<'_> {
    /// `[group][panel]`.
    type Output = Vec<Tile>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<Tile> {
        let depth = self.rows.depth();
        let mut sums = vec![[[0.0; TILE]; TILE]; self.n_groups * self.n_panels];
        let mut panels = vec![[0.0; TILE]; self.n_panels * DEPTH_BLOCK];
        for start in (0..depth).step_by(DEPTH_BLOCK) {
            let depths = start..(start + DEPTH_BLOCK).min(depth);
            self.copy(depths.start, depths.len(), &mut panels);
            for (group, sums) in sums.chunks_exact_mut(self.n_panels).enumerate() {
                let rows = self.rows.group(group, depths.clone());
                for (panel, sums) in panels.chunks_exact(DEPTH_BLOCK).zip(sums) {
                    let panel = &panel[..rows.len()];
                    multiply(simd, rows, panel, sums, start == 0);
                }
            }
        }
        sums
    }
}

impl Strip<'_> {
    /// Copies `n` rows of the matrix from `start` on into the panels. Lanes behind its last column
    /// keep their zeros.
    fn copy(&self, start: usize, n: usize, panels: &mut [Lanes]) {
        let first = self.first * TILE;
        let last = (first + self.n_panels * TILE).min(self.width);
        let rows = self.matrix[start * self.width..].chunks_exact(self.width).take(n);
        for (depth, row) in rows.enumerate() {
            for (panel, values) in row[first..last].chunks(TILE).enumerate() {
                panels[panel * DEPTH_BLOCK + depth][..values.len()].copy_from_slice(values);
            }
        }
    }
}
