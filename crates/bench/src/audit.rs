//! What may be wrong with a ground truth, and what follows from how it was drawn.

use std::{collections::BTreeMap, fmt};

use vpr_core::{Descriptors, Error, GroundTruth, Poses, Ranking, Result, metrics::recall_at};

/// A query whose best match counts as wrong and looks right: its features agree with those of the
/// image, and better than with any image that counts as correct and was looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Suspect {
    /// The query.
    pub query: usize,
    /// The reference that was found.
    pub found: usize,
    /// Inliers of geometric verification with it.
    pub inliers: usize,
    /// The correct reference that is ranked first, if one is ranked, and inliers with it.
    pub correct: Option<(usize, usize)>,
}

/// Pairs of images to verify: for each query whose best match counts as wrong, that match, and the
/// correct reference that is ranked first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Doubt {
    /// The query.
    pub query: usize,
    /// Its best reference, which counts as wrong.
    pub found: usize,
    /// The correct reference that is ranked first; none for a new place, or if none is ranked.
    pub correct: Option<usize>,
}

/// The queries whose best match counts as wrong, surest first, ties by lower index.
///
/// # Errors
///
/// [`Error::Mismatch`] if ranking, confidence and truth are not of equally many queries.
pub fn doubts(ranking: &Ranking, confidence: &[f64], truth: &GroundTruth) -> Result<Vec<Doubt>> {
    let right = truth.judge(&ranking.best())?;
    let (expected, actual) = (right.len(), confidence.len());
    if expected != actual {
        return Err(Error::Mismatch { what: "confidences of queries", expected, actual });
    }
    let mut wrong: Vec<usize> = (0..right.len()).filter(|&it| !right[it]).collect();
    wrong.sort_by(|&a, &b| confidence[b].total_cmp(&confidence[a]).then(a.cmp(&b)));
    let doubt = |query: usize| {
        let ranked = ranking.indices(query);
        let correct = ranked.iter().copied().find(|&it| truth.is_correct(query, it));
        Doubt { query, found: ranked[0], correct }
    };
    Ok(wrong.into_iter().map(doubt).collect())
}

/// The doubts in which the match that was found has at least `fewest` inliers, and more than the
/// correct reference; `inliers` are those of the pairs of [`pairs`], in that order.
#[must_use]
pub fn suspects(doubts: &[Doubt], inliers: &[usize], fewest: usize) -> Vec<Suspect> {
    let mut inliers = inliers.iter().copied();
    let of = |doubt: &Doubt| {
        let found = inliers.next()?;
        let correct = match doubt.correct {
            Some(reference) => Some((reference, inliers.next()?)),
            None => None,
        };
        Some(Suspect { query: doubt.query, found: doubt.found, inliers: found, correct })
    };
    let all: Vec<Suspect> = doubts.iter().filter_map(of).collect();
    let looks_right = |it: &Suspect| {
        it.inliers >= fewest && it.correct.is_none_or(|(_, inliers)| it.inliers > inliers)
    };
    all.into_iter().filter(looks_right).collect()
}

/// Query and reference of every pair that [`suspects`] needs the inliers of.
#[must_use]
pub fn pairs(doubts: &[Doubt]) -> Vec<(usize, usize)> {
    let of = |it: &Doubt| [Some(it.found), it.correct].map(|to| to.map(|to| (it.query, to)));
    doubts.iter().flat_map(of).flatten().collect()
}

/// Images that were described by the same bits, in groups of two or more: the same pixels, as a rule.
/// Images are numbered references first, then queries.
#[must_use]
pub fn duplicates(references: &Descriptors, queries: &Descriptors) -> Vec<Vec<usize>> {
    let mut groups: BTreeMap<Vec<u32>, Vec<usize>> = BTreeMap::new();
    let sides = [references.view(), queries.view()];
    let rows = sides.iter().flat_map(|side| side.outer_iter());
    let rows: Vec<Vec<u32>> =
        rows.map(|row| row.iter().map(|it| (it + 0.0).to_bits()).collect()).collect();
    for (image, bits) in rows.into_iter().enumerate() {
        groups.entry(bits).or_default().push(image);
    }
    let mut groups: Vec<Vec<usize>> = groups.into_values().filter(|it| it.len() > 1).collect();
    groups.sort();
    groups
}

