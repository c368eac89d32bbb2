//! Exact search against the slow obvious version: the same indices, the same bits.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a test fails by panicking and says what it skips"
)]

use std::{ops::Range, sync::Mutex};

use ndarray::{Array2, s};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vpr_core::{
    Descriptors, Error, Result, Retrieval,
    knn::{Metric, RowSource, SearchParams, search},
};

const METRICS: [Metric; 4] =
    [Metric::Euclidean, Metric::Cosine, Metric::InnerProduct, Metric::Manhattan];

/// Every distance in f64, one term after the other, then one sort.
#[expect(clippy::cast_possible_truncation, reason = "distances are f32")]
fn obvious(references: &Descriptors, queries: &Descriptors, metric: Metric, k: usize) -> Retrieval {
    let ranked: Vec<Vec<(f64, usize)>> = (0..queries.len())
        .map(|query| {
            let query = queries.row(query).to_vec();
            let mut all: Vec<(f64, usize)> = (0..references.len())
                .map(|index| (plain(&query, &references.row(index).to_vec(), metric), index))
                .collect();
            all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            all
        })
        .collect();
    let shape = (queries.len(), k.min(references.len()));
    Retrieval::new(
        Array2::from_shape_fn(shape, |(query, rank)| ranked[query][rank].1),
        Array2::from_shape_fn(shape, |(query, rank)| ranked[query][rank].0 as f32),
    )
    .unwrap()
}

/// The definition of the metric.
fn plain(query: &[f32], reference: &[f32], metric: Metric) -> f64 {
    let pairs = || query.iter().zip(reference).map(|(&q, &x)| (f64::from(q), f64::from(x)));
    let product: f64 = pairs().map(|(q, x)| q * x).sum();
    match metric {
        Metric::Euclidean => pairs().map(|(q, x)| (q - x).powi(2)).sum::<f64>().sqrt(),
        Metric::Manhattan => pairs().map(|(q, x)| (q - x).abs()).sum(),
        Metric::InnerProduct => 0.0 - product,
        Metric::Cosine => {
            let (q, x) = pairs().fold((0.0, 0.0), |(a, b), (q, x)| (a + q * q, b + x * x));
            if q * x > 0.0 { (1.0 - product / (q * x).sqrt()).clamp(0.0, 2.0) } else { 1.0 }
        }
    }
}

/// The routine that ranks, applied to everything: with k = n no candidate can be dropped.
fn rescored(
    references: &Descriptors,
    queries: &Descriptors,
    metric: Metric,
    k: usize,
) -> Retrieval {
    let everything = SearchParams { metric, k: references.len(), ..SearchParams::default() };
    let all = search(references, queries, &everything).unwrap();
    let shape = (queries.len(), k.min(references.len()));
    Retrieval::new(
        Array2::from_shape_fn(shape, |(query, rank)| all.indices(query)[rank]),
        Array2::from_shape_fn(shape, |(query, rank)| all.distances(query)[rank]),
    )
    .unwrap()
}

fn on_threads<T: Send>(n_threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap().install(work)
}

fn random(
    rng: &mut ChaCha8Rng,
    n_rows: usize,
    dim: usize,
    value: impl Fn(&mut ChaCha8Rng) -> f32,
) -> Descriptors {
    Descriptors::new(Array2::from_shape_simple_fn((n_rows, dim), || value(rng))).unwrap()
}

fn uniform(rng: &mut ChaCha8Rng) -> f32 {
    rng.random_range(-1.0..1.0)
}

/// A source that decodes: every block is copied to the scratch.
struct Copied(Descriptors);

impl RowSource for Copied {
    fn len(&self) -> usize {
        self.0.len()
    }

    fn dim(&self) -> usize {
        self.0.dim()
    }

    fn block<'a>(&'a self, rows: Range<usize>, scratch: &'a mut Vec<f32>) -> Result<&'a [f32]> {
        let dim = self.0.dim();
        scratch.clear();
        scratch.extend_from_slice(&self.0.as_slice()[rows.start * dim..rows.end * dim]);
        Ok(scratch)
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Small integers: many exact ties and duplicated rows, and every sum is exact.
    #[test]
    fn agrees_with_the_obvious_version_on_heavy_ties(
        n_rows in 1_usize..300, n_queries in 1_usize..9, dim in 1_usize..40, k in 1_usize..400,
        spread in 0_i8..4, seed: u64,
    ) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let value = |rng: &mut ChaCha8Rng| f32::from(rng.random_range(-spread..=spread));
        let references = random(&mut rng, n_rows, dim, value);
        let queries = random(&mut rng, n_queries, dim, value);
        for metric in METRICS {
            let params = SearchParams { metric, k, block_rows: Some(20) };
            let found = search(&references, &queries, &params).unwrap();
            prop_assert_eq!(&found, &obvious(&references, &queries, metric, k), "{:?}", metric);
        }
    }

