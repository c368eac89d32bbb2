//! Which images a query is compared with: positives near it, negatives far from it (thesis §4.2.3).

use rand::{Rng, RngExt};
use rayon::prelude::*;
use serde::Deserialize;
use vpr_core::{Descriptors, Error as CoreError, Poses};

use crate::{Error, Result};

/// How triplets are mined. The distances are not in the thesis: these are those of NetVLAD's
/// training (Arandjelović et al. 2016), and the radius within which the field calls a match right.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MiningParams {
    /// A reference up to this far from the query's camera shows its place, metres.
    pub positive_m: f64,
    /// A reference at least this far from it shows another place, metres.
    pub negative_m: f64,
    /// A negative is drawn from so many that are nearest in feature space; 1 is the hardest alone.
    pub hardest: usize,
}

impl Default for MiningParams {
    fn default() -> Self {
        Self { positive_m: 10.0, negative_m: 25.0, hardest: 10 }
    }
}

/// Rows of the references: whose augmentation is the query, what shows its place, what does not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Triplet {
    /// The query is an augmentation of this reference.
    pub query: usize,
    /// A reference of the same place.
    pub positive: usize,
    /// A reference of another place.
    pub negative: usize,
}

/// What a reference is compared with.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Candidates {
    /// Positives and negatives, nearest in feature space first.
    Mined { positive: usize, negatives: Vec<usize> },
    /// Without poses: itself, and any other.
    Random,
}

/// For every reference what it is compared with.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mined {
    candidates: Vec<Candidates>,
    /// References that negatives and positives are taken from, in rising order.
    allowed: Vec<usize>,
}

impl MiningParams {
    /// The same distances where a metre is so many metres.
    #[must_use]
    pub fn scaled(self, scale: f64) -> Self {
        let (positive_m, negative_m) = (scale * self.positive_m, scale * self.negative_m);
        Self { positive_m, negative_m, ..self }
    }

    /// Checks the numbers.
    ///
    /// # Errors
    ///
    /// [`CoreError::Parameter`] with the first that is out of range.
    pub fn check(&self) -> Result<()> {
        let refuse = |name, value: String, reason| {
            Err(Error::Core(CoreError::Parameter { name, value, reason }))
        };
        if !(self.positive_m >= 0.0 && self.positive_m.is_finite()) {
            let reason = "must be a number of metres from 0";
            return refuse("positive_m", self.positive_m.to_string(), reason);
        }
        if !(self.negative_m > self.positive_m && self.negative_m.is_finite()) {
            let reason = "must be more than `positive_m`";
            return refuse("negative_m", self.negative_m.to_string(), reason);
        }
        if self.hardest == 0 {
            return refuse("hardest", "0".to_owned(), "must be at least 1");
        }
        Ok(())
    }

    /// Mines with poses. `rows` are descriptors of all references by the network as it is; only
    /// `allowed` ones become positives or negatives. The positive of a reference is the nearest in
    /// feature space of those up to [`Self::positive_m`] from it, itself apart, and itself if there
    /// is no other; hard negatives are the nearest of those from [`Self::negative_m`]. Ties go to
    /// the lower row.
    ///
    /// # Errors
    ///
    /// [`CoreError::Mismatch`] if there is not a pose for every row; [`CoreError::OutOfRange`] for
    /// an allowed row that does not exist; [`Error::OnePlace`] if no reference has a negative.
    pub fn with_poses(
        &self,
        rows: &Descriptors,
        poses: &Poses,
        allowed: &[usize],
    ) -> Result<Mined> {
        self.check()?;
        let (expected, actual) = (rows.len(), poses.len());
        if expected != actual {
            let what = "poses of the references";
            return Err(CoreError::Mismatch { what, expected, actual }.into());
        }
        let allowed = checked(allowed, rows.len())?;
        let metres = |a: usize, b: usize| (poses.position(a) - poses.position(b)).norm();
        let of = |query: usize| {
            let distance = |other: usize| squared(rows, query, other);
            let others = allowed.iter().copied().filter(|&it| it != query);
            let near = others.clone().filter(|&it| metres(query, it) <= self.positive_m);
            let positive = nearest(near, 1, distance).first().copied().unwrap_or(query);
            let far = others.filter(|&it| metres(query, it) >= self.negative_m);
            Candidates::Mined { positive, negatives: nearest(far, self.hardest, distance) }
        };
        let candidates: Vec<Candidates> = (0..rows.len()).into_par_iter().map(of).collect();
        let has_negative = |query: &usize| match &candidates[*query] {
            Candidates::Mined { negatives, .. } => !negatives.is_empty(),
            Candidates::Random => true,
        };
        if !allowed.iter().any(has_negative) {
            let (n, beyond_m) = (allowed.len(), self.negative_m);
            return Err(Error::OnePlace { n, beyond_m });
        }
        Ok(Mined { candidates, allowed })
    }
}

