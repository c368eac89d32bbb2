//! Rows that a search reads block by block: a matrix in memory, a mapped file, decoded codes.

use std::ops::Range;

use crate::{Descriptors, Result};

/// Reference descriptors that are read in blocks of consecutive rows.
///
/// This is all a search knows of the references, so that the same search (and the same bits of
/// its result) serves rows that lie in memory, rows of a mapped file and rows that are decoded from
/// f16 or int8 while they are read. Sources are read from several threads at once.
pub trait RowSource: Sync {
    /// Number of rows.
    fn len(&self) -> usize;

    /// Length of one row.
    fn dim(&self) -> usize;

    /// The rows of a range as f32, row after row: `rows.len() × dim` values.
    ///
    /// Rows that are f32 in memory are lent as they are, and `scratch` stays as it was; others
    /// are decoded into `scratch`, which grows to one block and is used again for the next.
    /// The same row must give the same bits each time, in whichever block it is asked for.
    ///
    /// # Errors
    ///
    /// Whatever is wrong with these rows: a damaged block, a value that is not finite.
    ///
    /// # Panics
    ///
    /// If the range reaches beyond [`Self::len`].
    fn block<'a>(&'a self, rows: Range<usize>, scratch: &'a mut Vec<f32>) -> Result<&'a [f32]>;

    /// Where a piece that starts at row `start` best ends if about `wanted` rows are needed.
    ///
    /// A source whose rows are read or checked many at a time says so here, so that a search that
    /// takes all of them gets there by reading each of them once. Changes the time, not the result;
    /// above `start`, at most [`Self::len`].
    fn piece_end(&self, start: usize, wanted: usize) -> usize {
        start.saturating_add(wanted.max(1)).min(self.len())
    }

    /// Whether there is no row.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// One row of a source, of length [`RowSource::dim`].
///
/// # Errors
///
/// Those of [`RowSource::block`].
pub fn row<'a>(
    rows: &'a (impl RowSource + ?Sized),
    index: usize,
    scratch: &'a mut Vec<f32>,
) -> Result<&'a [f32]> {
    rows.block(index..index + 1, scratch)
}

impl RowSource for Descriptors {
    fn len(&self) -> usize {
        self.len()
    }

    fn dim(&self) -> usize {
        self.dim()
    }

    fn block<'a>(&'a self, rows: Range<usize>, _scratch: &'a mut Vec<f32>) -> Result<&'a [f32]> {
        Ok(&self.as_slice()[rows.start * self.dim()..rows.end * self.dim()])
    }
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    #[test]
    fn rows_in_memory_are_lent_not_copied() {
        let descriptors = Descriptors::new(array![[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]).unwrap();
        let mut scratch = Vec::new();
        let block = descriptors.block(1..3, &mut scratch).unwrap();
        assert_eq!(block, [3.0, 4.0, 5.0, 6.0]);
        assert_eq!(block.as_ptr(), &raw const descriptors.as_slice()[2]);
        assert_eq!(row(&descriptors, 0, &mut scratch).unwrap(), [1.0, 2.0]);
        assert_eq!(scratch.capacity(), 0);
    }
}
