//! The inner matrix product of everything here: 16 rows (output channels, tokens) by 16 columns at
//! a time.
//!
//! Left factors are packed once ([`Packed`]), right factors come as panels of 16 columns, so both
//! are read in order and no `unsafe` is needed. The widest registers of the processor are chosen
//! at run time. The terms of a sum are added in the order of the depth, whatever the number of
//! threads.
#![expect(
    clippy::inline_always,
    reason = "only what is inlined into the dispatch is compiled for its registers"
)]

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// Output channels and columns of one tile.
pub(super) const TILE: usize = 16;

/// One row of a panel: the values of 16 columns at one depth.
pub(super) type Lanes = [f32; TILE];

/// The sums of one tile, a row per output channel.
pub(super) type Tile = [Lanes; TILE];

/// Depth that is multiplied at a time: 16 KiB of each factor, so that both stay in the first cache.
pub(super) const DEPTH_BLOCK: usize = 256;

/// A matrix of `n_rows × depth`, packed by 16 rows and within those by depth. Rows that fill the
/// last group are zero.
#[derive(Clone, Debug)]
pub(super) struct Packed {
    values: Vec<Lanes>,
    depth: usize,
}

impl Packed {
    /// Packs a matrix given row by row, `depth` values each.
    pub(super) fn new(matrix: &[f32], depth: usize) -> Self {
        Self::of_images(matrix, matrix.len() / depth.max(1), depth)
    }

    /// Packs `[images, n_rows, n_pixels]` as rows that go on from image to image.
    ///
    /// A square of 16 × 16 values at a time: every line of the cache is read once and whole, also
    /// where the rows lie a power of two apart.
    pub(super) fn of_images(images: &[f32], n_rows: usize, n_pixels: usize) -> Self {
        let n_images = images.len() / (n_rows * n_pixels).max(1);
        let depth = n_images * n_pixels;
        let mut values = vec![[0.0; TILE]; n_rows.div_ceil(TILE) * depth];
        values.par_chunks_exact_mut(n_pixels.max(1)).enumerate().for_each(|(index, values)| {
            let (group, image) = (index / n_images, index % n_images);
            let first = group * TILE;
            let rows = &images[(image * n_rows + first) * n_pixels..];
            let rows = &rows[..TILE.min(n_rows - first) * n_pixels];
            for (block, lanes) in values.chunks_mut(TILE).enumerate() {
                for (row, values) in rows.chunks_exact(n_pixels).enumerate() {
                    let values = &values[block * TILE..][..lanes.len()];
                    for (lanes, &value) in lanes.iter_mut().zip(values) {
                        lanes[row] = value;
                    }
                }
            }
        });
        Self { values, depth }
    }

    /// Packs the columns of a matrix given row by row, as if they were rows; it has `depth` rows.
    pub(super) fn columns(matrix: &[f32], depth: usize) -> Self {
        let n_columns = matrix.len() / depth.max(1);
        let mut values = vec![[0.0; TILE]; n_columns.div_ceil(TILE) * depth];
        values.par_chunks_exact_mut(depth.max(1)).enumerate().for_each(|(group, values)| {
            let first = group * TILE;
            let n = TILE.min(n_columns - first);
            for (lanes, row) in values.iter_mut().zip(matrix.chunks_exact(n_columns)) {
                let row = &row[first..first + n];
                match <&Lanes>::try_from(row) {
                    Ok(whole) => *lanes = *whole,
                    Err(_) => lanes[..n].copy_from_slice(row),
                }
            }
        });
        Self { values, depth }
    }

    /// Number of terms in each sum.
    pub(super) fn depth(&self) -> usize {
        self.depth
    }

    /// The 16 rows of a group, from one depth to another.
    pub(super) fn group(&self, group: usize, depths: std::ops::Range<usize>) -> &[Lanes] {
        &self.values[group * self.depth..][depths]
    }
}

/// What runs with the registers of this processor.
pub(super) fn dispatch<T: WithSimd>(task: T) -> T::Output {
    Arch::new().dispatch(task)
}

