//! Exact search: fast scores choose the candidates, one slow routine orders them.

use std::ops::Range;
use std::sync::{
    Mutex,
    atomic::{AtomicBool, Ordering},
};

use ndarray::Array2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    Metric, RowSource,
    block::{Batch, Scorer},
    margin::Margin,
    row,
    shortlist::{Candidate, Shortlist},
};
use crate::{Descriptors, Error, Result, Retrieval};

/// What is searched for, and in which steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SearchParams {
    /// How descriptors are compared.
    pub metric: Metric,
    /// How many references are wanted for every query.
    pub k: usize,
    /// References that a thread reads at a time; `None` chooses by dimension. Changes the time, not
    /// the result.
    pub block_rows: Option<usize>,
}

impl Default for SearchParams {
    fn default() -> Self {
        Self { metric: Metric::Euclidean, k: 10, block_rows: None }
    }
}

/// Queries that share one pass over the references; bounds the memory for scores and candidates.
const QUERIES_PER_PASS: usize = 1024;

/// Target size of a block.
const BLOCK_BYTES: usize = 128 << 10;

/// Finds the `k` references nearest to every query, exactly.
///
/// Gives fewer than `k` columns if there are fewer references. Ties break by lower index. The
/// result has the same bits for every number of threads, size of the batch, size of the blocks and
/// kind of source: a fast kernel in f32 drops only references that a proven bound of its rounding
/// errors excludes, and [`Metric::distance`] (f64, one order of summation) ranks the rest. Data with
/// so many near-ties that the bound excludes little are searched at the speed of that routine.
///
/// The references are read once for each 1024 queries, from the start to the end; what a source
/// checks when it is first touched is checked on the way.
///
/// # Errors
///
/// [`Error::Mismatch`] if queries and references have different dimensions, [`Error::Empty`] if
/// there is no reference or `k` is zero, [`Error::NotFinite`] if a distance overflows f32 or a
/// source delivers values that are not finite, and those of [`RowSource::block`].
pub fn search(
    rows: &(impl RowSource + ?Sized),
    queries: &Descriptors,
    params: &SearchParams,
) -> Result<Retrieval> {
    if queries.dim() != rows.dim() {
        return Err(Error::Mismatch {
            what: "dimension of the query descriptors",
            expected: rows.dim(),
            actual: queries.dim(),
        });
    }
    let k = params.k.min(rows.len());
    if k == 0 {
        return Err(Error::Empty("references to retrieve"));
    }
    let mut ranked = Vec::with_capacity(queries.len());
    for start in (0..queries.len()).step_by(QUERIES_PER_PASS) {
        let len = QUERIES_PER_PASS.min(queries.len() - start);
        let values = &queries.as_slice()[start * queries.dim()..(start + len) * queries.dim()];
        let batch = Batch::new(params.metric, values, queries.dim(), len);
        ranked.extend(pass(rows, &batch, k, params.block_rows)?);
    }
    let shape = (queries.len(), k);
    Retrieval::new(
        Array2::from_shape_fn(shape, |(query, rank)| ranked[query][rank].1),
        Array2::from_shape_fn(shape, |(query, rank)| {
            params.metric.distance_of_key(ranked[query][rank].0)
        }),
    )
}

/// One pass over the references: key and index of the k nearest of every query.
fn pass(
    rows: &(impl RowSource + ?Sized),
    batch: &Batch<'_>,
    k: usize,
    block_rows: Option<usize>,
) -> Result<Vec<Vec<(f64, usize)>>> {
    let n_threads = rayon::current_num_threads();
    let blocks = Blocks::new(rows.len(), rows.dim(), block_rows, n_threads);
    let workers: Vec<Worker> = (0..n_threads.min(blocks.count()))
        .into_par_iter()
        .with_max_len(1)
        .map(|_| Worker::run(rows, batch, k, &blocks))
        .collect();
    blocks.finish()?;
    let mut workers = workers.into_iter().map(|worker| worker.shortlists);
    let mut shortlists = workers.next().unwrap_or_default();
    for other in workers {
        shortlists.iter_mut().zip(other).for_each(|(list, other)| list.merge(other));
    }
    let finish = |scratch: &mut Vec<f32>, (query, list): (usize, Shortlist)| {
        list.finish(|index| key(rows, batch, query, index, scratch))
    };
    shortlists.into_par_iter().enumerate().map_init(Vec::new, finish).collect()
}

/// The key of one reference, from its row.
fn key(
    rows: &(impl RowSource + ?Sized),
    batch: &Batch<'_>,
    query: usize,
    index: usize,
    scratch: &mut Vec<f32>,
) -> Result<f64> {
    let key = batch.metric().key(batch.query(query), row(rows, index, scratch)?);
    if key.is_finite() {
        return Ok(key);
    }
    Err(Error::NotFinite { what: "distance to a reference", row: query, column: index, value: key })
}

