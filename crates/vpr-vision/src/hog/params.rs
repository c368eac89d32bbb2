//! Sizes that define a HOG descriptor.

use serde::{Deserialize, Serialize};
use vpr_core::{Error, Result};

/// Sizes of a HOG descriptor, all square and in pixels; the default is [`HogParams::RELEASED`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HogParams {
    /// Side of the image that is described; other images are resized to it.
    pub window: usize,
    /// Side of a block, inside of which histograms are normalised together; a multiple of the cell.
    pub block: usize,
    /// Distance of one block to the next.
    pub stride: usize,
    /// Side of a cell, which has one histogram.
    pub cell: usize,
    /// Orientations of a histogram, over half a turn.
    pub bins: usize,
}

impl HogParams {
    /// What VPR-Bench's released code computes: one cell in a block, 35 721 numbers.
    pub const RELEASED: Self = Self { window: 512, block: 16, stride: 8, cell: 16, bins: 9 };

    /// What section 3.3 and table 3.6 of the thesis describe: two by two cells in a block, 34 596 numbers.
    pub const THESIS: Self = Self { window: 512, block: 32, stride: 16, cell: 16, bins: 9 };

    /// The same with another cell, a block of twice the cell and a stride of one cell, as in the sweep of table 3.9.
    #[must_use]
    pub const fn with_cell_size(self, cell: usize) -> Self {
        Self { block: 2 * cell, stride: cell, cell, ..self }
    }

    /// How many numbers a descriptor has: blocks² × (cells in a block)² × bins.
    ///
    /// Only for sizes that [`Hog::new`](super::Hog::new) accepts.
    #[must_use]
    pub const fn dim(&self) -> usize {
        self.blocks().pow(2) * self.cells().pow(2) * self.bins
    }

    /// Blocks along one side of the window.
    pub(super) const fn blocks(&self) -> usize {
        (self.window - self.block) / self.stride + 1
    }

    /// Cells along one side of a block.
    pub(super) const fn cells(&self) -> usize {
        self.block / self.cell
    }

    pub(super) fn check(&self) -> Result<()> {
        let &Self { window, block, stride, cell, bins } = self;
        let refuse = |name, value: usize, reason| {
            Err(Error::Parameter { name, value: value.to_string(), reason })
        };
        if !(2..=4096).contains(&window) {
            refuse("window", window, "must be from 2 to 4096")
        } else if block == 0 || block > window {
            refuse("block", block, "must be from 1 to the window")
        } else if cell == 0 || !block.is_multiple_of(cell) {
            refuse("cell", cell, "must divide the block")
        } else if stride == 0 || !(window - block).is_multiple_of(stride) {
            refuse("stride", stride, "must divide the window less one block")
        } else if !(2..=256).contains(&bins) {
            refuse("bins", bins, "must be from 2 to 256")
        } else {
            Ok(())
        }
    }
}

impl Default for HogParams {
    fn default() -> Self {
        Self::RELEASED
    }
}