/// References that are the best match of no query.
#[must_use]
pub fn never_nearest(ranking: &Ranking, n_references: usize) -> Vec<usize> {
    let mut is_best = vec![false; n_references];
    for reference in ranking.best() {
        is_best[reference] = true;
    }
    (0..n_references).filter(|&it| !is_best[it]).collect()
}

/// Queries without a correct reference.
#[must_use]
pub fn without_positives(truth: &GroundTruth) -> Vec<usize> {
    (0..truth.len()).filter(|&it| truth.is_new_place(it)).collect()
}

/// How far a reference may be from a query and still be correct.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Metres.
    pub radius: f64,
    /// Degrees between the orientations of the cameras; any if there is none.
    pub angle: Option<f64>,
}

impl fmt::Display for Limits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} m", self.radius)?;
        self.angle.map_or(Ok(()), |angle| write!(f, " and {angle}°"))
    }
}

impl Limits {
    /// The truth of images with these poses; both limits belong to it.
    fn truth(self, queries: &Poses, references: &Poses) -> Result<GroundTruth> {
        let near = GroundTruth::within_radius(queries, references, self.radius)?;
        let Some(angle) = self.angle else { return Ok(near) };
        if !(0.0..=180.0).contains(&angle) {
            let reason = "must be from 0 to 180 degrees";
            return Err(Error::Parameter { name: "angle", value: angle.to_string(), reason });
        }
        let (queries, references) = (queries.six_dof()?, references.six_dof()?);
        let turned = |query: usize, reference: usize| {
            queries[query].rotation.angle_to(&references[reference].rotation).to_degrees()
        };
        let of = |query: usize| {
            let near = near.correct(query).iter().copied();
            near.filter(|&reference| turned(query, reference) <= angle).collect()
        };
        GroundTruth::from_lists((0..near.len()).map(of).collect(), near.n_references())
    }
}

/// What limits make of a dataset.
#[derive(Clone, Debug, PartialEq)]
pub struct AtLimits {
    /// The limits.
    pub limits: Limits,
    /// Queries that then have a correct reference.
    pub n_known: usize,
    /// R@1 of every method.
    pub recall: Vec<f64>,
    /// The methods, best first, equal ones by lower index.
    pub order: Vec<usize>,
}

/// R@1 of every method under every limit. Where two of them have different
/// [`AtLimits::order`], the limit decides which method is better.
///
/// # Errors
///
/// Poses of different kinds, or without orientation where an angle is asked for; a radius that is no
/// distance, an angle that is none, and rankings of other queries.
pub fn at_limits(
    rankings: &[&Ranking],
    queries: &Poses,
    references: &Poses,
    limits: &[Limits],
) -> Result<Vec<AtLimits>> {
    let at = |&limits: &Limits| {
        let truth = limits.truth(queries, references)?;
        let recall = rankings.iter().map(|it| recall_at(1, *it, &truth));
        let recall = recall.collect::<Result<Vec<f64>>>()?;
        let mut order: Vec<usize> = (0..recall.len()).collect();
        order.sort_by(|&a, &b| recall[b].total_cmp(&recall[a]).then(a.cmp(&b)));
        Ok(AtLimits { limits, n_known: truth.n_known(), recall, order })
    };
    limits.iter().map(at).collect()
}

/// Pairs of methods of which one is better under one limit and the other under another, with these.
#[must_use]
pub fn reversals(at: &[AtLimits]) -> Vec<(usize, usize, Limits, Limits)> {
    let n = at.first().map_or(0, |it| it.recall.len());
    let pairs = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b)));
    let reversal = |(a, b): (usize, usize)| {
        let first = at.iter().find(|it| it.recall[a] > it.recall[b])?;
        let second = at.iter().find(|it| it.recall[b] > it.recall[a])?;
        Some((a, b, first.limits, second.limits))
    };
    pairs.filter_map(reversal).collect()
}

#[cfg(test)]
mod tests {
    use ndarray::array;
    use vpr_core::{PlanarPosition, Pose};

    use super::*;

    fn planar(eastings: &[f64]) -> Poses {
        Poses::Planar(eastings.iter().map(|&x| PlanarPosition::new(x, 0.0)).collect())
    }

