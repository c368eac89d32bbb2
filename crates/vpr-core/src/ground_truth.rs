//! Which references are correct for which query.

use std::{collections::HashMap, hash::Hash};

use crate::{Error, Poses, Result};

/// The correct references of every query.
///
/// A query without any is a *new place*: nothing in the map is correct for it (`[-1]` in
/// VPR-Bench's files).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GroundTruth {
    /// Per query, ascending, without repetition, each below `n_references`.
    correct: Vec<Vec<usize>>,
    n_references: usize,
}

impl GroundTruth {
    /// Takes explicit lists of correct references, one per query, in any order.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] if a list points past the references; see [`Self::clamped`].
    pub fn from_lists(lists: Vec<Vec<usize>>, n_references: usize) -> Result<Self> {
        if let Some(&index) = lists.iter().flatten().find(|&&index| index >= n_references) {
            let what = "the ground truth points to reference";
            return Err(Error::OutOfRange { what, index, len: n_references });
        }
        Ok(Self::clamped(lists, n_references).0)
    }

    /// Takes explicit lists and drops what points past the references; also says how many were
    /// dropped.
    ///
    /// Published ground truths do point past the end (Gardens Point, 17 Places): VPR-Bench never
    /// notices, because it only looks up retrieved indices.
    #[must_use]
    pub fn clamped(lists: Vec<Vec<usize>>, n_references: usize) -> (Self, usize) {
        let mut n_dropped = 0;
        let correct = lists
            .into_iter()
            .map(|mut list| {
                let before = list.len();
                list.retain(|&index| index < n_references);
                n_dropped += before - list.len();
                list.sort_unstable();
                list.dedup();
                list
            })
            .collect();
        (Self { correct, n_references }, n_dropped)
    }

    /// A reference is correct within `radius` metres of the query, the limit included, in f64.
    ///
    /// Planar poses are compared in the plane, others in space.
    ///
    /// # Errors
    ///
    /// [`Error::PoseKind`] if one set is planar and the other is not, [`Error::Parameter`] if the
    /// radius is negative or not finite.
    pub fn within_radius(queries: &Poses, references: &Poses, radius: f64) -> Result<Self> {
        if !(radius.is_finite() && radius >= 0.0) {
            let reason = "must be a finite distance in metres, zero or more";
            return Err(Error::Parameter { name: "radius", value: radius.to_string(), reason });
        }
        if queries.planar().is_ok() != references.planar().is_ok() {
            return Err(Error::PoseKind { needed: queries.kind(), actual: references.kind() });
        }
        let correct = (0..queries.len())
            .map(|query| {
                let centre = queries.position(query);
                let near = |&index: &usize| {
                    nalgebra::distance(&centre, &references.position(index)) <= radius
                };
                (0..references.len()).filter(near).collect()
            })
            .collect();
        Ok(Self { correct, n_references: references.len() })
    }

    /// Reference `r` is correct for query `q` if their indices differ by at most `tolerance`
    /// frames; for two traverses that are aligned frame by frame.
    #[must_use]
    pub fn within_frames(n_queries: usize, n_references: usize, tolerance: usize) -> Self {
        let correct = (0..n_queries)
            .map(|query| {
                let end = (query + tolerance + 1).min(n_references);
                (query.saturating_sub(tolerance).min(end)..end).collect()
            })
            .collect();
        Self { correct, n_references }
    }

    /// A reference is correct if it has the label of the query: the place, floor or class that
    /// images were sorted into. A query whose label no reference has is a new place.
    #[must_use]
    pub fn same_label<L: Eq + Hash>(queries: &[L], references: &[L]) -> Self {
        let mut of_label: HashMap<&L, Vec<usize>> = HashMap::new();
        for (index, label) in references.iter().enumerate() {
            of_label.entry(label).or_default().push(index);
        }
        let correct = queries.iter().map(|it| of_label.get(it).cloned().unwrap_or_default());
        Self { correct: correct.collect(), n_references: references.len() }
    }

    /// The truth for some of the queries and some of the references, each in this order; indices are
    /// then places in these lists.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] if there is no such query or reference.
    pub fn selected(&self, queries: &[usize], references: &[usize]) -> Result<Self> {
        let check =
            |what, indices: &[usize], len: usize| match indices.iter().find(|&&it| it >= len) {
                Some(&index) => Err(Error::OutOfRange { what, index, len }),
                None => Ok(()),
            };
        check("query", queries, self.len())?;
        check("reference", references, self.n_references)?;
        let mut places = vec![Vec::new(); self.n_references];
        for (place, &reference) in references.iter().enumerate() {
            places[reference].push(place);
        }
        let of = |&query: &usize| {
            self.correct[query].iter().flat_map(|&it| places[it].iter().copied()).collect()
        };
        let lists: Vec<Vec<usize>> = queries.iter().map(of).collect();
        Ok(Self::clamped(lists, references.len()).0)
    }

    /// The same truth with queries and references exchanged.
    #[must_use]
    pub fn swapped(&self) -> Self {
        let mut correct = vec![Vec::new(); self.n_references];
        for (query, references) in self.correct.iter().enumerate() {
            for &reference in references {
                correct[reference].push(query);
            }
        }
        Self { correct, n_references: self.len() }
    }

    /// The same truth for the first references of the map only.
    #[must_use]
    pub fn truncated(&self, n_references: usize) -> Self {
        Self::clamped(self.correct.clone(), n_references.min(self.n_references)).0
    }

    /// Number of queries.
    #[must_use]
    pub fn len(&self) -> usize {
        self.correct.len()
    }

