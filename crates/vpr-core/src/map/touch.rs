//! Checks of a map file that happen when a part of it is first touched.

use std::{
    ops::Range,
    path::Path,
    sync::atomic::{AtomicBool, Ordering},
};

use super::{BlockDigest, layout::Rows};
use crate::{Error, Result};

/// Which blocks of descriptors have been checked.
#[derive(Debug)]
pub(super) struct Touched(Option<Box<[AtomicBool]>>);

impl Touched {
    /// Every block counts as checked.
    pub(super) fn all() -> Self {
        Self(None)
    }

    /// No block has been checked.
    pub(super) fn none(n_blocks: usize) -> Self {
        Self(Some((0..n_blocks).map(|_| AtomicBool::new(false)).collect()))
    }

    /// Whether a block counts as checked.
    pub(super) fn has(&self, block: usize) -> bool {
        self.0.as_ref().is_none_or(|checked| checked[block].load(Ordering::Relaxed))
    }

    /// Checks those of the blocks that have not been checked before.
    pub(super) fn check(
        &self,
        blocks: Range<usize>,
        check: impl Fn(usize) -> Result<()>,
    ) -> Result<()> {
        let Some(checked) = &self.0 else { return Ok(()) };
        for block in blocks {
            if !self.has(block) {
                check(block)?;
                checked[block].store(true, Ordering::Relaxed);
            }
        }
        Ok(())
    }
}

/// The bytes of these rows have the digest they were written with.
pub(super) fn check_digest(
    path: &Path,
    rows: &Range<usize>,
    bytes: &[u8],
    stored: &[u8],
) -> Result<()> {
    if BlockDigest::of(bytes).to_bytes() == stored {
        return Ok(());
    }
    let place = format!("descriptors, rows {}..{}", rows.start, rows.end);
    Err(Error::format(path, place, damaged()))
}

/// Every value of these rows is finite.
pub(super) fn check_finite(
    path: &Path,
    rows: &Rows,
    range: &Range<usize>,
    bytes: &[u8],
) -> Result<()> {
    match rows.row_type.first_not_finite(bytes) {
        None => Ok(()),
        Some(value) => {
            let row = range.start + value / rows.dim;
            let place = format!("descriptors, row {row}, column {}", value % rows.dim);
            Err(Error::format(path, place, "is not a finite number"))
        }
    }
}

/// What is said of bytes that do not have their digest.
pub(super) fn damaged() -> &'static str {
    "the bytes do not have the digest they were written with: the file is damaged"
}
