//! Layer normalisation, and the scaled residual before it.

use super::{for_rows, sum};

/// Scale and shift after a normalisation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Affine<'a> {
    pub(crate) gamma: &'a [f32],
    pub(crate) beta: &'a [f32],
    pub(crate) epsilon: f32,
}

/// Normalises rows of `gamma.len()` values to mean 0 and variance 1, then scales and shifts them.
pub(crate) fn layer_norm(x: &[f32], affine: Affine<'_>) -> Vec<f32> {
    let width = affine.gamma.len();
    let mut normed = vec![0.0; x.len()];
    for_rows(
        &mut normed,
        width,
        #[inline(always)]
        |first, rows| {
            let source = x[first * width..].chunks_exact(width);
            for (row, x) in rows.chunks_exact_mut(width).zip(source) {
                let mean = sum(x, |x| x) / width as f32;
                let variance = sum(x, |x| (x - mean) * (x - mean)) / width as f32;
                let scale = 1.0 / (variance + affine.epsilon).sqrt();
                let affine = affine.gamma.iter().zip(affine.beta);
                for ((normed, x), (gamma, beta)) in row.iter_mut().zip(x).zip(affine) {
                    *normed = (x - mean) * scale * gamma + beta;
                }
            }
        },
    );
    normed
}

/// `x ← x + scale · (y + bias)`, rows of `bias.len()` values.
pub(crate) fn add_scaled_in_place(x: &mut [f32], y: &[f32], bias: &[f32], scale: &[f32]) {
    let width = bias.len();
    for_rows(
        x,
        width,
        #[inline(always)]
        |first, rows| {
            let source = y[first * width..].chunks_exact(width);
            for (row, y) in rows.chunks_exact_mut(width).zip(source) {
                for ((x, y), (bias, scale)) in row.iter_mut().zip(y).zip(bias.iter().zip(scale)) {
                    *x += scale * (y + bias);
                }
            }
        },
    );
}

/// `x ← x + row`, rows of `row.len()` values.
pub(crate) fn add_row(x: &mut [f32], row: &[f32]) {
    for_rows(
        x,
        row.len(),
        #[inline(always)]
        |_, rows| {
            for x in rows.chunks_exact_mut(row.len()) {
                x.iter_mut().zip(row).for_each(|(x, value)| *x += value);
            }
        },
    );
}
