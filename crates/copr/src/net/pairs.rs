//! Pairs of images of one sequence: what H learns from.

use std::ops::Range;

use rand::{SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;
use vpr_core::{Definition, Error as CoreError, Map, map::BlockDigest};
use vpr_nets::regress::RELATIVE_POSE;

use super::relative_pose;
use crate::{Result, rotation_error, translation_error};

/// Descriptors with poses, and which of them are an anchor and a target.
#[derive(Clone, Debug)]
pub struct Pairs {
    map: Map,
    list: Vec<(usize, usize)>,
    definition: Definition,
}

/// Some pairs, as values: `n` rows of each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PairBatch {
    /// `n × dim`.
    pub anchors: Vec<f32>,
    /// `n × 7`, see [`relative_pose`].
    pub relative: Vec<f32>,
    /// `n × dim`.
    pub targets: Vec<f32>,
    /// Number of pairs.
    pub n: usize,
}

impl Pairs {
    /// Every `k`-th image of each sequence as an anchor of the `k − 1` that follow it: the thesis'
    /// pairs.
    ///
    /// # Errors
    ///
    /// [`CoreError::Parameter`] if `k` is below 2; [`CoreError::PoseKind`] if the map has no
    /// orientations; [`CoreError::Empty`] if no sequence has two images.
    pub fn following(
        map: Map,
        sequences: &[Range<usize>],
        k: usize,
        definition: Definition,
    ) -> Result<Self> {
        if k < 2 {
            let (name, value, reason) = ("every", k.to_string(), "must be at least 2");
            return Err(CoreError::Parameter { name, value, reason }.into());
        }
        map.poses().six_dof()?;
        let of = |sequence: &Range<usize>| {
            let anchors = sequence.clone().step_by(k);
            let end = sequence.end;
            anchors.flat_map(move |anchor| {
                (anchor + 1..end.min(anchor + k)).map(move |target| (anchor, target))
            })
        };
        let pairs: Vec<(usize, usize)> = sequences.iter().flat_map(of).collect();
        if let Some(&(_, index)) = pairs.iter().find(|(_, target)| *target >= map.len()) {
            return Err(CoreError::OutOfRange { what: "row", index, len: map.len() }.into());
        }
        Self::listed(map, pairs, definition)
    }

    /// Every two images of one sequence, in both orders, that are at most `reach_m` metres and `turn_deg`
    /// degrees apart: what a grid around an anchor asks for.
    ///
    /// # Errors
    ///
    /// [`CoreError::Parameter`] if a limit is negative or no number, [`CoreError::OutOfRange`] if a
    /// sequence ends behind the map; otherwise those of [`Self::following`].
    pub fn near(
        map: Map,
        sequences: &[Range<usize>],
        (reach_m, turn_deg): (f64, f64),
        definition: Definition,
    ) -> Result<Self> {
        for (name, limit) in [("reach", reach_m), ("turn", turn_deg)] {
            if !(limit >= 0.0 && limit.is_finite()) {
                let (value, reason) = (limit.to_string(), "must not be negative");
                return Err(CoreError::Parameter { name, value, reason }.into());
            }
        }
        let poses = map.poses().six_dof()?;
        if let Some(rows) = sequences.iter().find(|rows| rows.end > poses.len()) {
            let (index, len) = (rows.end - 1, poses.len());
            return Err(CoreError::OutOfRange { what: "row", index, len }.into());
        }
        let is_near = |a: usize, b: usize| {
            translation_error(&poses[a], &poses[b]) <= reach_m
                && rotation_error(&poses[a], &poses[b]) <= turn_deg
        };
        let of_anchor = |(rows, a): (&Range<usize>, usize)| -> Vec<(usize, usize)> {
            rows.clone().filter(|&b| a != b && is_near(a, b)).map(|b| (a, b)).collect()
        };
        let anchors = sequences.iter().flat_map(|rows| rows.clone().map(move |row| (rows, row)));
        let pairs = anchors.flat_map(of_anchor).collect();
        Self::listed(map, pairs, definition)
    }