    #[test]
    fn a_wrong_match_that_agrees_better_than_the_right_one_is_suspect() {
        let ranking = Ranking::new(array![[0, 1], [2, 1], [1, 0], [1, 0]]).unwrap();
        let lists = vec![vec![0], vec![1], vec![0], vec![]];
        let truth = GroundTruth::from_lists(lists, 3).unwrap();
        let doubts = doubts(&ranking, &[0.9, 0.5, 0.7, 0.5], &truth).unwrap();
        let doubt = |query, found, correct| Doubt { query, found, correct };
        assert_eq!(doubts, [doubt(2, 1, Some(0)), doubt(1, 2, Some(1)), doubt(3, 1, None)]);
        assert_eq!(pairs(&doubts), [(2, 1), (2, 0), (1, 2), (1, 1), (3, 1)]);
        let suspects = suspects(&doubts, &[50, 60, 40, 10, 19], 20);
        assert_eq!(suspects, [Suspect { query: 1, found: 2, inliers: 40, correct: Some((1, 10)) }]);
    }

    #[test]
    fn the_same_bits_are_one_group_across_sides() {
        let references = Descriptors::new(array![[1.0, 0.0], [0.0, 1.0], [1.0, -0.0]]).unwrap();
        let queries = Descriptors::new(array![[0.5, 0.5], [0.0, 1.0]]).unwrap();
        assert_eq!(duplicates(&references, &queries), [vec![0, 2], vec![1, 4]]);
    }

    #[test]
    fn what_is_never_found_and_never_there_is_listed() {
        let ranking = Ranking::new(array![[1], [1], [3]]).unwrap();
        assert_eq!(never_nearest(&ranking, 5), [0, 2, 4]);
        let truth = GroundTruth::from_lists(vec![vec![0], vec![], vec![]], 5).unwrap();
        assert_eq!(without_positives(&truth), [1, 2]);
    }

    fn radius(radius: f64) -> Limits {
        Limits { radius, angle: None }
    }

    #[test]
    fn a_radius_can_decide_which_method_is_better() {
        let (queries, references) = (planar(&[0.0, 0.0, 0.0]), planar(&[0.5, 8.0, 90.0]));
        let exact = Ranking::new(array![[0], [0], [2]]).unwrap();
        let coarse = Ranking::new(array![[1], [1], [1]]).unwrap();
        let limits = [0.1, 1.0, 10.0].map(radius);
        let at = at_limits(&[&exact, &coarse], &queries, &references, &limits).unwrap();
        assert_eq!(at[0].n_known, 0);
        assert_eq!((at[1].recall[0], at[1].recall[1]), (2.0 / 3.0, 0.0));
        assert_eq!((&at[1].order, &at[2].order), (&vec![0, 1], &vec![1, 0]));
        assert_eq!(reversals(&at), [(0, 1, radius(1.0), radius(10.0))]);
        assert!(reversals(&at[..2]).is_empty());
    }

    #[test]
    fn an_angle_leaves_out_who_looks_elsewhere() {
        let pose = |x: f64, degrees: f64| {
            let turn = nalgebra::Vector3::y() * degrees.to_radians();
            Pose::new(nalgebra::Vector3::new(x, 0.0, 0.0), turn)
        };
        let queries = Poses::SixDof(vec![pose(0.0, 0.0), pose(5.0, 0.0)]);
        let references = Poses::SixDof(vec![pose(0.0, 180.0), pose(1.0, -30.0), pose(5.0, 29.0)]);
        let nearest = Ranking::new(array![[0], [2]]).unwrap();
        let alike = Ranking::new(array![[1], [1]]).unwrap();
        let of = |radius, angle| Limits { radius, angle };
        let limits = [of(2.0, None), of(2.0, Some(31.0)), of(2.0, Some(29.5))];
        let at = at_limits(&[&nearest, &alike], &queries, &references, &limits).unwrap();
        let recall = |index: usize| (at[index].n_known, at[index].recall.clone());
        assert_eq!(recall(0), (2, vec![1.0, 0.5]));
        assert_eq!(recall(1), (2, vec![0.5, 0.5]));
        assert_eq!(recall(2), (1, vec![0.5, 0.0]));
        assert_eq!(limits[1].to_string(), "2 m and 31°");
        let flat = planar(&[0.0, 5.0]);
        assert!(at_limits(&[], &flat, &flat, &limits[1..]).is_err());
        assert!(at_limits(&[], &queries, &references, &[of(2.0, Some(181.0))]).is_err());
    }
}
