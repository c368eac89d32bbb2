//! The rows of an open map file, as a search reads them.

use std::ops::Range;

use super::MapFile;
use crate::{Result, knn::RowSource};

impl RowSource for MapFile {
    fn len(&self) -> usize {
        self.rows.len
    }

    fn dim(&self) -> usize {
        self.rows.dim
    }

    /// To the end of a block of about 1 MiB as long as that has not been checked.
    fn piece_end(&self, start: usize, wanted: usize) -> usize {
        let block = start / self.rows.per_block;
        if block < self.rows.n_blocks() && !self.touched.has(block) {
            return self.rows.block(block).end;
        }
        start.saturating_add(wanted.max(1)).min(self.rows.len)
    }

    fn block<'a>(&'a self, rows: Range<usize>, scratch: &'a mut Vec<f32>) -> Result<&'a [f32]> {
        if let Some(values) = self.rows_in_place(rows.clone())? {
            return Ok(values);
        }
        scratch.resize(rows.len() * self.rows.dim, 0.0);
        self.read_rows(rows.start, scratch)?;
        Ok(scratch)
    }
}