    /// Values from 1e-25 to 1e15: overflow and underflow in the fast kernels.
    #[test]
    fn agrees_on_huge_and_tiny_norms(
        n_rows in 1_usize..200, n_queries in 1_usize..7, dim in 1_usize..40, k in 1_usize..9,
        per_row: bool, seed: u64,
    ) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let value = |rng: &mut ChaCha8Rng| {
            10_f32.powf(rng.random_range(-25.0_f32..15.0)) * uniform(rng)
        };
        let mut rows = |n: usize| {
            if !per_row {
                return random(&mut rng, n, dim, value);
            }
            let mut rows = random(&mut rng, n, dim, uniform).into_inner();
            rows.outer_iter_mut().for_each(|mut row| row *= value(&mut rng));
            Descriptors::new(rows).unwrap()
        };
        let (references, queries) = (rows(n_rows), rows(n_queries));
        for metric in METRICS {
            let params = SearchParams { metric, k, block_rows: Some(30) };
            let found = search(&references, &queries, &params).unwrap();
            prop_assert_eq!(&found, &rescored(&references, &queries, metric, k), "{:?}", metric);
        }
    }

    /// Rows that differ by a few units in the last place around a common offset: f32 sums cannot
    /// tell them apart.
    #[test]
    fn agrees_on_differences_below_the_rounding_error(
        n_rows in 2_usize..400, n_queries in 1_usize..9, dim in 1_usize..60, k in 1_usize..20,
        offset in prop::sample::select(vec![0.0_f32, 1.0, 300.0, 1e6]), seed: u64,
    ) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let base: Vec<f32> = (0..dim).map(|_| offset + rng.random_range(0.5_f32..1.0)).collect();
        let mut near = |n: usize| {
            let mut nudged = |column: usize| {
                f32::from_bits(base[column].to_bits() + rng.random_range(0..3_u32))
            };
            Descriptors::new(Array2::from_shape_fn((n, dim), |(_, column)| nudged(column))).unwrap()
        };
        let (references, queries) = (near(n_rows), near(n_queries));
        for metric in METRICS {
            let params = SearchParams { metric, k, block_rows: Some(70) };
            let found = search(&references, &queries, &params).unwrap();
            prop_assert_eq!(&found, &rescored(&references, &queries, metric, k), "{:?}", metric);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20))]

    #[test]
    fn same_bits_for_any_threads_batch_block_and_source(
        n_rows in 1_usize..600, dim in 1_usize..50, k in 1_usize..30, seed: u64,
    ) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let references = random(&mut rng, n_rows, dim, uniform);
        let queries = random(&mut rng, 9, dim, uniform);
        let copied = Copied(references.clone());
        for metric in METRICS {
            let expected = rescored(&references, &queries, metric, k);
            for n_threads in [1, 2, 8] {
                for block_rows in [Some(1), Some(7), Some(100), None] {
                    let params = SearchParams { metric, k, block_rows };
                    let found = on_threads(n_threads, || search(&references, &queries, &params));
                    prop_assert_eq!(&found.unwrap(), &expected);
                    let found = on_threads(n_threads, || search(&copied, &queries, &params));
                    prop_assert_eq!(&found.unwrap(), &expected);
                }
            }
            let params = SearchParams { metric, k, ..SearchParams::default() };
            for query in 0..queries.len() {
                let one = queries.view().slice(s![query..=query, ..]).to_owned();
                let found = search(&references, &Descriptors::new(one).unwrap(), &params).unwrap();
                prop_assert_eq!(found.indices(0), expected.indices(query));
                prop_assert_eq!(found.distances(0), expected.distances(query));
            }
        }
    }
}

#[test]
fn agrees_with_the_obvious_version_on_unit_descriptors() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let references = random(&mut rng, 5000, 96, uniform).normalized();
    let queries = random(&mut rng, 30, 96, uniform).normalized();
    for metric in METRICS {
        let params = SearchParams { metric, k: 10, ..SearchParams::default() };
        let found = search(&references, &queries, &params).unwrap();
        let expected = obvious(&references, &queries, metric, 10);
        for query in 0..queries.len() {
            assert_eq!(found.indices(query), expected.indices(query), "{metric:?}");
            for (a, b) in found.distances(query).iter().zip(expected.distances(query)) {
                assert!((a - b).abs() <= 2.0 * f32::EPSILON * b.abs(), "{metric:?}: {a} {b}");
            }
        }
    }
}

