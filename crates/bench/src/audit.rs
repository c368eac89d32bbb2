//! What may be wrong with a ground truth, and what follows from how it was drawn.

use std::collections::BTreeMap;

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

/// What a radius makes of a dataset.
#[derive(Clone, Debug, PartialEq)]
pub struct AtRadius {
    /// Metres.
    pub radius: f64,
    /// Queries that then have a correct reference.
    pub n_known: usize,
    /// R@1 of every method.
    pub recall: Vec<f64>,
    /// The methods, best first, equal ones by lower index.
    pub order: Vec<usize>,
}

/// R@1 of every method at every radius. Where two of them have different
/// [`AtRadius::order`], the radius decides which method is better.
///
/// # Errors
///
/// Poses of different kinds, a radius that is no distance, and rankings of other queries.
pub fn radii(
    rankings: &[&Ranking],
    queries: &Poses,
    references: &Poses,
    radii: &[f64],
) -> Result<Vec<AtRadius>> {
    let at = |&radius: &f64| {
        let truth = GroundTruth::within_radius(queries, references, radius)?;
        let recall = rankings.iter().map(|it| recall_at(1, *it, &truth));
        let recall = recall.collect::<Result<Vec<f64>>>()?;
        let mut order: Vec<usize> = (0..recall.len()).collect();
        order.sort_by(|&a, &b| recall[b].total_cmp(&recall[a]).then(a.cmp(&b)));
        Ok(AtRadius { radius, n_known: truth.n_known(), recall, order })
    };
    radii.iter().map(at).collect()
}

/// Pairs of methods of which one is better at one radius and the other at another, with these radii.
#[must_use]
pub fn reversals(at: &[AtRadius]) -> Vec<(usize, usize, f64, f64)> {
    let n = at.first().map_or(0, |it| it.recall.len());
    let pairs = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b)));
    let reversal = |(a, b): (usize, usize)| {
        let first = at.iter().find(|it| it.recall[a] > it.recall[b])?;
        let second = at.iter().find(|it| it.recall[b] > it.recall[a])?;
        Some((a, b, first.radius, second.radius))
    };
    pairs.filter_map(reversal).collect()
}

#[cfg(test)]
mod tests {
    use ndarray::array;
    use vpr_core::PlanarPosition;

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

    #[test]
    fn a_radius_can_decide_which_method_is_better() {
        let (queries, references) = (planar(&[0.0, 0.0, 0.0]), planar(&[0.5, 8.0, 90.0]));
        let exact = Ranking::new(array![[0], [0], [2]]).unwrap();
        let coarse = Ranking::new(array![[1], [1], [1]]).unwrap();
        let at = radii(&[&exact, &coarse], &queries, &references, &[0.1, 1.0, 10.0]).unwrap();
        assert_eq!(at[0].n_known, 0);
        assert_eq!((at[1].recall[0], at[1].recall[1]), (2.0 / 3.0, 0.0));
        assert_eq!((&at[1].order, &at[2].order), (&vec![0, 1], &vec![1, 0]));
        assert_eq!(reversals(&at), [(0, 1, 1.0, 10.0)]);
        assert!(reversals(&at[..2]).is_empty());
    }
}
