//! Which rows of a map were measured, and which were regressed from others.

use crate::{Error, Result};

/// Where the descriptor of a row is from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin<'a> {
    /// An image was taken there.
    Measured,
    /// It was computed from the descriptors of these rows of the same map, all of them measured.
    Regressed(&'a [usize]),
}

/// The origin of every row of a map.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Origins {
    anchors: Vec<usize>,
    ends: Vec<usize>,
}

impl Origins {
    /// So many measured rows.
    #[must_use]
    pub fn measured(n: usize) -> Self {
        Self { anchors: Vec::new(), ends: vec![0; n] }
    }

    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Whether there is no row.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// Adds a row that was measured.
    pub fn push_measured(&mut self) {
        self.ends.push(self.anchors.len());
    }

    /// Adds a row that was regressed from `anchors`, rows of the same map.
    ///
    /// # Errors
    ///
    /// [`Error::Empty`] without anchors.
    pub fn push_regressed(&mut self, anchors: &[usize]) -> Result<()> {
        if anchors.is_empty() {
            return Err(Error::Empty("anchors of a regressed row"));
        }
        self.anchors.extend_from_slice(anchors);
        self.push_measured();
        Ok(())
    }

    /// Adds the rows of another map that come after these: its anchors are counted from `shift`.
    pub fn extend(&mut self, more: &Self, shift: usize) {
        let before = self.anchors.len();
        self.anchors.extend(more.anchors.iter().map(|anchor| anchor + shift));
        self.ends.extend(more.ends.iter().map(|end| end + before));
    }

    /// Takes back what was added after the first `len` rows.
    pub(super) fn truncate(&mut self, len: usize) {
        self.ends.truncate(len);
        self.anchors.truncate(self.ends.last().copied().unwrap_or(0));
    }

