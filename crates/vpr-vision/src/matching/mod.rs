//! Matching the local features of two images by their descriptors.

mod drawing;
mod hamming;

use serde::{Deserialize, Serialize};
use vpr_core::{
    Descriptors, Error, Result,
    knn::{self, Metric, SearchParams},
};

pub use self::drawing::draw;
use crate::features::{LocalDescriptors, LocalFeatures};

/// A pair of features that look alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match {
    /// Index of the feature in the query image.
    pub query: usize,
    /// Index of the feature in the reference image.
    pub reference: usize,
    /// Euclidean distance of the descriptors, or the number of bits that differ.
    pub distance: f32,
}

/// Which nearest neighbours count as matches.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MatchParams {
    /// Lowe's test: the nearest must be nearer than this times the second nearest. Without a second there is no
    /// match. `None`: no test.
    #[serde(default)]
    pub ratio: Option<f64>,
    /// Whether each of the two must be the nearest of the other.
    #[serde(default)]
    pub mutual: bool,
    /// Matches beyond this distance are dropped.
    #[serde(default)]
    pub max_distance: Option<f32>,
}

impl MatchParams {
    /// The ratio test of the thesis (chapter 5): 0.6, in one direction.
    pub const RATIO: Self = Self { ratio: Some(0.6), mutual: false, max_distance: None };

    /// Mutual nearest neighbours without a ratio test, as XFeat and DISK are matched by their authors.
    pub const MUTUAL: Self = Self { ratio: None, mutual: true, max_distance: None };

    fn check(&self) -> Result<()> {
        if let Some(ratio) = self.ratio
            && !(ratio > 0.0 && ratio <= 1.0)
        {
            let value = ratio.to_string();
            return Err(Error::Parameter {
                name: "ratio",
                value,
                reason: "must be above 0, at most 1",
            });
        }
        match self.max_distance {
            Some(limit) if limit.is_nan() || limit < 0.0 => Err(Error::Parameter {
                name: "max_distance",
                value: limit.to_string(),
                reason: "must not be negative",
            }),
            _ => Ok(()),
        }
    }
}

impl Default for MatchParams {
    fn default() -> Self {
        Self::RATIO
    }
}

/// The nearest reference of a feature and how much farther the second is.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Nearest {
    index: usize,
    distance: f32,
    second: Option<f32>,
}

/// Matches the features of a query image with those of a reference image, in the order of the query features.
///
/// The nearest neighbours are exact, ties by lower index: [`vpr_core::knn::search`] for numbers, the number of
/// differing bits for binary descriptors. No features on either side give no matches.
///
/// # Errors
///
/// [`Error::Mismatch`] if the descriptors differ in length, [`Error::Parameter`] if they differ in kind or if a
/// parameter is out of range.
pub fn match_features(
    query: &LocalFeatures,
    reference: &LocalFeatures,
    params: &MatchParams,
) -> Result<Vec<Match>> {
    params.check()?;
    let want = if params.ratio.is_some() { 2 } else { 1 };
    let [forward, backward] = match (query.descriptors(), reference.descriptors()) {
        (LocalDescriptors::Float(a), LocalDescriptors::Float(b)) => {
            let backward = if params.mutual { nearest(b, a, 1)? } else { Vec::new() };
            [nearest(a, b, want)?, backward]
        }
        (LocalDescriptors::Binary(a), LocalDescriptors::Binary(b)) => {
            let backward = if params.mutual { hamming::nearest(b, a)? } else { Vec::new() };
            [hamming::nearest(a, b)?, backward]
        }
        _ => {
            return Err(Error::Parameter {
                name: "descriptors",
                value: "numbers against bits".to_owned(),
                reason: "both images need descriptors of the same kind",
            });
        }
    };
    let accepted = |&(query, nearest): &(usize, Nearest)| {
        let distinct = params.ratio.is_none_or(|ratio| {
            nearest
                .second
                .is_some_and(|second| f64::from(nearest.distance) < ratio * f64::from(second))
        });
        distinct
            && params.max_distance.is_none_or(|limit| nearest.distance <= limit)
            && (!params.mutual || backward[nearest.index].index == query)
    };
    let matches = forward.into_iter().enumerate().filter(accepted);
    Ok(matches
        .map(|(query, it)| Match { query, reference: it.index, distance: it.distance })
        .collect())
}

