//! References that descriptors are regressed from.

use std::ops::Range;

use nalgebra::Point3;
use vpr_core::{Error as CoreError, Pose, Poses, knn::PositionIndex, map::Names};

use crate::{Error, Result};

/// References that descriptors are regressed from, in the order in which they were taken.
///
/// A map may hold several sequences; neighbours along one are never those of another.
#[derive(Clone, Debug)]
pub struct Anchors {
    rows: Vec<usize>,
    poses: Vec<Pose>,
    /// The sequence of every anchor, as a range of anchors.
    sequences: Vec<Range<usize>>,
    index: PositionIndex,
}

/// Which anchors a target is regressed from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Selection {
    /// The one it was placed from.
    Own,
    /// The one before it and the one after it along the sequence.
    Neighbours,
    /// So many, nearest in space first.
    Nearest(usize),
    /// The same, but where there are fewer, all.
    UpTo(usize),
    /// So many in a row along the sequence, from the one before its own on, shifted at the ends of
    /// the sequence: what the released code calls the nearest (C-5).
    AlongSequence(usize),
}

/// Rows that follow each other and whose names lie in one folder are one sequence, as in
/// `seq-01/frame-000000.color.png`; without names all rows are one sequence.
#[must_use]
pub fn sequences(names: Option<&Names>, n_rows: usize) -> Vec<Range<usize>> {
    let folder = |row: usize| {
        let name = names.and_then(|names| names.get(row)).unwrap_or_default();
        name.rsplit_once('/').map_or("", |(folder, _)| folder)
    };
    let mut all: Vec<Range<usize>> = Vec::new();
    for row in 0..n_rows {
        match all.last_mut() {
            Some(last) if folder(last.start) == folder(row) => last.end = row + 1,
            _ => all.push(row..row + 1),
        }
    }
    all
}

impl Anchors {
    /// Every `k`-th row of each sequence, beginning with its first.
    ///
    /// # Errors
    ///
    /// [`CoreError::Parameter`] if `k` is zero, and those of [`Self::of_rows`].
    pub fn every(poses: &[Pose], sequences: &[Range<usize>], k: usize) -> Result<Self> {
        if k == 0 {
            let (name, value) = ("every", "0".to_owned());
            return Err(CoreError::Parameter { name, value, reason: "must be at least 1" }.into());
        }
        let rows: Vec<Vec<usize>> =
            sequences.iter().cloned().map(|it| it.step_by(k).collect()).collect();
        Self::of_rows(poses, &rows)
    }

    /// Every `k`-th row of each sequence and the last one, so that each row lies between two anchors.
    ///
    /// # Errors
    ///
    /// Those of [`Self::every`].
    pub fn every_and_last(poses: &[Pose], sequences: &[Range<usize>], k: usize) -> Result<Self> {
        let all = Self::every(poses, sequences, k)?;
        let mut rows: Vec<Vec<usize>> = all.grouped();
        for (rows, sequence) in rows.iter_mut().zip(sequences.iter().filter(|it| !it.is_empty())) {
            let last = sequence.end - 1;
            rows.extend((rows.last() != Some(&last)).then_some(last));
        }
        Self::of_rows(poses, &rows)
    }

    /// These rows of a map, one list per sequence, each in the order in which it was taken.
    ///
    /// # Errors
    ///
    /// [`CoreError::Empty`] if there is none, [`CoreError::OutOfRange`] if a row does not exist,
    /// [`CoreError::NotFinite`] if a pose is not finite.
    pub fn of_rows(poses: &[Pose], rows: &[Vec<usize>]) -> Result<Self> {
        let mut anchors = Vec::new();
        let mut sequences = Vec::new();
        for rows in rows.iter().filter(|rows| !rows.is_empty()) {
            let start = anchors.len();
            anchors.extend_from_slice(rows);
            sequences.extend((start..anchors.len()).map(|_| start..anchors.len()));
        }
        if anchors.is_empty() {
            return Err(CoreError::Empty("anchors").into());
        }
        let pose = |&row: &usize| {
            let none = CoreError::OutOfRange { what: "anchor", index: row, len: poses.len() };
            poses.get(row).copied().ok_or(none)
        };
        let poses = anchors.iter().map(pose).collect::<vpr_core::Result<Vec<Pose>>>()?;
        let index = PositionIndex::new(&Poses::SixDof(poses.clone()))?;
        Ok(Self { rows: anchors, poses, sequences, index })
    }

    /// Number of anchors.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there is no anchor; there always is one.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The row of the map that each anchor is.
    #[must_use]
    pub fn rows(&self) -> &[usize] {
        &self.rows
    }

    /// Where each anchor was taken.
    #[must_use]
    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// The anchors of the sequence that one of them belongs to.
    ///
    /// # Panics
    ///
    /// If there is no such anchor.
    #[must_use]
    pub fn sequence_of(&self, anchor: usize) -> Range<usize> {
        self.sequences[anchor].clone()
    }

