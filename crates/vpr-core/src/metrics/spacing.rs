//! How far apart along a traverse the correct matches are.

use crate::{Definition, Error, Result};

/// Histogram of the distances between successive correct matches of a traverse, in frames: element
/// `d` says how often the next correct match came `d` frames later (thesis §3.2.4, figure 3.14).
///
/// Multiply the index by the metres between frames for the horizontal axis (the thesis takes 1 m).
/// Element 0 is always 0.
///
/// - [`Definition::Published`] (`distance_vs_localisation`): a correct match that is not the first
///   frame also adds its distance from the first frame, as if that had been matched. Without any
///   distance, that is with no correct match or only the first frame's, the released code crashes:
///   [`Error::Undefined`].
/// - [`Definition::Corrected`]: only distances between two correct matches; with fewer than two the
///   histogram is empty.
///
/// # Errors
///
/// [`Error::Empty`] without queries, [`Error::Undefined`] as said above.
pub fn true_positive_spacing(definition: Definition, correct: &[bool]) -> Result<Vec<usize>> {
    if correct.is_empty() {
        return Err(Error::Empty("queries"));
    }
    let matched = (0..correct.len()).filter(|&query| correct[query]);
    let marks: Vec<usize> = match definition {
        Definition::Corrected => matched.collect(),
        Definition::Published => {
            [0].into_iter().chain(matched.filter(|&query| query > 0)).collect()
        }
    };
    if definition == Definition::Published && marks.len() < 2 {
        let reason = "no query after the first is matched correctly";
        return Err(Error::Undefined { metric: "the spacing of true positives", reason });
    }
    let mut histogram = Vec::new();
    for gap in marks.windows(2).map(|pair| pair[1] - pair[0]) {
        histogram.resize(histogram.len().max(gap + 1), 0);
        histogram[gap] += 1;
    }
    Ok(histogram)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spacing(definition: Definition, pattern: &str) -> Result<Vec<usize>> {
        let correct: Vec<bool> = pattern.chars().map(|query| query == 'x').collect();
        true_positive_spacing(definition, &correct)
    }

    #[test]
    fn published_counts_from_the_first_frame() {
        let published = |pattern| spacing(Definition::Published, pattern).unwrap();
        assert_eq!(published("..xx.x"), [0, 1, 2]);
        assert_eq!(published("x.xx.x"), [0, 1, 2]);
        assert_eq!(published("...x"), [0, 0, 0, 1]);
    }

    #[test]
    fn corrected_counts_between_matches_only() {
        let corrected = |pattern| spacing(Definition::Corrected, pattern).unwrap();
        assert_eq!(corrected("..xx.x"), [0, 1, 1]);
        assert_eq!(corrected("...x"), [0; 0]);
        assert_eq!(corrected("...."), [0; 0]);
        assert_eq!(corrected("xxxx"), [0, 3]);
    }

    #[test]
    fn published_without_a_distance_is_undefined() {
        for pattern in ["....", "x..."] {
            let err = spacing(Definition::Published, pattern);
            assert!(matches!(err, Err(Error::Undefined { .. })), "{pattern}");
        }
        assert!(matches!(spacing(Definition::Corrected, ""), Err(Error::Empty(_))));
    }
}