    /// Whether there is no query.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.correct.is_empty()
    }

    /// Number of references of the map this truth is about.
    #[must_use]
    pub fn n_references(&self) -> usize {
        self.n_references
    }

    /// The correct references of one query, ascending; empty for a new place.
    ///
    /// # Panics
    ///
    /// If `query` is not below [`Self::len`].
    #[must_use]
    pub fn correct(&self, query: usize) -> &[usize] {
        &self.correct[query]
    }

    /// Whether `reference` is correct for `query`.
    ///
    /// # Panics
    ///
    /// If `query` is not below [`Self::len`].
    #[must_use]
    pub fn is_correct(&self, query: usize, reference: usize) -> bool {
        self.correct[query].binary_search(&reference).is_ok()
    }

    /// Whether the map has nothing correct for `query`.
    ///
    /// # Panics
    ///
    /// If `query` is not below [`Self::len`].
    #[must_use]
    pub fn is_new_place(&self, query: usize) -> bool {
        self.correct[query].is_empty()
    }

    /// Number of queries that have a correct reference: the positives of precision and recall.
    #[must_use]
    pub fn n_known(&self) -> usize {
        self.correct.iter().filter(|references| !references.is_empty()).count()
    }

    /// Whether each query's best reference is correct.
    ///
    /// # Errors
    ///
    /// [`Error::Mismatch`] if there is not one best reference per query.
    pub fn judge(&self, best: &[usize]) -> Result<Vec<bool>> {
        if best.len() != self.len() {
            let what = "best references, one per query of the ground truth";
            return Err(Error::Mismatch { what, expected: self.len(), actual: best.len() });
        }
        Ok(best.iter().enumerate().map(|(query, &best)| self.is_correct(query, best)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PlanarPosition, Position};

    fn planar(eastings: &[f64]) -> Poses {
        Poses::Planar(eastings.iter().map(|&x| PlanarPosition::new(x, 4_180_000.0)).collect())
    }

    #[test]
    fn the_radius_is_inclusive_in_f64() {
        // At UTM magnitudes an f32 would put the third reference on the limit as well.
        let references = planar(&[549_625.0, 549_575.0, 549_625.001]);
        let truth = GroundTruth::within_radius(&planar(&[549_600.0]), &references, 25.0).unwrap();
        assert_eq!(truth.correct(0), [0, 1]);
    }

    #[test]
    fn a_query_far_from_everything_is_a_new_place() {
        let truth = GroundTruth::within_radius(&planar(&[0.0, 1e6]), &planar(&[0.0]), 25.0);
        let truth = truth.unwrap();
        assert!(truth.is_new_place(1));
        assert_eq!(truth.n_known(), 1);
    }

    #[test]
    fn planes_are_not_compared_with_space() {
        let space = Poses::Spatial(vec![Position::origin()]);
        assert!(GroundTruth::within_radius(&planar(&[0.0]), &space, 1.0).is_err());
        assert!(GroundTruth::within_radius(&space, &space, f64::NAN).is_err());
    }

    #[test]
    fn frames_are_symmetric_and_clipped() {
        let truth = GroundTruth::within_frames(4, 3, 1);
        let lists: Vec<_> = (0..4).map(|query| truth.correct(query).to_vec()).collect();
        assert_eq!(lists, [vec![0, 1], vec![0, 1, 2], vec![1, 2], vec![2]]);
        assert!(GroundTruth::within_frames(9, 3, 1).is_new_place(8));
    }

    #[test]
    fn images_of_one_label_are_one_place() {
        let truth = GroundTruth::same_label(&["b", "z", "a"], &["a", "b", "a"]);
        let lists: Vec<_> = (0..3).map(|query| truth.correct(query).to_vec()).collect();
        assert_eq!(lists, [vec![1], vec![], vec![0, 2]]);
        assert_eq!((truth.n_references(), truth.n_known()), (3, 2));
    }

    #[test]
    fn what_is_left_out_is_no_longer_correct() {
        let truth = GroundTruth::from_lists(vec![vec![0, 2], vec![1], vec![2]], 3).unwrap();
        let left = truth.selected(&[0, 1], &[2, 0]).unwrap();
        assert_eq!((left.len(), left.n_references()), (2, 2));
        assert_eq!(left.correct(0), [0, 1]);
        assert!(left.is_new_place(1));
        assert_eq!(truth.selected(&[0, 1, 2], &[0, 1, 2]).unwrap(), truth);
        assert!(matches!(truth.selected(&[3], &[0]), Err(Error::OutOfRange { index: 3, .. })));
        assert!(matches!(truth.selected(&[0], &[7]), Err(Error::OutOfRange { index: 7, .. })));
    }

    #[test]
    fn pointing_past_the_references_is_an_error_or_counted() {
        let lists = vec![vec![0, 2], vec![3, 1, 1]];
        assert!(GroundTruth::from_lists(lists.clone(), 2).is_err());
        let (truth, n_dropped) = GroundTruth::clamped(lists, 2);
        assert_eq!(
            (truth.correct(0), truth.correct(1), n_dropped),
            ([0].as_slice(), [1].as_slice(), 2)
        );
    }

    #[test]
    fn swapping_twice_is_the_identity() {
        let truth = GroundTruth::from_lists(vec![vec![1], vec![], vec![0, 1]], 4).unwrap();
        assert_eq!(truth.swapped().correct(1), [0, 2]);
        assert_eq!(truth.swapped().swapped(), truth);
    }
}