impl Mined {
    /// Without poses: the positive is the reference itself, the negative any other at random, which
    /// may show the same place.
    ///
    /// # Errors
    ///
    /// [`CoreError::OutOfRange`] for an allowed row that does not exist; [`Error::TooFew`] below two.
    pub fn without_poses(n: usize, allowed: &[usize]) -> Result<Self> {
        let allowed = checked(allowed, n)?;
        if allowed.len() < 2 {
            let purpose = "to have a negative";
            return Err(Error::TooFew { n: allowed.len(), needed: 2, purpose });
        }
        Ok(Self { candidates: vec![Candidates::Random; n], allowed })
    }

    /// References that can be queries: the allowed ones that have a negative.
    #[must_use]
    pub fn queries(&self) -> Vec<usize> {
        let has_negative = |&query: &usize| match &self.candidates[query] {
            Candidates::Mined { negatives, .. } => !negatives.is_empty(),
            Candidates::Random => true,
        };
        self.allowed.iter().copied().filter(has_negative).collect()
    }

    /// A triplet of this query; which of its negatives is drawn. `None` if it has none.
    pub fn triplet(&self, query: usize, random: &mut impl Rng) -> Option<Triplet> {
        match self.candidates.get(query)? {
            Candidates::Mined { positive, negatives } if !negatives.is_empty() => {
                let negative = negatives[random.random_range(0..negatives.len())];
                Some(Triplet { query, positive: *positive, negative })
            }
            Candidates::Mined { .. } => None,
            Candidates::Random => {
                let own = self.allowed.binary_search(&query).ok();
                let n = self.allowed.len() - usize::from(own.is_some());
                let drawn = random.random_range(0..n);
                let at = drawn + usize::from(own.is_some_and(|own| drawn >= own));
                Some(Triplet { query, positive: query, negative: self.allowed[at] })
            }
        }
    }
}

/// The rows in rising order, each once.
fn checked(allowed: &[usize], len: usize) -> Result<Vec<usize>> {
    let mut allowed = allowed.to_vec();
    allowed.sort_unstable();
    allowed.dedup();
    match allowed.last() {
        Some(&index) if index >= len => {
            Err(CoreError::OutOfRange { what: "reference", index, len }.into())
        }
        _ => Ok(allowed),
    }
}

/// The `n` rows with the least distance, ties by lower row.
fn nearest(
    rows: impl Iterator<Item = usize>,
    n: usize,
    distance: impl Fn(usize) -> f64,
) -> Vec<usize> {
    let mut rows: Vec<(f64, usize)> = rows.map(|row| (distance(row), row)).collect();
    let before = |a: &(f64, usize), b: &(f64, usize)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
    if rows.len() > n {
        rows.select_nth_unstable_by(n, before);
        rows.truncate(n);
    }
    rows.sort_unstable_by(before);
    rows.into_iter().map(|(_, row)| row).collect()
}