/// The nearest row of `references` for every row of `queries`; nothing if there is none.
fn nearest(queries: &Descriptors, references: &Descriptors, k: usize) -> Result<Vec<Nearest>> {
    if queries.is_empty() || references.is_empty() {
        return Ok(Vec::new());
    }
    let params = SearchParams { metric: Metric::Euclidean, k, ..SearchParams::default() };
    let found = knn::search(references, queries, &params)?;
    let of = |query: usize| {
        let distances = found.distances(query);
        Nearest {
            index: found.indices(query)[0],
            distance: distances[0],
            second: distances.get(1).copied(),
        }
    };
    Ok((0..queries.len()).map(of).collect())
}

#[cfg(test)]
mod tests {
    use ndarray::{Array2, array};

    use super::*;
    use crate::features::BinaryDescriptors;

    fn features(descriptors: LocalDescriptors) -> LocalFeatures {
        let n = descriptors.len();
        LocalFeatures::new(vec![[0.0; 2]; n], vec![0.0; n], descriptors).unwrap()
    }

    fn float(rows: Array2<f32>) -> LocalFeatures {
        features(LocalDescriptors::Float(Descriptors::new(rows).unwrap()))
    }

    fn pairs(matches: &[Match]) -> Vec<(usize, usize)> {
        matches.iter().map(|it| (it.query, it.reference)).collect()
    }

    #[test]
    fn the_ratio_test_drops_what_has_two_answers() {
        let a = float(array![[0.0, 0.0], [5.0, 5.0]]);
        let b = float(array![[0.1, 0.0], [9.0, 9.0], [5.0, 6.0], [5.0, 4.1]]);
        let matches = match_features(&a, &b, &MatchParams::RATIO).unwrap();
        assert_eq!(pairs(&matches), [(0, 0)]);
        assert!((matches[0].distance - 0.1).abs() < 1e-6);
        let plain = MatchParams { ratio: None, ..MatchParams::RATIO };
        assert_eq!(pairs(&match_features(&a, &b, &plain).unwrap()), [(0, 0), (1, 3)]);
    }

    #[test]
    fn mutual_neighbours_agree_in_both_directions() {
        let a = float(array![[0.0], [1.0], [10.0]]);
        let b = float(array![[0.6], [11.0]]);
        let matches = match_features(&a, &b, &MatchParams::MUTUAL).unwrap();
        assert_eq!(pairs(&matches), [(1, 0), (2, 1)]);
        let close = MatchParams { max_distance: Some(0.5), ..MatchParams::MUTUAL };
        assert_eq!(pairs(&match_features(&a, &b, &close).unwrap()), [(1, 0)]);
    }

    #[test]
    fn one_reference_cannot_pass_the_ratio_test() {
        let matches =
            match_features(&float(array![[1.0]]), &float(array![[1.0]]), &MatchParams::RATIO);
        assert_eq!(matches.unwrap(), []);
    }

    #[test]
    fn nothing_matches_nothing() {
        let (none, one) = (float(Array2::zeros((0, 3))), float(array![[1.0, 2.0, 3.0]]));
        for params in [MatchParams::RATIO, MatchParams::MUTUAL] {
            assert_eq!(match_features(&none, &one, &params).unwrap(), []);
            assert_eq!(match_features(&one, &none, &params).unwrap(), []);
            assert_eq!(match_features(&none, &none, &params).unwrap(), []);
        }
    }

    #[test]
    fn kinds_and_dimensions_must_agree() {
        let bits = |row_bytes| {
            let bits = BinaryDescriptors::new(row_bytes, vec![0; row_bytes]).unwrap();
            features(LocalDescriptors::Binary(bits))
        };
        let one = float(array![[1.0, 2.0]]);
        assert!(match_features(&one, &bits(8), &MatchParams::RATIO).is_err());
        assert!(match_features(&one, &float(array![[1.0]]), &MatchParams::RATIO).is_err());
        assert!(match_features(&bits(4), &bits(8), &MatchParams::RATIO).is_err());
        let params = MatchParams { ratio: Some(1.5), ..MatchParams::RATIO };
        assert!(match_features(&one, &one, &params).is_err());
    }

    #[test]
    fn bits_are_matched_by_how_many_differ() {
        let row = |bits: u8| [bits, 0, 0, 0, 0, 0, 0, 0, 255, 0];
        let set = |rows: &[u8]| {
            let bytes = rows.iter().flat_map(|&it| row(it)).collect();
            features(LocalDescriptors::Binary(BinaryDescriptors::new(10, bytes).unwrap()))
        };
        let (a, b) = (set(&[0b1111, 0b1000_0000]), set(&[0b1100_0001, 0b0111, 0b1000_0000]));
        let matches = match_features(&a, &b, &MatchParams::RATIO).unwrap();
        assert_eq!(pairs(&matches), [(0, 1), (1, 2)]);
        assert_eq!(matches[0].distance, 1.0);
    }
}