/// The references of a pass, handed out in order, and the first thing that went wrong.
struct Blocks {
    n_rows: usize,
    /// Rows that are scored at once, and asked for at once where the source does not mind.
    rows_per_block: usize,
    next: Mutex<usize>,
    stopped: AtomicBool,
    failures: Mutex<Vec<(usize, Error)>>,
}

impl Blocks {
    fn new(n_rows: usize, dim: usize, wanted: Option<usize>, n_threads: usize) -> Self {
        // Measured: the matrix product likes panels of 16 rows and more, and a block should stay
        // in the cache next to the queries.
        let fitting = (BLOCK_BYTES / (size_of::<f32>() * dim.max(1))).clamp(16, 4096);
        // Few references: smaller blocks, so that every thread gets some.
        let shared = n_rows.div_ceil(4 * n_threads).next_multiple_of(64);
        let rows_per_block = wanted.unwrap_or(fitting.min(shared)).max(1);
        let (next, stopped) = (Mutex::new(0), AtomicBool::new(false));
        Self { n_rows, rows_per_block, next, stopped, failures: Mutex::new(Vec::new()) }
    }

    fn count(&self) -> usize {
        self.n_rows.div_ceil(self.rows_per_block)
    }

    /// The next piece: one block, or as many rows as the source reads or checks together.
    fn take(&self, rows: &(impl RowSource + ?Sized)) -> Option<Range<usize>> {
        if self.stopped.load(Ordering::Relaxed) {
            return None;
        }
        let mut next = self.next.lock().expect("no worker panics while it takes a piece");
        let start = *next;
        if start >= self.n_rows {
            return None;
        }
        *next = rows.piece_end(start, self.rows_per_block).clamp(start + 1, self.n_rows);
        Some(start..*next)
    }

    fn fail(&self, start: usize, error: Error) {
        self.stopped.store(true, Ordering::Relaxed);
        self.failures.lock().expect("no worker panics while it reports").push((start, error));
    }

    /// The failure of the earliest block: blocks are taken in order and finished once taken, so
    /// it is the same one in every run.
    fn finish(self) -> Result<()> {
        let failures = self.failures.into_inner().expect("no worker panics while it reports");
        match failures.into_iter().min_by_key(|(start, _)| *start) {
            None => Ok(()),
            Some((_, error)) => Err(error),
        }
    }
}

/// One thread: its working memory and what it found.
struct Worker {
    scorer: Scorer,
    scratch: Vec<f32>,
    row: Vec<f32>,
    shortlists: Vec<Shortlist>,
}

impl Worker {
    fn run(rows: &(impl RowSource + ?Sized), batch: &Batch<'_>, k: usize, blocks: &Blocks) -> Self {
        let shortlists = vec![Shortlist::new(k); batch.len()];
        let mut worker =
            Self { scorer: Scorer::new(), scratch: Vec::new(), row: Vec::new(), shortlists };
        while let Some(range) = blocks.take(rows) {
            let start = range.start;
            if let Err(error) = worker.scan(rows, batch, range, blocks.rows_per_block) {
                blocks.fail(start, error);
            }
        }
        worker
    }

    fn scan(
        &mut self,
        rows: &(impl RowSource + ?Sized),
        batch: &Batch<'_>,
        range: Range<usize>,
        rows_per_block: usize,
    ) -> Result<()> {
        let piece = rows.block(range.clone(), &mut self.scratch)?;
        let Self { scorer, row, shortlists, .. } = self;
        for start in range.clone().step_by(rows_per_block) {
            let end = (start + rows_per_block).min(range.end);
            let values = (start - range.start) * rows.dim()..(end - range.start) * rows.dim();
            scorer.score(batch, &piece[values], end - start, |query, scores, margin| {
                let list = &mut shortlists[query];
                offer(list, scores, margin, start);
                list.prune(|index| key(rows, batch, query, index, row))
            })?;
        }
        Ok(())
    }
}

/// Offers the rows from `start` on whose scores do not exclude them.
fn offer(list: &mut Shortlist, scores: &[f32], margin: Margin, start: usize) {
    let cutoff = margin.cutoff(list.threshold());
    for (run, first) in scores.chunks(RUN).zip((start..).step_by(RUN)) {
        if run.iter().fold(true, |all, &score| all & dropped(score, cutoff)) {
            continue;
        }
        for (&score, index) in run.iter().zip(first..) {
            if !dropped(score, cutoff) {
                let (lower, upper) = (margin.lower(score), margin.upper(score));
                list.offer(Candidate { lower, upper, index });
            }
        }
    }
}

/// Scores that are compared with the cutoff at once.
const RUN: usize = 64;

/// Whether a score is finite and above the cutoff.
#[inline]
pub(super) fn dropped(score: f32, cutoff: f32) -> bool {
    score > cutoff && score < f32::INFINITY
}
