//! What CoHOG keeps of one image: its regions and which of them are of interest.

use ndarray::{Array2, ArrayView2};
use vpr_core::{Error, Result};

/// Regions of one image, row by row, `n_regions × depth`, and the regions of interest among them.
///
/// As a query, an image is matched by its regions of interest only; as a reference, by all of its regions.
#[derive(Clone, Debug, PartialEq)]
pub struct CoHogDescriptor {
    regions: Array2<f32>,
    of_interest: Vec<bool>,
    is_fallback: bool,
}

impl CoHogDescriptor {
    /// Wraps regions, `n_regions × depth`, and one flag per region.
    ///
    /// If no region is of interest all of them are used, and [`is_fallback`](Self::is_fallback) tells; the released
    /// code divides zero by zero there (VB-12).
    ///
    /// # Errors
    ///
    /// [`Error::Empty`] without a region or a value, [`Error::Mismatch`] if the numbers of regions and flags differ,
    /// [`Error::NotFinite`] if a value is NaN or infinite.
    pub fn new(regions: Array2<f32>, mut of_interest: Vec<bool>) -> Result<Self> {
        if regions.is_empty() {
            return Err(Error::Empty("regions"));
        }
        let (expected, actual) = (regions.nrows(), of_interest.len());
        if expected != actual {
            return Err(Error::Mismatch { what: "flags of interest", expected, actual });
        }
        let wrong = regions.indexed_iter().find(|(_, value)| !value.is_finite());
        if let Some(((row, column), &value)) = wrong {
            return Err(Error::NotFinite { what: "regions", row, column, value: value.into() });
        }
        let is_fallback = !of_interest.contains(&true);
        if is_fallback {
            of_interest.fill(true);
        }
        Ok(Self { regions: regions.as_standard_layout().into_owned(), of_interest, is_fallback })
    }

    /// Number of regions: (image size / cell size − 1)², 961 as published.
    #[must_use]
    pub fn n_regions(&self) -> usize {
        self.regions.nrows()
    }

    /// Values per region: four cells of `bins` orientations, 32 as published.
    #[must_use]
    pub fn depth(&self) -> usize {
        self.regions.ncols()
    }

    /// The regions, `n_regions × depth`, each of length one, or zero.
    #[must_use]
    pub fn regions(&self) -> ArrayView2<'_, f32> {
        self.regions.view()
    }

    /// The regions one after the other.
    pub(super) fn regions_slice(&self) -> &[f32] {
        self.regions.as_slice().expect("standard layout since `new`")
    }

    /// Whether each region takes part when this image is the query; never all false.
    #[must_use]
    pub fn of_interest(&self) -> &[bool] {
        &self.of_interest
    }

    /// Whether no region passed the entropy threshold, so that all are used.
    #[must_use]
    pub fn is_fallback(&self) -> bool {
        self.is_fallback
    }
}

/// How many of `descriptors` have no region of their own interest.
#[must_use]
pub fn n_fallbacks(descriptors: &[CoHogDescriptor]) -> usize {
    descriptors.iter().filter(|descriptor| descriptor.is_fallback()).count()
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    #[test]
    fn without_a_region_of_interest_all_are_used() {
        let regions = array![[1.0, 0.0], [0.0, 1.0]];
        let descriptor = CoHogDescriptor::new(regions.clone(), vec![false; 2]).unwrap();
        assert_eq!(
            (descriptor.of_interest(), descriptor.is_fallback()),
            ([true; 2].as_slice(), true)
        );
        let descriptor = CoHogDescriptor::new(regions, vec![false, true]).unwrap();
        assert_eq!(
            (descriptor.of_interest(), descriptor.is_fallback()),
            ([false, true].as_slice(), false)
        );
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let refused = |regions, flags| CoHogDescriptor::new(regions, flags).unwrap_err();
        assert!(matches!(refused(Array2::zeros((0, 4)), vec![]), Error::Empty(_)));
        assert!(matches!(refused(Array2::zeros((2, 4)), vec![true]), Error::Mismatch { .. }));
        assert!(matches!(
            refused(array![[0.0, f32::NAN]], vec![true]),
            Error::NotFinite { row: 0, column: 1, .. }
        ));
    }
}
