//! Softmax attention, head by head and 16 queries at a time.
#![expect(
    clippy::inline_always,
    reason = "only what is inlined into the dispatch is compiled for its registers"
)]

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use super::multiply::{DEPTH_BLOCK, Lanes, TILE, Tile, dispatch, multiply};
use crate::layer::one_pass::exp_of_negative;

/// Rows that one thread copies at a time.
const ROWS_PER_TASK: usize = 32;

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
            dispatch(Head { rows, bias, index: head, heads, scratch, out });
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

/// One head's factors, packed, and the weights of 16 queries. What fills up is zero.
struct Scratch {
    /// `[16 tokens][channel]`.
    queries: Vec<Lanes>,
    /// `[16 tokens][channel]`.
    keys: Vec<Lanes>,
    /// `[16 channels][token]`.
    values: Vec<Lanes>,
    /// A row per key, a lane per query.
    weights: Vec<Tile>,
    /// A row per query, by 16 channels.
    sums: Vec<Tile>,
}

impl Scratch {
    fn new(Heads { tokens, size, .. }: Heads) -> Self {
        let (groups, panels) = (tokens.div_ceil(TILE), size.div_ceil(TILE));
        let lanes = |n| vec![[0.0; TILE]; n];
        let tiles = |n| vec![[[0.0; TILE]; TILE]; n];
        Self {
            queries: lanes(groups * size),
            keys: lanes(groups * size),
            values: lanes(panels * tokens),
            weights: tiles(groups),
            sums: tiles(panels),
        }
    }
}

/// One head of one sequence.
struct Head<'a> {
    /// Queries, keys and values of the sequence.
    rows: &'a [f32],
    bias: &'a [f32],
    index: usize,
    heads: Heads,
    scratch: &'a mut Scratch,
    out: &'a mut [f32],
}

impl WithSimd for Head<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        self.load();
        let Heads { tokens, size, .. } = self.heads;
        let Scratch { queries, keys, values, weights, sums } = self.scratch;
        for (queries, out) in queries.chunks_exact(size).zip(self.out.chunks_mut(TILE * size)) {
            for (keys, weights) in keys.chunks_exact(size).zip(weights.iter_mut()) {
                multiply(simd, keys, queries, weights, true);
            }
            let weights = &mut weights.as_flattened_mut()[..tokens];
            let totals = exponentials(weights);
            for start in (0..tokens).step_by(DEPTH_BLOCK) {
                let weights = &weights[start..(start + DEPTH_BLOCK).min(tokens)];
                for (values, sums) in values.chunks_exact(tokens).zip(sums.iter_mut()) {
                    let values = &values[start..][..weights.len()];
                    multiply(simd, weights, values, sums, start == 0);
                }
            }
            for (query, out) in out.chunks_exact_mut(size).enumerate() {
                for (sums, out) in sums.iter().zip(out.chunks_mut(TILE)) {
                    for (out, sum) in out.iter_mut().zip(&sums[query]) {
                        *out = sum / totals[query];
                    }
                }
            }
        }
    }
}

impl Head<'_> {
    /// Packs the head, adds the bias, and scales the queries.
    #[inline(always)]
    fn load(&mut self) {
        let Heads { tokens, count, size, .. } = self.heads;
        let scale = 1.0 / (size as f32).sqrt();
        let [queries, keys, values] =
            [0, 1, 2].map(|part| (part * count + self.index) * size).map(|at| at..at + size);
        let rows = self.rows.chunks_exact(3 * count * size);
        for (token, row) in rows.enumerate() {
            let first = token / TILE * size;
            let lane = token % TILE;
            for channel in 0..size {
                let query = row[queries.start + channel] + self.bias[queries.start + channel];
                let key = row[keys.start + channel] + self.bias[keys.start + channel];
                self.scratch.queries[first + channel][lane] = query * scale;
                self.scratch.keys[first + channel][lane] = key;
            }
            let bias = self.bias[values.clone()].chunks(TILE);
            for (panel, (row, bias)) in row[values.clone()].chunks(TILE).zip(bias).enumerate() {
                let lanes = &mut self.scratch.values[panel * tokens + token];
                for (lane, (x, bias)) in lanes.iter_mut().zip(row.iter().zip(bias)) {
                    *lane = x + bias;
                }
            }
        }
    }
}

/// Replaces scores by e^(score − largest), lane by lane; the sum of each lane.
#[inline(always)]
fn exponentials(scores: &mut [Lanes]) -> Lanes {
    let mut largest = [f32::NEG_INFINITY; TILE];
    for scores in scores.iter() {
        for lane in 0..TILE {
            largest[lane] = if scores[lane] > largest[lane] { scores[lane] } else { largest[lane] };
        }
    }
    let mut totals = [0.0; TILE];
    for scores in scores {
        for lane in 0..TILE {
            scores[lane] = exp_of_negative(scores[lane] - largest[lane]);
        }
        for lane in 0..TILE {
            totals[lane] += scores[lane];
        }
    }
    totals
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