    /// The `n` anchors nearest to a point in space, ties by lower index.
    ///
    /// # Errors
    ///
    /// [`CoreError::Parameter`] if the point is not finite.
    pub fn nearest(&self, point: Point3<f64>, n: usize) -> Result<Vec<usize>> {
        Ok(self.index.nearest(point, n)?)
    }

    /// The anchors of a target at `pose` that was placed from the anchor `home`; `target` and
    /// `method` are for messages.
    ///
    /// # Errors
    ///
    /// [`Error::TooFewAnchors`]; [`CoreError::Parameter`] if the pose is not finite.
    pub fn select(
        &self,
        selection: Selection,
        (target, home, pose): (usize, usize, &Pose),
        method: &'static str,
    ) -> Result<Vec<usize>> {
        let sequence = self.sequence_of(home);
        let (chosen, needed) = match selection {
            Selection::Own => (vec![home], 1),
            Selection::Neighbours => ((home..sequence.end.min(home + 2)).collect(), 2),
            Selection::Nearest(n) => (self.nearest(pose.translation.vector.into(), n)?, n),
            Selection::UpTo(n) => (self.nearest(pose.translation.vector.into(), n)?, 1),
            Selection::AlongSequence(n) => {
                let last = sequence.end.saturating_sub(n).max(sequence.start);
                let start = home.saturating_sub(1).clamp(sequence.start, last);
                ((start..sequence.end.min(start + n)).collect(), n)
            }
        };
        if chosen.len() < needed {
            let found = chosen.len();
            return Err(Error::TooFewAnchors { target, method, needed, found });
        }
        Ok(chosen)
    }

    /// Rows of the map, one list per sequence.
    fn grouped(&self) -> Vec<Vec<usize>> {
        let mut all = Vec::new();
        let mut anchor = 0;
        while anchor < self.len() {
            let sequence = self.sequence_of(anchor);
            anchor = sequence.end;
            all.push(self.rows[sequence].to_vec());
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(n: usize) -> Vec<Pose> {
        (0..n).map(|at| Pose::translation(at as f64, 0.0, 0.0)).collect()
    }

    #[test]
    fn names_in_one_folder_are_one_sequence() {
        let names: Names = ["a/0", "a/1", "b/0", "b/1", "b/2"].into_iter().collect();
        assert_eq!(sequences(Some(&names), 5), [0..2, 2..5]);
        assert_eq!(sequences(None, 3).first(), Some(&(0..3)));
        assert!(sequences(None, 0).is_empty());
    }

    #[test]
    fn every_kth_begins_anew_with_each_sequence() {
        let poses = line(12);
        let anchors = Anchors::every(&poses, &[0..7, 7..12], 3).unwrap();
        assert_eq!(anchors.rows(), [0, 3, 6, 7, 10]);
        assert_eq!(anchors.sequence_of(2), 0..3);
        assert_eq!(anchors.sequence_of(3), 3..5);
        let closed = Anchors::every_and_last(&poses, &[0..7, 7..12], 3).unwrap();
        assert_eq!(closed.rows(), [0, 3, 6, 7, 10, 11]);
        assert!(Anchors::every(&poses, &sequences(None, 7), 0).is_err());
        assert!(Anchors::every(&poses, &[], 2).is_err());
        assert!(Anchors::of_rows(&poses, &[vec![12]]).is_err());
    }

    #[test]
    fn windows_shift_at_the_ends_and_neighbours_stay_in_their_sequence() {
        let poses = line(12);
        let anchors = Anchors::every(&poses, &[0..6, 6..12], 1).unwrap();
        let select =
            |selection, home: usize| anchors.select(selection, (9, home, &poses[home]), "a test");
        let window = Selection::AlongSequence(4);
        assert_eq!(select(window, 2).unwrap(), [1, 2, 3, 4]);
        assert_eq!(select(window, 0).unwrap(), [0, 1, 2, 3]);
        assert_eq!(select(window, 5).unwrap(), [2, 3, 4, 5]);
        assert_eq!(select(window, 6).unwrap(), [6, 7, 8, 9]);
        assert_eq!(select(Selection::Neighbours, 2).unwrap(), [2, 3]);
        assert_eq!(select(Selection::Nearest(3), 6).unwrap(), [6, 5, 7]);
        assert_eq!(select(Selection::UpTo(13), 6).unwrap().len(), 12);
        let err = select(Selection::Neighbours, 5).unwrap_err().to_string();
        assert_eq!(err, "target 9: a test needs 2 anchors, 1 can be had");
        assert!(matches!(
            select(Selection::AlongSequence(7), 3),
            Err(Error::TooFewAnchors { target: 9, needed: 7, found: 6, .. })
        ));
        assert!(select(Selection::Nearest(13), 3).is_err());
    }
}
