//! Softmax attention, head by head and some queries at a time.

use faer::{Accum, MatMut, MatRef, Par, linalg::matmul::matmul};
use pulp::Arch;
use rayon::prelude::*;

use super::{ROWS_PER_TASK, exp_of_negative, sum};

/// Queries whose scores are held at a time: they stay in the second cache.
const QUERIES: usize = 64;

/// Sizes of a self-attention.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Heads {
    /// Sequences that do not see each other.
    pub(crate) batch: usize,
    /// Tokens of each.
    pub(crate) tokens: usize,
    /// Heads.
    pub(crate) count: usize,
    /// Channels of a head.
    pub(crate) size: usize,
}

/// softmax(Q Kᵀ / √size) V of every head.
///
/// `qkv` has a row per token: queries, keys and values of all heads beside each other, without the
/// `bias` of as many values. The result has a row of `count · size` values per token.
pub(crate) fn attend(qkv: &[f32], bias: &[f32], heads: Heads) -> Vec<f32> {
    let Heads { batch, tokens, count, size } = heads;
    let mut by_head = vec![0.0; batch * count * tokens * size];
    by_head.par_chunks_exact_mut(tokens * size).enumerate().for_each_init(
        || Scratch::new(heads),
        |scratch, (index, out)| {
            let (sequence, head) = (index / count, index % count);
            let rows = &qkv[sequence * tokens * 3 * count * size..][..tokens * 3 * count * size];
            Arch::new().dispatch(
                #[inline(always)]
                || scratch.load(rows, bias, head, heads),
            );
            scratch.attend(out, heads);
        },
    );
    joined(&by_head, heads)
}

/// From a block per head to a row per token.
fn joined(by_head: &[f32], heads: Heads) -> Vec<f32> {
    let Heads { tokens, count, size, .. } = heads;
    let mut rows = vec![0.0; by_head.len()];
    rows.par_chunks_mut(count * size * ROWS_PER_TASK).enumerate().for_each(|(chunk, rows)| {
        for (at, row) in rows.chunks_exact_mut(count * size).enumerate() {
            let token = chunk * ROWS_PER_TASK + at;
            let (sequence, token) = (token / tokens, token % tokens);
            for (head, out) in row.chunks_exact_mut(size).enumerate() {
                let from = ((sequence * count + head) * tokens + token) * size;
                out.copy_from_slice(&by_head[from..from + size]);
            }
        }
    });
    rows
}

/// One head's queries, keys and values, and scores of some queries.
struct Scratch {
    queries: Vec<f32>,
    keys: Vec<f32>,
    values: Vec<f32>,
    scores: Vec<f32>,
}

impl Scratch {
    fn new(heads: Heads) -> Self {
        let zeros = || vec![0.0; heads.tokens * heads.size];
        let scores = vec![0.0; QUERIES * heads.tokens];
        Self { queries: zeros(), keys: zeros(), values: zeros(), scores }
    }

    /// Gathers one head, adds the bias, and scales the queries.
    #[inline(always)]
    fn load(&mut self, rows: &[f32], bias: &[f32], head: usize, heads: Heads) {
        let Heads { count, size, .. } = heads;
        let scale = 1.0 / (size as f32).sqrt();
        let parts = [(&mut self.queries, scale), (&mut self.keys, 1.0), (&mut self.values, 1.0)];
        for (part, (target, scale)) in parts.into_iter().enumerate() {
            let first = (part * count + head) * size;
            let bias = &bias[first..first + size];
            for (target, row) in
                target.chunks_exact_mut(size).zip(rows.chunks_exact(3 * count * size))
            {
                for ((target, x), bias) in
                    target.iter_mut().zip(&row[first..first + size]).zip(bias)
                {
                    *target = (x + bias) * scale;
                }
            }
        }
    }

    fn attend(&mut self, out: &mut [f32], heads: Heads) {
        let Heads { tokens, size, .. } = heads;
        let keys = MatRef::from_row_major_slice(&self.keys[..], tokens, size).transpose();
        let values = MatRef::from_row_major_slice(&self.values[..], tokens, size);
        let blocks = out.chunks_mut(QUERIES * size).zip(self.queries.chunks(QUERIES * size));
        for (out, queries) in blocks {
            let n = queries.len() / size;
            let scores = &mut self.scores[..n * tokens];
            let queries = MatRef::from_row_major_slice(queries, n, size);
            let product = MatMut::from_row_major_slice_mut(&mut *scores, n, tokens);
            matmul(product, Accum::Replace, queries, keys, 1.0, Par::Seq);
            let mut totals = [0.0; QUERIES];
            Arch::new().dispatch(
                #[inline(always)]
                || exponentials(scores, tokens, &mut totals),
            );
            let weights = MatRef::from_row_major_slice(&*scores, n, tokens);
            let product = MatMut::from_row_major_slice_mut(&mut *out, n, size);
            matmul(product, Accum::Replace, weights, values, 1.0, Par::Seq);
            for (row, total) in out.chunks_exact_mut(size).zip(totals) {
                for x in row {
                    *x /= total;
                }
            }
        }
    }
}

/// Replaces each row's scores by e^(score − largest); writes the sum of each row.
#[inline(always)]
fn exponentials(scores: &mut [f32], tokens: usize, totals: &mut [f32; QUERIES]) {
    for (row, total) in scores.chunks_exact_mut(tokens).zip(totals) {
        let largest = largest(row);
        for score in row.iter_mut() {
            *score = exp_of_negative(*score - largest);
        }
        *total = sum(row, |x| x);
    }
}

#[inline(always)]
fn largest(values: &[f32]) -> f32 {
    let (chunks, rest) = values.as_chunks::<{ super::LANES }>();
    let mut lanes = [f32::NEG_INFINITY; super::LANES];
    for chunk in chunks {
        for (lane, &value) in lanes.iter_mut().zip(chunk) {
            *lane = if value > *lane { value } else { *lane };
        }
    }
    lanes.iter().chain(rest).copied().fold(f32::NEG_INFINITY, f32::max)
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, Distribution, Tensor, module};

    use super::*;

    #[test]
    fn attention_is_that_of_burn() {
        let device = Device::flex();
        device.seed(5);
        let (batch, tokens, count, size) = (2, 97, 3, 8);
        let qkv = Tensor::<3>::random(
            [batch, tokens, 3 * count * size],
            Distribution::Normal(0.0, 2.0),
            &device,
        );
        let bias = Tensor::<1>::random([3 * count * size], Distribution::Default, &device);
        let vector = |x: burn::tensor::TensorData| x.try_to_vec::<f32>().unwrap();
        let heads = Heads { batch, tokens, count, size };
        let ours =
            attend(&vector(qkv.clone().into_data()), &vector(bias.clone().into_data()), heads);

        let split = (qkv + bias.unsqueeze()).reshape([batch, tokens, 3 * count, size]);
        let part = |i: usize| split.clone().narrow(2, i * count, count).swap_dims(1, 2);
        let theirs = module::attention(
            part(0),
            part(1),
            part(2),
            None,
            None,
            burn::tensor::ops::AttentionModuleOptions::default(),
        );
        let theirs =
            vector(theirs.swap_dims(1, 2).reshape([batch, tokens, count * size]).into_data());
        for (a, b) in ours.iter().zip(theirs) {
            approx::assert_abs_diff_eq!(*a, b, epsilon = 1e-5);
        }
    }
}
