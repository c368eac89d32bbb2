//! Scores of one query against the rows of a block, at the speed at which memory delivers them.

#![expect(clippy::inline_always, reason = "only inlined code is compiled for the dispatched SIMD")]

use pulp::{Arch, Simd, WithSimd};

/// Which sum is formed over the values of the query and of a row.
#[derive(Clone, Copy, Debug)]
pub(super) enum Sum {
    /// Σ (qᵢ − xᵢ)²
    SquaredDifference,
    /// Σ |qᵢ − xᵢ|
    AbsoluteDifference,
    /// Σ qᵢ xᵢ, and Σ xᵢ² with it
    Product,
    /// Σ xᵢ² alone
    SquaredNorm,
}

/// The sum of every row of `block`, `sums.len()` rows of the length of `query`; the squared norms
/// are written by [`Sum::Product`] and [`Sum::SquaredNorm`] only.
pub(super) fn sums(
    arch: Arch,
    sum: Sum,
    query: &[f32],
    block: &[f32],
    sums: &mut [f32],
    squared_norms: &mut [f32],
) {
    if query.is_empty() {
        sums.fill(0.0);
        squared_norms.fill(0.0);
        return;
    }
    arch.dispatch(Rows { sum, query, block, sums, squared_norms });
}

struct Rows<'a> {
    sum: Sum,
    query: &'a [f32],
    block: &'a [f32],
    sums: &'a mut [f32],
    squared_norms: &'a mut [f32],
}

impl WithSimd for Rows<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let rows = self.block.chunks_exact(self.query.len());
        match self.sum {
            Sum::SquaredDifference => {
                for (row, out) in rows.zip(self.sums) {
                    *out = fold(simd, self.query, row, |acc, q, x| {
                        let difference = simd.sub_f32s(q, x);
                        simd.mul_add_f32s(difference, difference, acc)
                    });
                }
            }
            Sum::AbsoluteDifference => {
                for (row, out) in rows.zip(self.sums) {
                    *out = fold(simd, self.query, row, |acc, q, x| {
                        simd.add_f32s(acc, simd.abs_f32s(simd.sub_f32s(q, x)))
                    });
                }
            }
            Sum::SquaredNorm => {
                for (row, out) in rows.zip(self.squared_norms) {
                    *out = fold(simd, row, row, |acc, x, _| simd.mul_add_f32s(x, x, acc));
                }
            }
            Sum::Product => {
                for ((row, out), norm) in rows.zip(self.sums).zip(self.squared_norms) {
                    (*out, *norm) = product_and_norm(simd, self.query, row);
                }
            }
        }
    }
}

/// Adds up a term of two equally long slices in four independent vectors.
#[inline(always)]
fn fold<S: Simd>(
    simd: S,
    query: &[f32],
    row: &[f32],
    term: impl Fn(S::f32s, S::f32s, S::f32s) -> S::f32s,
) -> f32 {
    let mut acc = [simd.splat_f32s(0.0); 4];
    let ((q_body, q_tail), (x_body, x_tail)) = (S::as_simd_f32s(query), S::as_simd_f32s(row));
    let ((q_fours, q_rest), (x_fours, x_rest)) = (q_body.as_chunks::<4>(), x_body.as_chunks::<4>());
    for (q, x) in q_fours.iter().zip(x_fours) {
        acc[0] = term(acc[0], q[0], x[0]);
        acc[1] = term(acc[1], q[1], x[1]);
        acc[2] = term(acc[2], q[2], x[2]);
        acc[3] = term(acc[3], q[3], x[3]);
    }
    for (&q, &x) in q_rest.iter().zip(x_rest) {
        acc[0] = term(acc[0], q, x);
    }
    let (q, x) = (simd.partial_load_f32s(q_tail), simd.partial_load_f32s(x_tail));
    acc[1] = term(acc[1], q, x);
    reduce(simd, acc)
}

/// Σ qᵢ xᵢ and Σ xᵢ² in one pass over the row.
#[inline(always)]
fn product_and_norm<S: Simd>(simd: S, query: &[f32], row: &[f32]) -> (f32, f32) {
    let mut product = [simd.splat_f32s(0.0); 4];
    let mut norm = product;
    let ((q_body, q_tail), (x_body, x_tail)) = (S::as_simd_f32s(query), S::as_simd_f32s(row));
    let ((q_fours, q_rest), (x_fours, x_rest)) = (q_body.as_chunks::<4>(), x_body.as_chunks::<4>());
    for (q, x) in q_fours.iter().zip(x_fours) {
        for lane in 0..4 {
            product[lane] = simd.mul_add_f32s(q[lane], x[lane], product[lane]);
            norm[lane] = simd.mul_add_f32s(x[lane], x[lane], norm[lane]);
        }
    }
    let tail = (simd.partial_load_f32s(q_tail), simd.partial_load_f32s(x_tail));
    for (q, x) in q_rest.iter().copied().zip(x_rest.iter().copied()).chain([tail]) {
        product[0] = simd.mul_add_f32s(q, x, product[0]);
        norm[0] = simd.mul_add_f32s(x, x, norm[0]);
    }
    (reduce(simd, product), reduce(simd, norm))
}

#[inline(always)]
fn reduce<S: Simd>(simd: S, [a, b, c, d]: [S::f32s; 4]) -> f32 {
    simd.reduce_sum_f32s(simd.add_f32s(simd.add_f32s(a, b), simd.add_f32s(c, d)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_length_is_summed_to_its_end() {
        for dim in 0..130_u8 {
            let query: Vec<f32> = (0..dim).map(|i| f32::from(i % 7) - 3.0).collect();
            let block: Vec<f32> = query.iter().map(|q| q + 2.0).chain(query.clone()).collect();
            let expected = |term: fn(f32, f32) -> f32| -> Vec<f32> {
                let rows = [&block[..dim.into()], &block[dim.into()..]];
                rows.map(|row| query.iter().zip(row).map(|(&q, &x)| term(q, x)).sum()).to_vec()
            };
            let mut found = (vec![0.0; 2], vec![0.0; 2]);
            let mut run = |sum| sums(Arch::new(), sum, &query, &block, &mut found.0, &mut found.1);
            run(Sum::SquaredDifference);
            assert_eq!(found.0, expected(|q, x| (q - x) * (q - x)), "dim {dim}");
            let mut run = |sum| sums(Arch::new(), sum, &query, &block, &mut found.0, &mut found.1);
            run(Sum::AbsoluteDifference);
            assert_eq!(found.0, expected(|q, x| (q - x).abs()), "dim {dim}");
            let mut run = |sum| sums(Arch::new(), sum, &query, &block, &mut found.0, &mut found.1);
            run(Sum::Product);
            assert_eq!(found, (expected(|q, x| q * x), expected(|_, x| x * x)), "dim {dim}");
        }
    }
}
