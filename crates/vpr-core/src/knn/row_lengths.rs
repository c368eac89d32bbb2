//! How long rows are: whether they have been normalised.

use std::{fmt, str::FromStr};

use super::{RowSource, metric::squared_norm};
use crate::Result;

/// The Euclidean lengths of the shortest and the longest row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowLengths {
    /// Of the shortest row.
    pub shortest: f64,
    /// Of the longest row.
    pub longest: f64,
}

/// Rows that are this far from length 1 still count as normalised: int8 and f16 round them.
const TOLERANCE: f64 = 0.01;
/// Values that are read at a time.
const BLOCK_VALUES: usize = 1 << 18;

impl RowLengths {
    /// Measures all rows of a source, which reads all of it; `None` if there is no row.
    ///
    /// # Errors
    ///
    /// Those of [`RowSource::block`].
    pub fn of(rows: &(impl RowSource + ?Sized)) -> Result<Option<Self>> {
        let (mut all, mut scratch) = (None, Vec::new());
        let wanted = BLOCK_VALUES / rows.dim().max(1);
        let mut start = 0;
        while start < rows.len() {
            let end = rows.piece_end(start, wanted);
            let block = rows.block(start..end, &mut scratch)?;
            for row in block.chunks_exact(rows.dim().max(1)) {
                all = Self::and(all, Some(Self::of_row(row)));
            }
            start = end;
        }
        Ok(all)
    }

    /// Both ends are the length of one row.
    #[must_use]
    pub fn of_row(row: &[f32]) -> Self {
        let length = squared_norm(row).sqrt();
        Self { shortest: length, longest: length }
    }

    /// The lengths of two sets of rows together.
    #[must_use]
    pub fn and(first: Option<Self>, second: Option<Self>) -> Option<Self> {
        match (first, second) {
            (Some(a), Some(b)) => Some(Self {
                shortest: a.shortest.min(b.shortest),
                longest: a.longest.max(b.longest),
            }),
            (one, other) => one.or(other),
        }
    }

    /// Whether all rows have length 1, to within a hundredth.
    #[must_use]
    pub fn is_unit(self) -> bool {
        self.shortest >= 1.0 - TOLERANCE && self.longest <= 1.0 + TOLERANCE
    }
}

impl fmt::Display for RowLengths {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:e} to {:e}", self.shortest, self.longest)
    }
}

impl FromStr for RowLengths {
    type Err = String;

    /// Reads what [`fmt::Display`] writes.
    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text.split_once(" to ").and_then(|(shortest, longest)| {
            Some(Self { shortest: shortest.parse().ok()?, longest: longest.parse().ok()? })
        });
        parsed
            .filter(|it| 0.0 <= it.shortest && it.shortest <= it.longest)
            .ok_or_else(|| format!("`{}` is no SHORTEST to LONGEST", vpr_files::shorten(text)))
    }
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;
    use crate::Descriptors;

    #[test]
    fn the_ends_are_those_of_all_rows() {
        let rows = Descriptors::new(array![[3.0, 4.0], [0.0, 0.5], [1.0, 0.0]]).unwrap();
        let lengths = RowLengths::of(&rows).unwrap().unwrap();
        assert_eq!(lengths, RowLengths { shortest: 0.5, longest: 5.0 });
        assert!(!lengths.is_unit());
        assert!(RowLengths::of(&rows.normalized()).unwrap().unwrap().is_unit());
        let none = Descriptors::new(ndarray::Array2::zeros((0, 4))).unwrap();
        assert_eq!(RowLengths::of(&none).unwrap(), None);
        let black = Descriptors::new(array![[1.0, 0.0], [0.0, 0.0]]).unwrap();
        assert!(!RowLengths::of(&black).unwrap().unwrap().is_unit(), "a zero row has no direction");
    }

    #[test]
    fn text_comes_back() {
        for ends in [[0.0, 5.0], [0.999_999_94, 1.000_000_1], [1e-30, 3e38]] {
            let lengths = RowLengths { shortest: ends[0], longest: ends[1] };
            assert_eq!(lengths.to_string().parse(), Ok(lengths));
        }
        for wrong in ["", "1", "2 to 1", "1 to NaN", "-1 to 1"] {
            assert!(wrong.parse::<RowLengths>().is_err(), "{wrong}");
        }
    }
}