    /// The origin of one row, if there are so many.
    #[must_use]
    pub fn get(&self, row: usize) -> Option<Origin<'_>> {
        let end = *self.ends.get(row)?;
        let start = if row == 0 { 0 } else { self.ends[row - 1] };
        Some(match &self.anchors[start..end] {
            [] => Origin::Measured,
            anchors => Origin::Regressed(anchors),
        })
    }

    /// The origins of all rows in order.
    #[must_use]
    pub fn iter(&self) -> impl ExactSizeIterator<Item = Origin<'_>> {
        (0..self.len()).map(|row| self.get(row).unwrap_or(Origin::Measured))
    }

    /// Number of rows that were regressed.
    #[must_use]
    pub fn n_regressed(&self) -> usize {
        self.iter().filter(|&origin| origin != Origin::Measured).count()
    }

    /// Whether an image was taken at a row; false if there is no such row.
    #[must_use]
    pub fn is_measured(&self, row: usize) -> bool {
        self.get(row) == Some(Origin::Measured)
    }

    /// The rows that were measured, ascending: all that a search may see that trusts images only.
    #[must_use]
    pub fn measured_rows(&self) -> Vec<usize> {
        (0..self.len()).filter(|&row| self.is_measured(row)).collect()
    }

    /// Checks that every anchor of the rows from `start` on is a measured row.
    ///
    /// # Errors
    ///
    /// The row and what is wrong with its anchor.
    pub(super) fn check_from(&self, start: usize) -> Result<(), (usize, String)> {
        for row in start..self.len() {
            let Some(Origin::Regressed(anchors)) = self.get(row) else { continue };
            if let Some(anchor) = anchors.iter().find(|&&anchor| !self.is_measured(anchor)) {
                let reason = if *anchor < self.len() {
                    format!("is regressed from row {anchor}, which is regressed itself")
                } else {
                    format!("is regressed from row {anchor} of {}", self.len())
                };
                return Err((row, reason));
            }
        }
        Ok(())
    }

    /// All anchors, and for `n` rows `n + 1` places where those of a row start.
    pub(super) fn to_parts(&self) -> (Vec<i64>, Vec<i64>) {
        let wide = |value: &usize| i64::try_from(*value).unwrap_or(i64::MAX);
        let offsets = std::iter::once(0).chain(self.ends.iter().map(wide)).collect();
        (self.anchors.iter().map(wide).collect(), offsets)
    }

    /// What [`Self::to_parts`] gives.
    ///
    /// # Errors
    ///
    /// What is wrong with them.
    pub(super) fn from_parts(anchors: &[i64], offsets: &[i64]) -> Result<Self, String> {
        let narrow = |value: &i64| usize::try_from(*value).ok();
        let mut ends = Vec::with_capacity(offsets.len().saturating_sub(1));
        let mut last = 0;
        for (index, offset) in offsets.iter().enumerate() {
            match narrow(offset) {
                Some(end) if end >= last && end <= anchors.len() && (index > 0 || end == 0) => {
                    last = end;
                }
                _ => {
                    return Err(format!(
                        "offset {index} is {offset}, of {} anchors",
                        anchors.len()
                    ));
                }
            }
            if index > 0 {
                ends.push(last);
            }
        }
        if last != anchors.len() {
            return Err(format!("rows have {last} anchors, but there are {}", anchors.len()));
        }
        let rows: Option<Vec<usize>> = anchors.iter().map(narrow).collect();
        let origins = Self { anchors: rows.ok_or("an anchor is negative")?, ends };
        origins.check_from(0).map_err(|(row, reason)| format!("row {row} {reason}"))?;
        Ok(origins)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn some() -> Origins {
        let mut origins = Origins::measured(2);
        origins.push_regressed(&[1, 0]).unwrap();
        origins.push_measured();
        origins.push_regressed(&[3]).unwrap();
        origins
    }

    #[test]
    fn every_row_says_where_it_is_from() {
        let origins = some();
        assert_eq!(origins.get(0), Some(Origin::Measured));
        assert_eq!(origins.get(2), Some(Origin::Regressed(&[1, 0])));
        assert_eq!(origins.get(4), Some(Origin::Regressed(&[3])));
        assert_eq!(origins.get(5), None);
        assert_eq!(origins.measured_rows(), [0, 1, 3]);
        assert!(matches!(some().push_regressed(&[]), Err(Error::Empty(_))));
    }

    #[test]
    fn parts_give_the_origins_back() {
        let origins = some();
        let (anchors, offsets) = origins.to_parts();
        assert_eq!((&anchors[..], &offsets[..]), (&[1, 0, 3][..], &[0, 0, 0, 2, 2, 3][..]));
        assert_eq!(Origins::from_parts(&anchors, &offsets).unwrap(), origins);
    }

    #[test]
    fn a_second_map_counts_its_anchors_from_its_own_first_row() {
        let mut both = some();
        both.extend(&some(), 5);
        assert_eq!(both.get(7), Some(Origin::Regressed(&[6, 5])));
        assert_eq!(both.len(), 10);
    }

    #[test]
    fn wrong_parts_are_named() {
        let wrong =
            |anchors: &[i64], offsets: &[i64]| Origins::from_parts(anchors, offsets).unwrap_err();
        assert_eq!(wrong(&[0], &[0, 0, 2]), "offset 2 is 2, of 1 anchors");
        assert_eq!(wrong(&[0], &[1, 1]), "offset 0 is 1, of 1 anchors");
        assert_eq!(wrong(&[0], &[0, 0, 0]), "rows have 0 anchors, but there are 1");
        assert_eq!(wrong(&[-1], &[0, 0, 1]), "an anchor is negative");
        assert_eq!(wrong(&[7], &[0, 0, 1]), "row 1 is regressed from row 7 of 2");
        assert_eq!(
            wrong(&[0, 1], &[0, 0, 1, 2]),
            "row 2 is regressed from row 1, which is regressed itself"
        );
    }
}
