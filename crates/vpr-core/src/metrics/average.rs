//! Mean average precision over all correct references.

use super::recall::check;
use crate::{Error, GroundTruth, Ranking, Result};

/// mAP: the mean over queries of `AP = (1 / R) · Σ precision@r` over the ranks `r` that hold a correct
/// reference, where `R` is the number of correct references of the query.
///
/// `precision@r` is the share of correct references among the first `r`. Correct references that are
/// not ranked add nothing but count in `R`, so rank the whole map for the usual mAP and fewer for
/// mAP@k. Queries without a correct reference have no AP and are left out of the mean. A ranking that
/// names the same reference twice is the caller's mistake and counts twice.
///
/// # Errors
///
/// [`Error::Mismatch`] and [`Error::Empty`] as [`recall_at`](super::recall_at),
/// [`Error::Undefined`] if no query has a correct reference.
pub fn mean_average_precision(ranking: &impl AsRef<Ranking>, truth: &GroundTruth) -> Result<f64> {
    let ranking = ranking.as_ref();
    check(ranking, truth)?;
    let known = || (0..truth.len()).filter(|&query| !truth.is_new_place(query));
    if known().next().is_none() {
        let reason = "no query has a correct reference";
        return Err(Error::Undefined { metric: "mean average precision", reason });
    }
    let sum: f64 = known().map(|query| average_precision_of(query, ranking, truth)).sum();
    Ok(sum / truth.n_known() as f64)
}

/// AP of one query that has a correct reference.
fn average_precision_of(query: usize, ranking: &Ranking, truth: &GroundTruth) -> f64 {
    let (mut n_found, mut sum) = (0_usize, 0.0);
    for (before, &reference) in ranking.indices(query).iter().enumerate() {
        if truth.is_correct(query, reference) {
            n_found += 1;
            sum += n_found as f64 / (before + 1) as f64;
        }
    }
    sum / truth.correct(query).len() as f64
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    #[test]
    fn new_places_are_left_out_of_the_mean() {
        let ranking = Ranking::new(array![[0, 1, 2, 3], [3, 2, 1, 0], [0, 1, 2, 3]]).unwrap();
        let truth = GroundTruth::from_lists(vec![vec![0, 2], vec![], vec![3]], 4).unwrap();
        let expected = f64::midpoint(f64::midpoint(1.0, 2.0 / 3.0), 0.25);
        let value = mean_average_precision(&ranking, &truth).unwrap();
        approx::assert_abs_diff_eq!(value, expected, epsilon = 1e-15);
    }

    #[test]
    fn unranked_references_count_as_missed() {
        let ranking = Ranking::new(array![[0, 1]]).unwrap();
        let truth = GroundTruth::from_lists(vec![vec![0, 5]], 6).unwrap();
        assert_eq!(mean_average_precision(&ranking, &truth).unwrap(), 0.5);
    }

    #[test]
    fn only_new_places_have_no_mean() {
        let ranking = Ranking::new(array![[0, 1]]).unwrap();
        let truth = GroundTruth::from_lists(vec![vec![]], 6).unwrap();
        let err = mean_average_precision(&ranking, &truth);
        assert!(matches!(err, Err(Error::Undefined { .. })));
    }
}
