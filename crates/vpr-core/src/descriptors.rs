//! Global descriptors: one row per image.

use ndarray::{Array2, ArrayView1, ArrayView2, Axis};

use crate::{Error, Result};

/// One global descriptor per row, `n_images × dim`, every value finite.
///
/// Rows are contiguous in memory, so a row is a plain slice.
#[derive(Clone, Debug, PartialEq)]
pub struct Descriptors(Array2<f32>);

impl Descriptors {
    /// Wraps an `n_images × dim` array.
    ///
    /// # Errors
    ///
    /// [`Error::NotFinite`] names the first row and column that are NaN or infinite.
    pub fn new(rows: Array2<f32>) -> Result<Self> {
        let rows =
            if rows.is_standard_layout() { rows } else { rows.as_standard_layout().into_owned() };
        let all = |values: &[f32]| values.iter().fold(true, |all, it| all & it.is_finite());
        if rows.as_slice().is_some_and(|values| values.chunks(256).all(all)) {
            return Ok(Self(rows));
        }
        match rows.indexed_iter().find(|(_, value)| !value.is_finite()) {
            None => Ok(Self(rows)),
            Some(((row, column), &value)) => {
                Err(Error::NotFinite { what: "descriptors", row, column, value: f64::from(value) })
            }
        }
    }

    /// Number of images.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.nrows()
    }

    /// Whether there is no image.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Length of one descriptor.
    #[must_use]
    pub fn dim(&self) -> usize {
        self.0.ncols()
    }

    /// The descriptor of one image, of length [`Self::dim`].
    ///
    /// # Panics
    ///
    /// If `index` is not below [`Self::len`].
    #[must_use]
    pub fn row(&self, index: usize) -> ArrayView1<'_, f32> {
        self.0.row(index)
    }

    /// All descriptors, `n_images × dim`.
    #[must_use]
    pub fn view(&self) -> ArrayView2<'_, f32> {
        self.0.view()
    }

    /// All descriptors, row after row: `n_images * dim` values.
    ///
    /// # Panics
    ///
    /// Never: the rows are contiguous since [`Self::new`].
    #[must_use]
    pub fn as_slice(&self) -> &[f32] {
        self.0.as_slice().expect("rows are contiguous")
    }

    /// The array inside.
    #[must_use]
    pub fn into_inner(self) -> Array2<f32> {
        self.0
    }

    /// Scales every descriptor to unit Euclidean length; a zero descriptor stays zero.
    #[must_use]
    pub fn normalized(mut self) -> Self {
        for mut row in self.0.axis_iter_mut(Axis(0)) {
            let norm = row.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>().sqrt();
            if norm > 0.0 {
                row.mapv_inplace(|x| narrow(f64::from(x) / norm));
            }
        }
        self
    }
}

/// The one place where a descriptor value computed in f64 becomes f32.
#[expect(clippy::cast_possible_truncation, reason = "descriptors are f32")]
fn narrow(value: f64) -> f32 {
    value as f32
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    #[test]
    fn a_nan_is_named_by_row_and_column() {
        let err = Descriptors::new(array![[1.0, 2.0], [3.0, f32::NAN]]).unwrap_err();
        assert!(matches!(err, Error::NotFinite { row: 1, column: 1, .. }), "{err}");
    }

    #[test]
    fn column_major_input_gives_contiguous_rows() {
        let transposed = array![[1.0_f32, 2.0, 3.0], [4.0, 5.0, 6.0]].reversed_axes();
        let descriptors = Descriptors::new(transposed).unwrap();
        assert_eq!(descriptors.row(2).as_slice(), Some([3.0, 6.0].as_slice()));
    }

    #[test]
    fn normalizing_gives_unit_length_and_keeps_zero() {
        let unit = Descriptors::new(array![[3.0, 4.0], [0.0, 0.0]]).unwrap().normalized();
        assert_eq!(unit.into_inner(), array![[0.6, 0.8], [0.0, 0.0]]);
    }
}
