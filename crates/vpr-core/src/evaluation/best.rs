//! Whether one of several methods on the same queries is better than every other.

use std::ops::Range;

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
    let areas = |resamples: Range<usize>| {
        let drawn = resamples.into_par_iter().map(|resample| {
            let queries = draw(n_queries, resampling.seed, resample);
            methods.iter().map(|it| defined(it.resampled(&queries, definition))).collect()
        });
        drawn.collect::<Result<Vec<Vec<Option<f64>>>>>()
    };
    let mut drawn = areas(0..FEW.min(n_resamples))?;
    // Mostly there is a method that the best is far from being told from, and few draws say so.
    let Some(best) = highest(&values) else { return Ok(None) };
    let mut others = (0..methods.len()).filter(|it| *it != best);
    if others.any(|other| p_value(&drawn, best, other) > FAR * level) {
        return Ok(None);
    }
    drawn.extend(areas(FEW.min(n_resamples)..n_resamples)?);
    told_apart(&values, level, |a, b| Ok(p_value(&drawn, a, b)))
}

/// Draws that come first. A method whose p-value is at most `level` after all of them has one above
/// [`FAR`] · `level` after these in one of a billion cases, at a level of .05.
const FEW: usize = 400;
const FAR: f64 = 4.0;

/// Of the difference of two methods, by their areas in every draw.
fn p_value(drawn: &[Vec<Option<f64>>], a: usize, b: usize) -> f64 {
    let pairs = drawn.iter().filter_map(|areas| Some(areas[a]? - areas[b]?));
    let differences: Vec<f64> = pairs.collect();
    let is_known = 2 * differences.len() >= drawn.len();
    if is_known { share_beyond_zero(&differences) } else { 1.0 }
}

/// The first of the highest, of at least two.
fn highest(values: &[f64]) -> Option<usize> {
    let higher = |best: usize, it: usize| if values[it] > values[best] { it } else { best };
    (0..values.len()).reduce(higher).filter(|_| values.len() > 1)
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
    // Of equal ones the first, which no test will tell from the others.
    let Some(best) = highest(values) else { return Ok(None) };
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
