//! Seconds per query, apart from retrieval.

use std::time::{Duration, Instant};

use vpr_study::verification::Verifier;

use super::subject::Labelled;
use crate::{EstimatorChoice, EstimatorSettings, Result, corpus::Corpus, net::Learned};

/// How long an estimator is repeated at least.
const WINDOW: Duration = Duration::from_millis(50);
/// Pairs that are verified.
const PAIRS: usize = 5;

/// Milliseconds per query of an estimator on one thread, the batch being the whole corpus.
pub(super) fn efficient(opened: &Labelled, choice: EstimatorChoice) -> Result<f64> {
    let settings = EstimatorSettings::default();
    let prepared = choice.prepare(&settings, Some(&opened.corpus.poses))?;
    per_query(opened.corpus.judged.len(), || prepared.estimate(&opened.corpus.retrieval))
}

/// Milliseconds per query from a network's variances to its uncertainties, on one thread; the
/// variances come with the descriptors.
pub(super) fn predicted(corpus: &Corpus, learned: Learned) -> Result<f64> {
    per_query(corpus.judged.len(), || corpus.variance(learned))
}

fn per_query(n_queries: usize, mut estimate: impl FnMut() -> Result<Vec<f64>>) -> Result<f64> {
    let (start, mut rounds) = (Instant::now(), 0_u32);
    while start.elapsed() < WINDOW {
        std::hint::black_box(estimate()?);
        rounds += 1;
    }
    Ok(1e3 * start.elapsed().as_secs_f64() / (f64::from(rounds) * n_queries as f64))
}

/// Milliseconds to verify one pair on one thread, features of both images included; the median of
/// a few. `None` without images.
pub(super) fn verification(opened: &Labelled, verifier: &Verifier) -> Result<Option<f64>> {
    let Some((queries, references)) = &opened.corpus.images else { return Ok(None) };
    let best = opened.corpus.retrieval.best();
    let mut times = Vec::new();
    for (query, &reference) in queries.iter().zip(&best).take(PAIRS) {
        let start = Instant::now();
        verifier.verify(&verifier.detect(query)?, &verifier.detect(&references[reference])?)?;
        times.push(1e3 * start.elapsed().as_secs_f64());
    }
    times.sort_unstable_by(f64::total_cmp);
    Ok(times.get(times.len() / 2).copied())
}
