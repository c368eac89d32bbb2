//! Scores of all queries against one block of rows: a matrix product, or a pass per query.

use faer::{Accum, MatMut, MatRef, Par, linalg::matmul::matmul};
use pulp::Arch;

use super::{
    Metric,
    margin::{Margin, SAFE_SQUARED_NORM, norm_bound},
    metric::squared_norm,
    single::{Sum, sums},
};

/// Batches below this are scored query by query; a matrix product gains nothing for them.
const PRODUCT_FROM: usize = 4;

/// Queries with what their margins need.
pub(super) struct Batch<'a> {
    metric: Metric,
    dim: usize,
    values: &'a [f32],
    norms: Vec<f64>,
}

impl<'a> Batch<'a> {
    pub(super) fn new(metric: Metric, values: &'a [f32], dim: usize, len: usize) -> Self {
        let norms = (0..len).map(|i| squared_norm(&values[i * dim..(i + 1) * dim]).sqrt());
        Self { metric, dim, values, norms: norms.collect() }
    }

    pub(super) fn len(&self) -> usize {
        self.norms.len()
    }

    pub(super) fn query(&self, index: usize) -> &'a [f32] {
        &self.values[index * self.dim..(index + 1) * self.dim]
    }

    pub(super) fn metric(&self) -> Metric {
        self.metric
    }
}

/// Working memory of one thread.
pub(super) struct Scorer {
    arch: Arch,
    scores: Vec<f32>,
    squared_norms: Vec<f32>,
}

impl Scorer {
    pub(super) fn new() -> Self {
        Self { arch: Arch::new(), scores: Vec::new(), squared_norms: Vec::new() }
    }

    /// Calls `visit` with the index of each query, its scores against the `n_rows` of the block,
    /// and their margin.
    pub(super) fn score<E>(
        &mut self,
        batch: &Batch<'_>,
        block: &[f32],
        n_rows: usize,
        visit: impl FnMut(usize, &[f32], Margin) -> Result<(), E>,
    ) -> Result<(), E> {
        self.squared_norms.resize(n_rows, 0.0);
        if batch.metric == Metric::Manhattan || batch.len() < PRODUCT_FROM || batch.dim == 0 {
            self.query_by_query(batch, block, n_rows, visit)
        } else {
            self.all_at_once(batch, block, n_rows, visit)
        }
    }

    fn query_by_query<E>(
        &mut self,
        batch: &Batch<'_>,
        block: &[f32],
        n_rows: usize,
        mut visit: impl FnMut(usize, &[f32], Margin) -> Result<(), E>,
    ) -> Result<(), E> {
        self.scores.resize(n_rows, 0.0);
        let sum = match batch.metric {
            Metric::Euclidean => Sum::SquaredDifference,
            Metric::Manhattan => Sum::AbsoluteDifference,
            Metric::Cosine | Metric::InnerProduct => Sum::Product,
        };
        for index in 0..batch.len() {
            let (scores, norms) = (&mut self.scores, &mut self.squared_norms);
            sums(self.arch, sum, batch.query(index), block, scores, norms);
            let margin = match batch.metric {
                Metric::Euclidean | Metric::Manhattan => Margin::direct(batch.dim),
                Metric::InnerProduct => {
                    for score in &mut *scores {
                        *score = -*score;
                    }
                    Margin::product(batch.dim, batch.norms[index], largest_norm(batch.dim, norms))
                }
                Metric::Cosine => {
                    for (score, &norm) in scores.iter_mut().zip(&*norms) {
                        *score = -*score * weight(norm);
                    }
                    Margin::cosine(batch.dim, batch.norms[index])
                }
            };
            visit(index, scores, margin)?;
        }
        Ok(())
    }

    fn all_at_once<E>(
        &mut self,
        batch: &Batch<'_>,
        block: &[f32],
        n_rows: usize,
        mut visit: impl FnMut(usize, &[f32], Margin) -> Result<(), E>,
    ) -> Result<(), E> {
        let (dim, n_queries) = (batch.dim, batch.len());
        self.scores.resize(n_rows * n_queries, 0.0);
        let factor = if batch.metric == Metric::Euclidean { -2.0 } else { -1.0 };
        matmul(
            MatMut::from_column_major_slice_mut(&mut self.scores, n_rows, n_queries),
            Accum::Replace,
            MatRef::from_row_major_slice(block, n_rows, dim),
            MatRef::from_column_major_slice(batch.values, dim, n_queries),
            factor,
            Par::Seq,
        );
        let norms = &mut self.squared_norms;
        sums(self.arch, Sum::SquaredNorm, batch.query(0), block, &mut [], norms);
        let largest = largest_norm(dim, norms);
        if batch.metric == Metric::Cosine {
            for norm in &mut *norms {
                *norm = weight(*norm);
            }
        }
        for (index, scores) in self.scores.chunks_exact_mut(n_rows).enumerate() {
            let query_norm = batch.norms[index];
            let margin = match batch.metric {
                Metric::Cosine => {
                    scores.iter_mut().zip(&*norms).for_each(|(score, weight)| *score *= weight);
                    Margin::cosine(dim, query_norm)
                }
                Metric::Euclidean => {
                    scores.iter_mut().zip(&*norms).for_each(|(score, norm)| *score += norm);
                    Margin::expanded(dim, query_norm, largest)
                }
                _ => Margin::product(dim, query_norm, largest),
            };
            visit(index, scores, margin)?;
        }
        Ok(())
    }
}

/// 1/‖x‖, or NaN (which makes its row a candidate) if the squared norm is not safe to divide by.
fn weight(squared_norm: f32) -> f32 {
    if SAFE_SQUARED_NORM.contains(&squared_norm) { squared_norm.sqrt().recip() } else { f32::NAN }
}

fn largest_norm(dim: usize, squared_norms: &[f32]) -> f64 {
    // `f32::max` would skip a NaN.
    let larger = |a: f32, b: f32| if a >= b || a.is_nan() { a } else { b };
    norm_bound(dim, squared_norms.iter().copied().fold(0.0, larger))
}
