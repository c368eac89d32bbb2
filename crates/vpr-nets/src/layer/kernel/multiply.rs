//! The inner matrix product of all convolutions here: 16 output channels by 16 columns at a time.
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
    /// Packs the matrix whose element at `(row, depth)` is `value(row, depth)`.
    pub(super) fn new(n_rows: usize, depth: usize, value: impl Fn(usize, usize) -> f32) -> Self {
        let mut values = vec![[0.0; TILE]; n_rows.div_ceil(TILE) * depth];
        for row in 0..n_rows {
            for at in 0..depth {
                values[row / TILE * depth + at][row % TILE] = value(row, at);
            }
        }
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

/// Adds the product of 16 rows and a panel of 16 columns to `sums`.
#[inline(always)]
pub(super) fn accumulate<S: Simd>(simd: S, rows: &[Lanes], panel: &[Lanes], sums: &mut Tile) {
    match (S::F32_LANES, S::REGISTER_COUNT) {
        (16, _) => part::<S, 16, 1>(simd, rows, panel, sums, 0),
        (8, _) => {
            for first in (0..TILE).step_by(4) {
                part::<S, 4, 2>(simd, rows, panel, sums, first);
            }
        }
        (4, 32..) => {
            for first in (0..TILE).step_by(4) {
                part::<S, 4, 4>(simd, rows, panel, sums, first);
            }
        }
        (4, _) => {
            for first in (0..TILE).step_by(2) {
                part::<S, 2, 4>(simd, rows, panel, sums, first);
            }
        }
        _ => plain(rows, panel, sums),
    }
}

/// `ROWS` rows of the tile from `first` on; `VECTORS` registers hold its 16 columns.
#[inline(always)]
fn part<S: Simd, const ROWS: usize, const VECTORS: usize>(
    simd: S,
    rows: &[Lanes],
    panel: &[Lanes],
    sums: &mut Tile,
    first: usize,
) {
    let mut partial = [[simd.splat_f32s(0.0); VECTORS]; ROWS];
    for (partial, sums) in partial.iter_mut().zip(&sums[first..]) {
        partial.copy_from_slice(&S::as_simd_f32s(sums).0[..VECTORS]);
    }
    for (row, lanes) in rows.iter().zip(panel) {
        let lanes = S::as_simd_f32s(lanes).0;
        let columns: [S::f32s; VECTORS] = std::array::from_fn(|i| lanes[i]);
        for (partial, &value) in partial.iter_mut().zip(&row[first..]) {
            let value = simd.splat_f32s(value);
            for (partial, &columns) in partial.iter_mut().zip(&columns) {
                *partial = simd.mul_add_e_f32s(value, columns, *partial);
            }
        }
    }
    for (partial, sums) in partial.iter().zip(&mut sums[first..]) {
        S::as_mut_simd_f32s(sums).0[..VECTORS].copy_from_slice(partial);
    }
}

/// The same without vector registers.
fn plain(rows: &[Lanes], panel: &[Lanes], sums: &mut Tile) {
    for (row, lanes) in rows.iter().zip(panel) {
        for (sums, value) in sums.iter_mut().zip(row) {
            for (sum, lane) in sums.iter_mut().zip(lanes) {
                *sum += value * lane;
            }
        }
    }
}
