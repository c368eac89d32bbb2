//! Tiles of 4×4 outputs, and the parts of planes that belong to them.
#![expect(
    clippy::inline_always,
    reason = "only what is inlined into the dispatch is compiled for its registers"
)]

use std::ops::Range;

use super::{
    super::{geometry::Geometry, multiply::Lanes},
    kernels::{N_FREQUENCIES, REACH},
};

/// Outputs of one tile, per axis.
pub(super) const STEP: usize = 4;

/// The values of 16 tiles or of 16 channels, `[row][column]`.
pub(super) type Patch = [Lanes; N_FREQUENCIES];

/// The tiles of all outputs.
#[derive(Clone, Copy)]
pub(super) struct Tiles {
    pub(super) geometry: Geometry,
    pub(super) output: [usize; 2],
    /// Tiles per image, down and across.
    grid: [usize; 2],
}

impl Tiles {
    pub(super) fn new(geometry: &Geometry, output: [usize; 2]) -> Self {
        Self { geometry: *geometry, output, grid: output.map(|it| it.div_ceil(STEP)) }
    }

    pub(super) fn len(&self) -> usize {
        self.geometry.input[0] * self.grid[0] * self.grid[1]
    }

    /// Image and first output row and column of a tile.
    pub(super) fn place(&self, tile: usize) -> (usize, [usize; 2]) {
        let [down, across] = self.grid;
        let (image, tile) = (tile / (down * across), tile % (down * across));
        (image, [tile / across * STEP, tile % across * STEP])
    }

    /// The image of a tile and its 6×6 inputs there.
    pub(super) fn inputs(&self, tile: usize) -> (usize, Window<REACH>) {
        let (image, at) = self.place(tile);
        let Geometry { input: [_, _, height, width], before, .. } = self.geometry;
        (image, Window::new(at, before, [height, width]))
    }

    /// The image of a tile and its 4×4 outputs there.
    pub(super) fn outputs(&self, tile: usize) -> (usize, Window<STEP>) {
        let (image, at) = self.place(tile);
        (image, Window::new(at, [0, 0], self.output))
    }
}

/// A square of `SIDE` rows and columns, as far as it lies within its plane.
pub(super) struct Window<const SIDE: usize> {
    /// Rows and columns of the square that do.
    rows: Range<usize>,
    columns: Range<usize>,
    /// The first of them in the plane.
    start: usize,
    /// Columns of the plane.
    width: usize,
}

impl<const SIDE: usize> Window<SIDE> {
    /// The square at a row and column of a plane that has `before` rows and columns of zeros before it.
    fn new(at: [usize; 2], before: [usize; 2], size: [usize; 2]) -> Self {
        let inside = |axis: usize| {
            let first = before[axis].saturating_sub(at[axis]).min(SIDE);
            let last = (size[axis] + before[axis]).saturating_sub(at[axis]).clamp(first, SIDE);
            (first..last, (at[axis] + first).saturating_sub(before[axis]))
        };
        let ((rows, top), (columns, left)) = (inside(0), inside(1));
        Self { rows, columns, start: top * size[1] + left, width: size[1] }
    }

    /// Copies the values into one lane of a patch's first rows and columns, zeros where the padding is.
    ///
    /// A row at an edge is read whole where the plane goes on, and what is not its own becomes zero:
    /// copies of known length are no calls.
    #[inline(always)]
    pub(super) fn gather(&self, plane: &[f32], lane: usize, patch: &mut Patch) {
        let lines = &mut patch.as_chunks_mut::<REACH>().0[..SIDE];
        if self.rows.len() == SIDE && self.columns.len() == SIDE {
            for (row, lines) in lines.iter_mut().enumerate() {
                let source: &[f32] = &plane[self.start + row * self.width..][..SIDE];
                for (lanes, &value) in lines.iter_mut().zip(source) {
                    lanes[lane] = value;
                }
            }
            return;
        }
        for (row, lines) in lines.iter_mut().enumerate() {
            let mut values = [0.0; SIDE];
            if self.rows.contains(&row) {
                let start = self.start + (row - self.rows.start) * self.width;
                let whole = start.checked_sub(self.columns.start).and_then(|it| plane.get(it..));
                if let Some(source) = whole.and_then(|it| it.first_chunk::<SIDE>()) {
                    for (column, value) in values.iter_mut().enumerate() {
                        *value = if self.columns.contains(&column) { source[column] } else { 0.0 };
                    }
                } else {
                    for (value, &source) in
                        values[self.columns.clone()].iter_mut().zip(&plane[start..])
                    {
                        *value = source;
                    }
                }
            }
            for (lanes, value) in lines.iter_mut().zip(values) {
                lanes[lane] = value;
            }
        }
    }
}
