//! Position embeddings resampled to another grid, as the official code does.
//!
//! Bicubic interpolation is separable and linear: rows and columns each are one small matrix,
//! so resampling is two matrix products, and gradients pass through.

use burn::tensor::{Device, Tensor, TensorData};

/// How the official code resamples position embeddings (`interpolate_pos_encoding`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interpolation {
    /// Added to the number of patches before the scale is computed: 0.1 for the models without
    /// registers, where the scale and not the size is given to the interpolation; 0 with registers.
    pub offset: f64,
    /// Whether the kernel widens when shrinking (models with registers).
    pub antialias: bool,
}

impl Interpolation {
    /// Models without registers: offset 0.1, no antialiasing.
    pub const PLAIN: Self = Self { offset: 0.1, antialias: false };
    /// Models with registers: offset 0, antialiasing.
    pub const REGISTERS: Self = Self { offset: 0.0, antialias: true };
}

/// Resamples `embeddings` (1 × side² × dim) to 1 × rows·columns × dim.
pub(super) fn resample(
    embeddings: Tensor<3>,
    [rows, columns]: [usize; 2],
    how: Interpolation,
) -> Tensor<3> {
    let [_, count, dim] = embeddings.dims();
    let side = count.isqrt();
    let device = embeddings.device();
    // (rows × side) · (side × side·dim), then per row (columns × side) · (side × dim).
    let down = matrix(rows, side, how, &device).matmul(embeddings.reshape([side, side * dim]));
    let across = matrix(columns, side, how, &device).unsqueeze_dim::<3>(0);
    across.matmul(down.reshape([rows, side, dim])).reshape([1, rows * columns, dim])
}

fn matrix(to: usize, from: usize, how: Interpolation, device: &Device) -> Tensor<2> {
    let scale = if how.offset == 0.0 {
        from as f32 / to as f32
    } else {
        narrow(1.0 / ((to as f64 + how.offset) / from as f64))
    };
    let weights = if how.antialias {
        antialiased_weights(to, from, scale)
    } else {
        cubic_weights(to, from, scale)
    };
    Tensor::from_data(TensorData::new(weights, [to, from]), device)
}

/// Weights of torch's bicubic interpolation without antialiasing (a = −0.75, border repeated).
fn cubic_weights(to: usize, from: usize, scale: f32) -> Vec<f32> {
    let mut weights = vec![0.0; to * from];
    for (target, row) in weights.chunks_exact_mut(from).enumerate() {
        let source = scale * (target as f32 + 0.5) - 0.5;
        let first = source.floor();
        let fraction = source - first;
        for (tap, weight) in [fraction + 1.0, fraction, 1.0 - fraction, 2.0 - fraction]
            .map(|x| kernel(x, -0.75))
            .iter()
            .enumerate()
        {
            row[index(first + tap as f32 - 1.0, from - 1)] += weight;
        }
    }
    weights
}

/// Weights of torch's bicubic interpolation with antialiasing (a = −0.5, sums to one inside).
fn antialiased_weights(to: usize, from: usize, scale: f32) -> Vec<f32> {
    let widening = scale.max(1.0);
    let support = 2.0 * widening;
    let mut weights = vec![0.0; to * from];
    for (target, row) in weights.chunks_exact_mut(from).enumerate() {
        let center = scale * (target as f32 + 0.5);
        let (first, end) =
            (index(center - support + 0.5, from), index(center + support + 0.5, from));
        for (at, weight) in row.iter_mut().enumerate().take(end).skip(first) {
            *weight = kernel((at as f32 - center + 0.5).abs() / widening, -0.5);
        }
        let total: f32 = row.iter().sum();
        for weight in row {
            *weight /= total;
        }
    }
    weights
}

/// The whole part of a place, within 0 and `last`.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "kept in range")]
fn index(place: f32, last: usize) -> usize {
    (place.max(0.0) as usize).min(last)
}

#[expect(clippy::cast_possible_truncation, reason = "torch computes weights in f32")]
fn narrow(scale: f64) -> f32 {
    scale as f32
}

/// Keys' cubic convolution kernel at distance `x` ≥ 0.
fn kernel(x: f32, a: f32) -> f32 {
    if x < 1.0 {
        ((a + 2.0) * x - (a + 3.0)) * x * x + 1.0
    } else if x < 2.0 {
        ((a * x - 5.0 * a) * x + 8.0 * a) * x - 4.0 * a
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_of_weights_sums_to_one() {
        for how in [Interpolation::PLAIN, Interpolation::REGISTERS] {
            for (to, from) in [(7, 37), (37, 37), (53, 37), (1, 37), (23, 16)] {
                let data = matrix(to, from, how, &Device::flex()).into_data();
                for row in data.try_to_vec::<f32>().unwrap().chunks_exact(from) {
                    approx::assert_abs_diff_eq!(row.iter().sum::<f32>(), 1.0, epsilon = 1e-5);
                }
            }
        }
    }

    #[test]
    fn the_same_size_without_offset_changes_nothing() {
        for weights in [cubic_weights(5, 5, 1.0), antialiased_weights(5, 5, 1.0)] {
            for (index, weight) in weights.iter().enumerate() {
                assert_eq!(*weight, if index % 6 == 0 { 1.0 } else { 0.0 });
            }
        }
    }
}