    /// At most `n` of them, evenly over the list.
    #[must_use]
    pub fn thinned(mut self, n: usize) -> Self {
        let len = self.list.len();
        if n > 0 && n < len {
            self.list = (0..n).map(|at| self.list[at * len / n]).collect();
        }
        self
    }

    /// These pairs of rows: anchor, target.
    ///
    /// # Errors
    ///
    /// [`CoreError::Empty`] if there is none, [`CoreError::OutOfRange`] if a row does not exist.
    pub fn listed(map: Map, pairs: Vec<(usize, usize)>, definition: Definition) -> Result<Self> {
        if pairs.is_empty() {
            return Err(CoreError::Empty("pairs of an anchor and a target").into());
        }
        let len = map.len();
        let row = pairs.iter().flat_map(|&(a, b)| [a, b]).find(|&row| row >= len);
        if let Some(index) = row {
            return Err(CoreError::OutOfRange { what: "row of a pair", index, len }.into());
        }
        map.poses().six_dof()?;
        Ok(Self { map, list: pairs, definition })
    }

    /// Number of pairs.
    #[must_use]
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// Whether there is no pair; there always is one.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Length of a descriptor.
    #[must_use]
    pub fn dim(&self) -> usize {
        self.map.descriptors().dim()
    }

    /// Rows of the map: anchor and target of every pair.
    #[must_use]
    pub fn list(&self) -> &[(usize, usize)] {
        &self.list
    }

    /// Stands for descriptors, poses and pairs.
    #[must_use]
    pub fn digest(&self) -> String {
        let values = self.map.descriptors().as_slice().iter().flat_map(|it| it.to_le_bytes());
        let poses = self.map.poses().six_dof().unwrap_or_default().iter();
        let poses = poses.flat_map(|it| {
            let parts = it.translation.vector.iter().chain(it.rotation.coords.iter()).copied();
            parts.flat_map(f64::to_le_bytes).collect::<Vec<u8>>()
        });
        let rows = self.list.iter().flat_map(|&(a, b)| [a as u64, b as u64]);
        let bytes: Vec<u8> = values.chain(poses).chain(rows.flat_map(u64::to_le_bytes)).collect();
        BlockDigest::of(&bytes).to_hex()
    }

    /// Which relative poses they have.
    #[must_use]
    pub fn definition(&self) -> Definition {
        self.definition
    }

    /// The pairs that a step sees: each pass over all pairs is in an order of its own, drawn from the
    /// seed; pairs that fill no batch are left out of their pass, as released. A function of seed and
    /// step alone.
    #[must_use]
    pub fn batch(&self, step: usize, size: usize, seed: u64) -> PairBatch {
        let size = size.clamp(1, self.len());
        let per_pass = self.len() / size;
        let (pass, number) = (step / per_pass, step % per_pass);
        let mut order: Vec<usize> = (0..self.len()).collect();
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(pass as u64);
        order.shuffle(&mut random);
        self.gather(&order[number * size..][..size])
    }

    /// Whole batches in order; the rest of the pairs is left out, as released (C-9).
    pub fn batches(&self, size: usize) -> impl Iterator<Item = PairBatch> {
        let size = size.clamp(1, self.len());
        (0..self.len() / size).map(move |number| {
            self.gather(&(number * size..(number + 1) * size).collect::<Vec<_>>())
        })
    }