/// Adds the product of 16 rows and a panel of 16 columns to `sums`; the first writes them.
#[inline(always)]
pub(super) fn multiply<S: Simd>(
    simd: S,
    rows: &[Lanes],
    panel: &[Lanes],
    sums: &mut Tile,
    is_first: bool,
) {
    if is_first {
        product::<S, false>(simd, rows, panel, sums);
    } else {
        product::<S, true>(simd, rows, panel, sums);
    }
}

#[inline(always)]
fn product<S: Simd, const ADD: bool>(simd: S, rows: &[Lanes], panel: &[Lanes], sums: &mut Tile) {
    match (S::F32_LANES, S::REGISTER_COUNT) {
        (16, _) => part::<S, ADD, 0, 16, 1>(simd, rows, panel, sums),
        (8, _) => {
            part::<S, ADD, 0, 6, 2>(simd, rows, panel, sums);
            part::<S, ADD, 6, 5, 2>(simd, rows, panel, sums);
            part::<S, ADD, 11, 5, 2>(simd, rows, panel, sums);
        }
        (4, 32..) => {
            part::<S, ADD, 0, 4, 4>(simd, rows, panel, sums);
            part::<S, ADD, 4, 4, 4>(simd, rows, panel, sums);
            part::<S, ADD, 8, 4, 4>(simd, rows, panel, sums);
            part::<S, ADD, 12, 4, 4>(simd, rows, panel, sums);
        }
        (4, _) => {
            part::<S, ADD, 0, 2, 4>(simd, rows, panel, sums);
            part::<S, ADD, 2, 2, 4>(simd, rows, panel, sums);
            part::<S, ADD, 4, 2, 4>(simd, rows, panel, sums);
            part::<S, ADD, 6, 2, 4>(simd, rows, panel, sums);
            part::<S, ADD, 8, 2, 4>(simd, rows, panel, sums);
            part::<S, ADD, 10, 2, 4>(simd, rows, panel, sums);
            part::<S, ADD, 12, 2, 4>(simd, rows, panel, sums);
            part::<S, ADD, 14, 2, 4>(simd, rows, panel, sums);
        }
        _ => plain::<ADD>(rows, panel, sums),
    }
}

/// `ROWS` rows of the tile from `FIRST` on; `VECTORS` registers hold its 16 columns.
///
/// Counted loops over constants, no closures: what is not unrolled at once leaves the registers.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "see above")]
fn part<S: Simd, const ADD: bool, const FIRST: usize, const ROWS: usize, const VECTORS: usize>(
    simd: S,
    rows: &[Lanes],
    panel: &[Lanes],
    sums: &mut Tile,
) {
    let mut partial = [[simd.splat_f32s(0.0); VECTORS]; ROWS];
    if ADD {
        for row in 0..ROWS {
            for vector in 0..VECTORS {
                partial[row][vector] = vector_of::<S>(&sums[FIRST + row], vector);
            }
        }
    }
    for (weights, lanes) in rows.iter().zip(panel) {
        let mut columns = [simd.splat_f32s(0.0); VECTORS];
        for vector in 0..VECTORS {
            columns[vector] = vector_of::<S>(lanes, vector);
        }
        for row in 0..ROWS {
            let weight = simd.splat_f32s(weights[FIRST + row]);
            for vector in 0..VECTORS {
                partial[row][vector] =
                    simd.mul_add_e_f32s(weight, columns[vector], partial[row][vector]);
            }
        }
    }
    for row in 0..ROWS {
        for vector in 0..VECTORS {
            S::as_mut_simd_f32s(&mut sums[FIRST + row]).0[vector] = partial[row][vector];
        }
    }
}

/// One register of 16 values.
#[inline(always)]
pub(super) fn vector_of<S: Simd>(lanes: &Lanes, vector: usize) -> S::f32s {
    S::as_simd_f32s(lanes).0[vector]
}

/// The same without vector registers.
fn plain<const ADD: bool>(rows: &[Lanes], panel: &[Lanes], sums: &mut Tile) {
    if !ADD {
        *sums = [[0.0; TILE]; TILE];
    }
    for (row, lanes) in rows.iter().zip(panel) {
        for (sums, value) in sums.iter_mut().zip(row) {
            for (sum, lane) in sums.iter_mut().zip(lanes) {
                *sum += value * lane;
            }
        }
    }
}
