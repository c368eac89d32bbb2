//! The nearest of a few references, for many queries: the words of a vocabulary.

use rayon::prelude::*;

use super::{
    Metric,
    block::{Batch, Scorer},
    exact::dropped,
    margin::Margin,
};
use crate::{Descriptors, Error, Result};

/// Queries that are scored at once: their scores against a few hundred references stay in the cache.
const QUERIES_AT_ONCE: usize = 256;

/// Index of the reference nearest to every query in Euclidean distance, ties by lower index.
///
/// What [`search`](super::search) finds with `k` = 1, to the bit, without a list per query: all
/// references are scored at once, so they should be few. Only where rounding could tell two of them
/// apart wrongly does the slow routine decide.
///
/// # Errors
///
/// [`Error::Mismatch`] if the two sets have different dimensions, [`Error::Empty`] if there is no
/// reference.
pub fn nearest(references: &Descriptors, queries: &Descriptors) -> Result<Vec<usize>> {
    let dim = references.dim();
    if queries.dim() != dim {
        return Err(Error::Mismatch {
            what: "dimension of the query descriptors",
            expected: dim,
            actual: queries.dim(),
        });
    }
    if references.is_empty() {
        return Err(Error::Empty("references to retrieve"));
    }
    if dim == 0 {
        return Ok(vec![0; queries.len()]);
    }
    let parts: Vec<Vec<usize>> = queries
        .as_slice()
        .par_chunks(QUERIES_AT_ONCE * dim)
        .map_init(Scorer::new, |scorer, values| {
            let batch = Batch::new(Metric::Euclidean, values, dim, values.len() / dim);
            let mut found = Vec::with_capacity(batch.len());
            scorer.score(
                &batch,
                references.as_slice(),
                references.len(),
                |query, scores, margin| {
                    found.push(first_of_nearest(references, batch.query(query), scores, margin));
                    Ok::<_, Error>(())
                },
            )?;
            Ok(found)
        })
        .collect::<Result<_>>()?;
    Ok(parts.concat())
}

/// The nearest reference by scores and their margin; the key decides between those too close to tell.
fn first_of_nearest(
    references: &Descriptors,
    query: &[f32],
    scores: &[f32],
    margin: Margin,
) -> usize {
    let cutoff = margin.cutoff(margin.upper(lowest(scores)));
    let mut left = scores.iter().enumerate().filter(|&(_, &score)| !dropped(score, cutoff));
    let (first, _) = left.next().expect("the lowest score is not above its cutoff");
    let dim = query.len();
    let key = |index: usize| {
        Metric::Euclidean.key(query, &references.as_slice()[index * dim..(index + 1) * dim])
    };
    let mut best: Option<(f64, usize)> = None;
    for (index, _) in left {
        let (nearest, at) = best.unwrap_or_else(|| (key(first), first));
        let other = key(index);
        best = Some(if other < nearest { (other, index) } else { (nearest, at) });
    }
    best.map_or(first, |(_, index)| index)
}

/// The lowest score; what is not a number is not lower than anything.
fn lowest(scores: &[f32]) -> f32 {
    let lower = |a: f32, b: f32| if b < a { b } else { a };
    let (chunks, rest) = scores.as_chunks::<16>();
    let mut lanes = [f32::INFINITY; 16];
    for chunk in chunks {
        for (lane, &score) in lanes.iter_mut().zip(chunk) {
            *lane = lower(*lane, score);
        }
    }
    lanes.iter().chain(rest).copied().fold(f32::INFINITY, lower)
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;
    use proptest::prelude::*;

    use super::*;
    use crate::retrieve;

    fn descriptors(rows: usize, dim: usize, value: impl Fn(usize) -> f32) -> Descriptors {
        let rows = Array2::from_shape_fn((rows, dim), |(row, column)| value(row * dim + column));
        Descriptors::new(rows).unwrap()
    }

    #[test]
    fn what_does_not_fit_is_an_error_and_no_dimension_is_a_tie() {
        let (two, three) = (descriptors(4, 2, |_| 0.0), descriptors(4, 3, |_| 0.0));
        assert!(matches!(nearest(&two, &three), Err(Error::Mismatch { .. })));
        assert!(matches!(nearest(&descriptors(0, 2, |_| 0.0), &two), Err(Error::Empty(_))));
        let none = descriptors(3, 0, |_| 0.0);
        assert_eq!(nearest(&none, &none).unwrap(), [0, 0, 0]);
    }

    #[test]
    fn values_whose_scores_overflow_are_told_apart() {
        let references = descriptors(5, 2, |at| if at == 6 { 1e30 } else { 3e30 });
        let queries = descriptors(6, 2, |_| 2.5e30);
        let expected = retrieve(&queries, &references, 1).unwrap().best();
        assert_eq!(nearest(&references, &queries).unwrap(), expected);
    }

    proptest! {
        /// Small numbers give many ties; numbers beside a large offset, near-ties that f32 loses.
        #[test]
        fn is_what_search_finds(
            n_references in 1_usize..70,
            n_queries in 0_usize..600,
            dim in 1_usize..9,
            offset in prop::sample::select(vec![0.0_f32, 1000.0]),
            seed in 0_usize..1000,
        ) {
            let value = |salt: usize| move |at: usize| {
                let drawn = (at + salt + seed).wrapping_mul(2_654_435_761) >> 7;
                offset + f32::from(u8::try_from(drawn % 5).unwrap()) / 3.0
            };
            let references = descriptors(n_references, dim, value(0));
            let queries = descriptors(n_queries, dim, value(77));
            let expected = retrieve(&queries, &references, 1).unwrap().best();
            prop_assert_eq!(nearest(&references, &queries).unwrap(), expected);
        }
    }
}