/// A source that likes to be read in pieces of its own, and remembers what was asked for.
struct Pieces {
    rows: Descriptors,
    length: usize,
    asked: Mutex<Vec<Range<usize>>>,
}

impl RowSource for Pieces {
    fn len(&self) -> usize {
        self.rows.len()
    }

    fn dim(&self) -> usize {
        self.rows.dim()
    }

    fn piece_end(&self, start: usize, _wanted: usize) -> usize {
        (start / self.length + 1) * self.length
    }

    fn block<'a>(&'a self, rows: Range<usize>, scratch: &'a mut Vec<f32>) -> Result<&'a [f32]> {
        if rows.len() > 1 {
            self.asked.lock().unwrap().push(rows.clone());
        }
        self.rows.block(rows, scratch)
    }
}

#[test]
fn every_piece_of_a_source_is_asked_for_once() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let (rows, queries) = (random(&mut rng, 1000, 16, uniform), random(&mut rng, 6, 16, uniform));
    for (length, block_rows) in [(7, 64), (64, 7), (300, 64), (5000, 10)] {
        let params = SearchParams { block_rows: Some(block_rows), ..SearchParams::default() };
        let pieces = Pieces { rows: rows.clone(), length, asked: Mutex::default() };
        let found = on_threads(2, || search(&pieces, &queries, &params)).unwrap();
        assert_eq!(found, search(&rows, &queries, &params).unwrap());
        let mut asked = pieces.asked.into_inner().unwrap();
        asked.sort_unstable_by_key(|range| range.start);
        let expected: Vec<Range<usize>> =
            (0..1000).step_by(length).map(|start| start..(start + length).min(1000)).collect();
        assert_eq!(asked, expected);
    }
}

/// A source that is damaged from one row on: it says so, or delivers NaN.
struct Damaged {
    rows: Descriptors,
    from: usize,
    silently: bool,
}

impl RowSource for Damaged {
    fn len(&self) -> usize {
        self.rows.len()
    }

    fn dim(&self) -> usize {
        self.rows.dim()
    }

    fn block<'a>(&'a self, rows: Range<usize>, scratch: &'a mut Vec<f32>) -> Result<&'a [f32]> {
        let dim = self.dim();
        if rows.end <= self.from {
            return self.rows.block(rows, scratch);
        }
        if !self.silently {
            let row = rows.start.max(self.from);
            return Err(Error::format("map", format!("row {row}"), "digest differs"));
        }
        scratch.clear();
        scratch.extend_from_slice(&self.rows.as_slice()[rows.start * dim..rows.end * dim]);
        for row in self.from.max(rows.start)..rows.end {
            scratch[(row - rows.start) * dim] = f32::NAN;
        }
        Ok(scratch)
    }
}

#[test]
fn the_earliest_damage_is_reported_on_any_number_of_threads() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let rows = Damaged { rows: random(&mut rng, 2000, 16, uniform), from: 700, silently: false };
    let queries = random(&mut rng, 5, 16, uniform);
    let params = SearchParams { block_rows: Some(10), ..SearchParams::default() };
    for n_threads in [1, 2, 8] {
        let err = on_threads(n_threads, || search(&rows, &queries, &params)).unwrap_err();
        assert_eq!(err.to_string(), "map: row 700: digest differs");
    }
}

#[test]
fn a_nan_that_a_source_delivers_is_never_ranked() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let rows = Damaged { rows: random(&mut rng, 500, 16, uniform), from: 499, silently: true };
    for n_queries in [1, 6] {
        let queries = random(&mut rng, n_queries, 16, uniform);
        for metric in METRICS {
            let params = SearchParams { metric, k: 3, ..SearchParams::default() };
            let err = search(&rows, &queries, &params).unwrap_err();
            assert!(matches!(err, Error::NotFinite { column: 499, .. }), "{metric:?}: {err}");
        }
    }
}

#[test]
fn nothing_to_find_and_wrong_dimensions_are_errors() {
    let descriptors = Descriptors::new(Array2::zeros((3, 4))).unwrap();
    let none = Descriptors::new(Array2::zeros((0, 4))).unwrap();
    let other = Descriptors::new(Array2::zeros((3, 5))).unwrap();
    let params = SearchParams::default();
    assert!(matches!(search(&none, &descriptors, &params), Err(Error::Empty(_))));
    let zero = SearchParams { k: 0, ..params };
    assert!(matches!(search(&descriptors, &descriptors, &zero), Err(Error::Empty(_))));
    assert!(matches!(search(&descriptors, &other, &params), Err(Error::Mismatch { .. })));
    assert_eq!(search(&descriptors, &none, &params).unwrap().len(), 0);
}