/// Square of the Euclidean distance, in f64.
fn squared(rows: &Descriptors, a: usize, b: usize) -> f64 {
    let dim = rows.dim();
    let row = |at: usize| &rows.as_slice()[at * dim..(at + 1) * dim];
    let difference = |(a, b): (&f32, &f32)| f64::from(*a) - f64::from(*b);
    row(a).iter().zip(row(b)).map(difference).map(|it| it * it).sum()
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use vpr_core::PlanarPosition;

    use super::*;

    fn map(features: &[f32], metres: &[f64]) -> (Descriptors, Poses) {
        let rows = Array2::from_shape_vec((features.len(), 1), features.to_vec()).unwrap();
        let poses = metres.iter().map(|&x| PlanarPosition::new(x, 0.0)).collect();
        (Descriptors::new(rows).unwrap(), Poses::Planar(poses))
    }

    fn drawn(mined: &Mined, query: usize) -> Vec<Triplet> {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        (0..60).filter_map(|_| mined.triplet(query, &mut random)).collect()
    }

    #[test]
    fn positives_are_near_and_negatives_are_the_look_alikes_far_away() {
        // 0, 5 and 20 m, then 100, 200 and 300 m; the one at 200 m looks most like the first.
        let (rows, poses) =
            map(&[0.0, 3.0, 0.1, 2.0, 0.5, 9.0], &[0.0, 5.0, 20.0, 100.0, 200.0, 300.0]);
        let all: Vec<usize> = (0..6).collect();
        let params = MiningParams { hardest: 1, ..MiningParams::default() };
        let mined = params.with_poses(&rows, &poses, &all).unwrap();
        for triplet in drawn(&mined, 0) {
            assert_eq!(triplet, Triplet { query: 0, positive: 1, negative: 4 });
        }
        // Nobody is near it: it is its own positive. What lies between both distances is neither.
        assert_eq!(drawn(&mined, 2)[0], Triplet { query: 2, positive: 2, negative: 4 });
        let two = MiningParams { hardest: 2, ..params }.with_poses(&rows, &poses, &all).unwrap();
        let mut negatives: Vec<usize> = drawn(&two, 0).iter().map(|it| it.negative).collect();
        negatives.sort_unstable();
        negatives.dedup();
        assert_eq!(negatives, [3, 4]);
    }

    #[test]
    fn who_is_not_allowed_is_neither_positive_nor_negative() {
        let (rows, poses) = map(&[0.0, 0.1, 0.2, 5.0], &[0.0, 5.0, 100.0, 200.0]);
        let mined = MiningParams::default().with_poses(&rows, &poses, &[3, 0]).unwrap();
        assert_eq!(mined.queries(), [0, 3]);
        assert_eq!(drawn(&mined, 0)[0], Triplet { query: 0, positive: 0, negative: 3 });
        assert!(MiningParams::default().with_poses(&rows, &poses, &[0, 4]).is_err());
    }

    #[test]
    fn one_place_is_refused_and_a_lonely_one_is_left_out() {
        let (rows, poses) = map(&[0.0, 0.1, 0.2], &[0.0, 5.0, 10.0]);
        let err = MiningParams::default().with_poses(&rows, &poses, &[0, 1, 2]).unwrap_err();
        assert!(matches!(err, Error::OnePlace { n: 3, .. }), "{err}");
        // Between two ends 30 m apart, the middle has no negative.
        let (rows, poses) = map(&[0.0, 0.1, 0.2], &[0.0, 15.0, 30.0]);
        let mined = MiningParams::default().with_poses(&rows, &poses, &[0, 1, 2]).unwrap();
        assert_eq!(mined.queries(), [0, 2]);
        assert!(drawn(&mined, 1).is_empty());
    }

    #[test]
    fn identical_images_go_by_row() {
        let (rows, poses) = map(&[1.0; 4], &[0.0, 100.0, 200.0, 300.0]);
        let params = MiningParams { hardest: 2, ..MiningParams::default() };
        let mined = params.with_poses(&rows, &poses, &[0, 1, 2, 3]).unwrap();
        assert!(drawn(&mined, 0).iter().all(|it| [1, 2].contains(&it.negative)));
    }

    #[test]
    fn without_poses_every_other_reference_may_come() {
        let mined = Mined::without_poses(5, &[0, 2, 4]).unwrap();
        let triplets = drawn(&mined, 2);
        assert!(triplets.iter().all(|it| it.positive == 2));
        let mut negatives: Vec<usize> = triplets.iter().map(|it| it.negative).collect();
        negatives.sort_unstable();
        negatives.dedup();
        assert_eq!(negatives, [0, 4]);
        assert!(matches!(Mined::without_poses(5, &[1]), Err(Error::TooFew { .. })));
    }

    #[test]
    fn distances_that_mean_nothing_are_refused() {
        for params in [
            MiningParams { positive_m: -1.0, ..MiningParams::default() },
            MiningParams { negative_m: 10.0, ..MiningParams::default() },
            MiningParams { negative_m: f64::NAN, ..MiningParams::default() },
            MiningParams { hardest: 0, ..MiningParams::default() },
        ] {
            assert!(params.check().is_err(), "{params:?}");
        }
    }
}
