//! A bias and GELU in one pass.

use super::{exp_of_negative, for_rows};

/// GELU of `x + bias`, rows of `bias.len()` values; GELU is x Φ(x), by the error function.
pub(crate) fn gelu(x: &[f32], bias: &[f32]) -> Vec<f32> {
    let width = bias.len();
    let mut result = vec![0.0; x.len()];
    for_rows(
        &mut result,
        width,
        #[inline(always)]
        |first, rows| {
            let source = x[first * width..].chunks_exact(width);
            for (row, x) in rows.chunks_exact_mut(width).zip(source) {
                for ((result, x), bias) in row.iter_mut().zip(x).zip(bias) {
                    *result = of(x + bias);
                }
            }
        },
    );
    result
}

/// What a gradient of GELU's result is for its argument: times Φ(x) + x φ(x).
pub(crate) fn gelu_gradient(x: &[f32], gradient: &[f32], width: usize) -> Vec<f32> {
    let mut result = vec![0.0; x.len()];
    for_rows(
        &mut result,
        width,
        #[inline(always)]
        |first, rows| {
            let source = x[first * width..].iter().zip(&gradient[first * width..]);
            for (result, (&x, gradient)) in rows.iter_mut().zip(source) {
                *result = gradient * slope(x);
            }
        },
    );
    result
}

/// x Φ(x) to 1.5e-7 |x|.
#[inline(always)]
fn of(x: f32) -> f32 {
    x.max(0.0) - x.abs() * tail(x)
}

/// Φ(x) + x φ(x).
#[inline(always)]
fn slope(x: f32) -> f32 {
    const DENSITY: f32 = 0.398_942_3;
    let tail = tail(x);
    let below = if x < 0.0 { tail } else { 1.0 - tail };
    below + x * DENSITY * exp_of_negative(-0.5 * x * x)
}

/// Φ(−|x|), with the error function of Abramowitz and Stegun (1964), 7.1.26.
#[inline(always)]
fn tail(x: f32) -> f32 {
    const P: f32 = 0.327_591_1;
    const A: [f32; 5] = [0.254_829_6, -0.284_496_72, 1.421_413_8, -1.453_152_1, 1.061_405_4];
    let z = x.abs() * std::f32::consts::FRAC_1_SQRT_2;
    let t = 1.0 / (1.0 + P * z);
    let series = t * (A[0] + t * (A[1] + t * (A[2] + t * (A[3] + t * A[4]))));
    0.5 * series * exp_of_negative(-z * z)
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, Tensor, activation};

    use super::*;

    #[test]
    fn gelu_is_that_of_burn() {
        let values: Vec<f32> = (-12_000..12_000).map(|step| step as f32 * 1e-3).collect();
        let tensor = Tensor::<1>::from_floats(values.as_slice(), &Device::flex());
        let exact = activation::gelu(tensor).into_data().try_to_vec::<f32>().unwrap();
        for (x, exact) in values.iter().zip(exact) {
            assert!((of(*x) - exact).abs() <= 4e-7 * x.abs().max(0.1), "gelu({x})");
        }
    }
}
