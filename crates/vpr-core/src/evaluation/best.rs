//! Whether one of several methods on the same queries is better than every other.

use rayon::prelude::*;

use super::Evaluation;
use crate::{
    Definition, Error, Result,
    metrics::{
        Discordant, McNemar,
        bootstrap::{Resampling, draw},
        holm, share_beyond_zero,
    },
};

/// The method whose AUC-PR is the highest, if the paired bootstrap tells it from every other at a
/// level, after Holm's correction for all pairs; `None` if it does not, or there are fewer than two.
///
/// The p-values are those of [`Evaluation::auc_pr_test`] by the same draws, of at least as many
/// resamples as `resampling` says: with few, no corrected p-value of many methods could be small. A
/// pair for which half of the resamples have no value is not told apart.
///
/// # Errors
///
/// [`Error::Mismatch`] if the methods were not asked equally many queries, [`Error::Undefined`] if one
/// has no AUC-PR, [`Error::Parameter`] without resamples.
pub fn best_by_auc_pr(
    methods: &[Evaluation<'_>],
    definition: Definition,
    resampling: &Resampling,
    level: f64,
) -> Result<Option<usize>> {
    let Some(first) = methods.first() else { return Ok(None) };
    let n_queries = first.judged.len();
    for it in methods {
        same_queries(n_queries, it.judged.len())?;
    }
    if resampling.n_resamples == 0 {
        let (name, reason) = ("n_resamples", "must be at least 1");
        return Err(Error::Parameter { name, value: "0".to_owned(), reason });
    }
    let values = methods.iter().map(|it| it.auc_pr(definition)).collect::<Result<Vec<_>>>()?;
    // The smallest p-value, two in as many, is half the level after the correction.
    let n_pairs = methods.len() * (methods.len() - 1) / 2;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
    let needed = (4.0 * n_pairs as f64 / level).ceil() as usize;
    let n_resamples = resampling.n_resamples.max(needed);
    // One draw for all methods: pairs are paired, and each method is resampled once.
    let drawn = (0..n_resamples).into_par_iter().map(|resample| {
        let queries = draw(n_queries, resampling.seed, resample);
        methods.iter().map(|it| defined(it.resampled(&queries, definition))).collect()
    });
    let drawn = drawn.collect::<Result<Vec<Vec<Option<f64>>>>>()?;
    let p_value = |a: usize, b: usize| {
        let pairs = drawn.iter().filter_map(|areas| Some(areas[a]? - areas[b]?));
        let differences: Vec<f64> = pairs.collect();
        let is_known = 2 * differences.len() >= n_resamples;
        Ok(if is_known { share_beyond_zero(&differences) } else { 1.0 })
    };
    told_apart(&values, level, p_value)
}

/// The method that is right on the most queries, if `McNemar`'s test tells it from every other at a
/// level, after Holm's correction for all pairs; `hits` says of each method on which queries it is.
///
/// # Errors
///
/// [`Error::Mismatch`] if the methods were not asked equally many queries, [`Error::Empty`] without
/// queries.
pub fn best_by_hits(hits: &[Vec<bool>], test: McNemar, level: f64) -> Result<Option<usize>> {
    let count = |hits: &Vec<bool>| hits.iter().filter(|it| **it).count() as f64;
    let values: Vec<f64> = hits.iter().map(count).collect();
    let p_value = |a: usize, b: usize| Ok(Discordant::count(&hits[a], &hits[b])?.p_value(test));
    told_apart(&values, level, p_value)
}

fn told_apart(
    values: &[f64],
    level: f64,
    p_value: impl Fn(usize, usize) -> Result<f64>,
) -> Result<Option<usize>> {
    let n = values.len();
    // The first of equal ones, which no test will tell apart.
    let higher = |best: usize, it: usize| if values[it] > values[best] { it } else { best };
    let Some(best) = (0..n).reduce(higher).filter(|_| n > 1) else { return Ok(None) };
    let pairs: Vec<_> = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b))).collect();
    let of_best = |&&(a, b): &&(usize, usize)| a == best || b == best;
    // What is not significant before the correction is not after it.
    for &(a, b) in pairs.iter().filter(of_best) {
        if p_value(a, b)? > level {
            return Ok(None);
        }
    }
    let p_values = pairs.iter().map(|&(a, b)| p_value(a, b)).collect::<Result<Vec<_>>>()?;
    let corrected = holm(&p_values)?;
    let mut told = pairs.iter().zip(corrected).filter(|(pair, _)| of_best(pair));
    Ok(told.all(|(_, p_value)| p_value <= level).then_some(best))
}