    fn gather(&self, numbers: &[usize]) -> PairBatch {
        // Checked when made.
        let poses = self.map.poses().six_dof().unwrap_or_default();
        let mut batch = PairBatch { n: numbers.len(), ..PairBatch::default() };
        batch.relative.reserve(RELATIVE_POSE * numbers.len());
        for &number in numbers {
            let (anchor, target) = self.list[number];
            batch.anchors.extend(self.map.descriptors().row(anchor));
            batch.targets.extend(self.map.descriptors().row(target));
            let relative = relative_pose(&poses[anchor], &poses[target], self.definition);
            batch.relative.extend(relative);
        }
        batch
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;
    use vpr_core::{Descriptors, Pose, Poses};

    use super::*;
    use crate::sequences;

    fn pairs(n: usize, sequences: &[Range<usize>], k: usize) -> Result<Pairs> {
        let rows = Array2::from_shape_fn((n, 2), |(row, column)| (row * 2 + column) as f32);
        let poses = (0..n).map(|row| Pose::translation(row as f64, 0.0, 0.0)).collect();
        let map = Map::new(Descriptors::new(rows).unwrap(), Poses::SixDof(poses)).unwrap();
        Pairs::following(map, sequences, k, Definition::Corrected)
    }

    #[test]
    fn an_anchor_goes_with_those_that_follow_it_up_to_the_next() {
        let found = pairs(9, &[0..5, 5..9], 3).unwrap();
        assert_eq!(found.list(), [(0, 1), (0, 2), (3, 4), (5, 6), (5, 7)]);
        assert!(pairs(9, &sequences(None, 5), 1).is_err());
        assert!(pairs(9, &[0..1, 1..2], 3).is_err());
        assert!(pairs(4, &sequences(None, 5), 3).is_err());
    }

    #[test]
    fn near_pairs_go_both_ways_and_stay_in_their_sequence() {
        let line = |rows: &[Range<usize>], limits| {
            let map = pairs(6, &sequences(None, 6), 2).unwrap().map;
            Pairs::near(map, rows, limits, Definition::Corrected)
        };
        let found = line(&[0..3, 3..6], (1.0, 0.0)).unwrap();
        let expected = [(0, 1), (1, 0), (1, 2), (2, 1), (3, 4), (4, 3), (4, 5), (5, 4)];
        assert_eq!(found.list(), expected);
        assert_eq!(found.clone().thinned(4).list(), [(0, 1), (1, 2), (3, 4), (4, 5)]);
        assert_eq!(found.thinned(99).len(), 8);
        assert!(line(std::slice::from_ref(&(0..6)), (0.5, 9.0)).is_err(), "none is as near");
        assert!(line(std::slice::from_ref(&(0..7)), (1.0, 9.0)).is_err());
        assert!(line(std::slice::from_ref(&(0..6)), (f64::NAN, 9.0)).is_err());
        assert!(line(std::slice::from_ref(&(0..6)), (1.0, -1.0)).is_err());
    }

    #[test]
    fn seven_scenes_have_the_numbers_of_pairs_that_the_authors_have() {
        // Sixteen test sequences of 1000 images, and two of 500 on the stairs.
        let lengths = [vec![1000; 16], vec![500; 2]].concat();
        let mut start = 0;
        let sequences: Vec<Range<usize>> = lengths
            .into_iter()
            .map(|n| {
                start += n;
                start - n..start
            })
            .collect();
        let found = pairs(start, &sequences, 50).unwrap();
        assert_eq!(found.len(), 16_660);
    }

    #[test]
    fn a_pass_sees_every_pair_at_most_once_and_no_half_batch() {
        let found = pairs(8, &sequences(None, 8), 8).unwrap();
        assert_eq!(found.len(), 7);
        let pass = |number: usize| -> Vec<f32> {
            let steps = 3 * number..3 * number + 3;
            let targets = steps.flat_map(|step| found.batch(step, 2, 5).targets);
            targets.step_by(2).collect()
        };
        let mut first = pass(0);
        assert_ne!(first, pass(1));
        assert_eq!(first, pass(0));
        first.sort_by(f32::total_cmp);
        first.dedup();
        assert_eq!(first.len(), 6);
        assert_eq!(found.batches(2).count(), 3);
        let whole = found.batches(2).next().unwrap();
        assert_eq!(whole.anchors, [0.0, 1.0, 0.0, 1.0]);
        assert_eq!(whole.targets, [2.0, 3.0, 4.0, 5.0]);
        assert_eq!(whole.relative[7..], [2.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
        assert_eq!(found.batch(0, 100, 5).n, 7, "a batch is never larger than all pairs");
    }
}
