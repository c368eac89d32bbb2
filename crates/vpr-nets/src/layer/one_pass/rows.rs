//! Sums over rows and planes, in an order that neither the processor nor the threads decide.

use super::{Affine, for_rows, sum};

/// Brings runs of `width` values to mean 0 and variance 1. A run is `parts` channels beside each
/// other, each then scaled and shifted; the channels of `affine` repeat over all runs.
pub(crate) fn standardize(x: &[f32], width: usize, parts: usize, affine: Affine<'_>) -> Vec<f32> {
    let mut result = vec![0.0; x.len()];
    let plane = width / parts;
    for_rows(
        &mut result,
        width,
        #[inline(always)]
        |first, runs| {
            let source = x[first * width..].chunks_exact(width);
            for (index, (run, x)) in runs.chunks_exact_mut(width).zip(source).enumerate() {
                let mean = sum(x, |x| x) / width as f32;
                let variance = sum(x, |x| (x - mean) * (x - mean)) / width as f32;
                let deviation = (variance + affine.epsilon).sqrt();
                let planes = run.chunks_exact_mut(plane).zip(x.chunks_exact(plane));
                for (part, (run, x)) in planes.enumerate() {
                    let channel = ((first + index) * parts + part) % affine.gamma.len();
                    let (gamma, beta) = (affine.gamma[channel], affine.beta[channel]);
                    for (result, x) in run.iter_mut().zip(x) {
                        *result = (x - mean) / deviation * gamma + beta;
                    }
                }
            }
        },
    );
    result
}

/// Rows times `weight`, whose rows have `bias.len()` values, plus `bias`; terms are added in order.
pub(crate) fn affine_map(x: &[f32], weight: &[f32], bias: &[f32]) -> Vec<f32> {
    let (to, from) = (bias.len(), weight.len() / bias.len());
    let mut result = vec![0.0; x.len() / from * to];
    for_rows(
        &mut result,
        to,
        #[inline(always)]
        |first, rows| {
            let source = x[first * from..].chunks_exact(from);
            for (row, x) in rows.chunks_exact_mut(to).zip(source) {
                row.copy_from_slice(bias);
                for (x, weights) in x.iter().zip(weight.chunks_exact(to)) {
                    for (sum, weight) in row.iter_mut().zip(weights) {
                        *sum += x * weight;
                    }
                }
            }
        },
    );
    result
}

/// Divides rows by their lengths, √(Σ x² + `floor`).
pub(crate) fn unit(x: &[f32], width: usize, floor: f32) -> Vec<f32> {
    let mut result = vec![0.0; x.len()];
    for_rows(
        &mut result,
        width,
        #[inline(always)]
        |first, rows| {
            let source = x[first * width..].chunks_exact(width);
            for (row, x) in rows.chunks_exact_mut(width).zip(source) {
                let length = (sum(x, |x| x * x) + floor).sqrt();
                for (result, x) in row.iter_mut().zip(x) {
                    *result = x / length;
                }
            }
        },
    );
    result
}