fn same_queries(expected: usize, actual: usize) -> Result<()> {
    if expected == actual {
        return Ok(());
    }
    Err(Error::Mismatch { what: "queries of two methods", expected, actual })
}

fn defined(value: Result<f64>) -> Result<Option<f64>> {
    match value {
        Ok(value) => Ok(Some(value)),
        Err(Error::Undefined { .. }) => Ok(None),
        Err(err) => Err(err),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Judged;

    fn right(share: usize, n: usize) -> Vec<bool> {
        (0..n).map(|query| query * 7 % 10 < share).collect()
    }

    #[test]
    fn only_what_a_test_tells_from_every_other_is_best() {
        let best = |hits: &[Vec<bool>]| best_by_hits(hits, McNemar::MidP, 0.05).unwrap();
        assert_eq!(best(&[right(3, 200), right(9, 200), right(5, 200)]), Some(1));
        // The same two are told apart alone and not beside a third that is as good.
        assert_eq!(best(&[right(9, 200), right(5, 200), right(9, 200)]), None);
        assert_eq!(best(&[right(9, 10), right(7, 10)]), None);
        assert_eq!((best(&[right(9, 10)]), best(&[])), (None, None));
        assert!(best_by_hits(&[right(9, 10), right(9, 11)], McNemar::MidP, 0.05).is_err());
    }

    /// Six wins of six have p = 1/64: enough alone, not among three pairs.
    #[test]
    fn more_comparisons_ask_for_more() {
        let a: Vec<bool> = (0..20).map(|it| it < 16).collect();
        let b: Vec<bool> = (0..20).map(|it| it < 10).collect();
        let p = Discordant::count(&a, &b).unwrap().p_value(McNemar::MidP);
        assert!((p - 1.0 / 64.0).abs() < 1e-12, "{p}");
        let best = |hits: &[Vec<bool>], level| best_by_hits(hits, McNemar::MidP, level).unwrap();
        assert_eq!(best(&[a.clone(), b.clone()], 0.02), Some(0));
        assert_eq!(best(&[a, b.clone(), b], 0.02), None);
    }

    #[test]
    fn areas_are_told_apart_by_the_same_p_values() {
        let n = 120;
        let confidence: Vec<f64> = (0..n).map(|query| (query * 31 % 17) as f64).collect();
        let judged = [9, 4, 8].map(|it| Judged::from_flags(right(it, n), vec![true; n]).unwrap());
        let evaluations: Vec<_> =
            judged.iter().map(|it| Evaluation::of_confidence(&confidence, it).unwrap()).collect();
        let (definition, resampling) = (Definition::Corrected, Resampling::default());
        let best =
            |it: &[Evaluation<'_>]| best_by_auc_pr(it, definition, &resampling, 0.05).unwrap();
        assert_eq!(best(&evaluations[..2]), Some(0));
        let test = evaluations[0].auc_pr_test(&evaluations[2], definition, &resampling).unwrap();
        let is_best = best(&[evaluations[0].clone(), evaluations[2].clone()]).is_some();
        assert_eq!(is_best, test.p_value <= 0.05, "{}", test.p_value);
        assert_eq!(best(&[evaluations[0].clone(), evaluations[0].clone()]), None);
    }

    /// With the default number of resamples no corrected p-value of fifteen methods is below .1.
    #[test]
    fn many_methods_are_resampled_often_enough() {
        let n = 60;
        let confidence = vec![0.0; n];
        let share = |it: usize| if it == 0 { 10 } else { 1 };
        let judged: Vec<_> = (0..15)
            .map(|it| Judged::from_flags(right(share(it), n), vec![true; n]).unwrap())
            .collect();
        let evaluations: Vec<_> =
            judged.iter().map(|it| Evaluation::of_confidence(&confidence, it).unwrap()).collect();
        let best =
            best_by_auc_pr(&evaluations, Definition::Corrected, &Resampling::default(), 0.05);
        assert_eq!(best.unwrap(), Some(0));
    }
}
