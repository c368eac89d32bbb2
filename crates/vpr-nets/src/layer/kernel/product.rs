//! Rows times a matrix: the linear layers of a transformer and their gradients.
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
    let width = matrix.len() / depth;
    multiplied(&Packed::new(rows, depth), rows.len() / depth, Right::Columns { matrix, width })
}

/// Rows of `depth` values times the transposed of a matrix whose rows have `depth` values too.
pub(crate) fn product_by_rows(rows: &[f32], matrix: &[f32], depth: usize) -> Vec<f32> {
    multiplied(&Packed::new(rows, depth), rows.len() / depth, Right::Rows { matrix, depth })
}

/// The transposed of a matrix times another of as many rows, `depth`.
pub(crate) fn product_by_columns(left: &[f32], matrix: &[f32], depth: usize) -> Vec<f32> {
    let (n_rows, width) = (left.len() / depth, matrix.len() / depth);
    multiplied(&Packed::columns(left, depth), n_rows, Right::Columns { matrix, width })
}

fn multiplied(rows: &Packed, n_rows: usize, right: Right<'_>) -> Vec<f32> {
    let width = right.width();
    let n_panels = width.div_ceil(TILE);
    let strips = (0..n_panels).into_par_iter().step_by(PANELS).map(|first| {
        let n_panels = PANELS.min(n_panels - first);
        dispatch(Strip { rows, n_groups: n_rows.div_ceil(TILE), right, first, n_panels })
    });
    let strips: Vec<Vec<Tile>> = strips.collect();
    let mut values = vec![0.0; n_rows * width];
    values.par_chunks_mut(TILE * width).enumerate().for_each(|(group, rows)| {
        for (row, values) in rows.chunks_exact_mut(width).enumerate() {
            for (strip, values) in strips.iter().zip(values.chunks_mut(PANELS * TILE)) {
                let n_panels = values.len().div_ceil(TILE);
                let tiles = &strip[group * n_panels..][..n_panels];
                for (tile, values) in tiles.iter().zip(values.chunks_mut(TILE)) {
                    drain(&tile[row], values);
                }
            }
        }
    });
    values
}

/// The right factor.
#[derive(Clone, Copy)]
enum Right<'a> {
    /// A matrix whose columns are multiplied with.
    Columns { matrix: &'a [f32], width: usize },
    /// A matrix whose rows are.
    Rows { matrix: &'a [f32], depth: usize },
}

impl Right<'_> {
    /// Columns of the result.
    fn width(&self) -> usize {
        match *self {
            Self::Columns { width, .. } => width,
            Self::Rows { matrix, depth } => matrix.len() / depth,
        }
    }
}

/// Some columns of the result.
struct Strip<'a> {
    rows: &'a Packed,
    n_groups: usize,
    right: Right<'a>,
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
        // Blocks of about one length: a last one of a few depths would cost as much around its sums.
        let block = depth.div_ceil(depth.div_ceil(DEPTH_BLOCK).max(1));
        for start in (0..depth).step_by(block.max(1)) {
            let depths = start..(start + block).min(depth);
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
    /// Copies `n` depths of the matrix from `start` on into the panels. Lanes behind its last column
    /// keep their zeros.
    fn copy(&self, start: usize, n: usize, panels: &mut [Lanes]) {
        let first = self.first * TILE;
        let last = (first + self.n_panels * TILE).min(self.right.width());
        match self.right {
            Right::Columns { matrix, width } => {
                let rows = matrix[start * width..].chunks_exact(width).take(n);
                for (depth, row) in rows.enumerate() {
                    for (panel, values) in row[first..last].chunks(TILE).enumerate() {
                        fill(&mut panels[panel * DEPTH_BLOCK + depth], values);
                    }
                }
            }
            Right::Rows { matrix, depth } => {
                let rows = matrix[first * depth..last * depth].chunks(TILE * depth);
                for (panel, rows) in panels.chunks_exact_mut(DEPTH_BLOCK).zip(rows) {
                    transpose(rows, depth, start, &mut panel[..n]);
                }
            }
        }
    }
}

/// Copies up to 16 values into lanes; whole ones without a call.
#[inline(always)]
fn fill(lanes: &mut Lanes, values: &[f32]) {
    match <&Lanes>::try_from(values) {
        Ok(whole) => *lanes = *whole,
        Err(_) => lanes[..values.len()].copy_from_slice(values),
    }
}

/// Copies as many lanes as there are values.
#[inline(always)]
fn drain(lanes: &Lanes, values: &mut [f32]) {
    match <&mut Lanes>::try_from(&mut *values) {
        Ok(whole) => *whole = *lanes,
        Err(_) => values.copy_from_slice(&lanes[..values.len()]),
    }
}

/// Rows of `depth` values, up to 16, as lanes from the depth `start` on; 16 depths at a time, so that
/// every line of the cache is read once.
fn transpose(rows: &[f32], depth: usize, start: usize, lanes: &mut [Lanes]) {
    for (block, lanes) in lanes.chunks_mut(TILE).enumerate() {
        for (row, values) in rows.chunks_exact(depth).enumerate() {
            let values = &values[start + block * TILE..][..lanes.len()];
            for (lanes, &value) in lanes.iter_mut().zip(values) {
                lanes[row] = value;
            }
        }
    }
}
