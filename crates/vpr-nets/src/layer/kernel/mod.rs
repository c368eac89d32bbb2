//! Convolution, products of rows and attention on the CPU, over slices, on one inner product
//! ([`multiply`]). Ours, because burn-flex lowers on one thread, multiplies with other kernels and
//! stores, normalises and activates in separate passes (`docs/performance.md`).

mod attention;
mod direct;
mod finish;
mod geometry;
mod lower;
mod multiply;
mod product;
mod weights_gradient;
mod winograd;

use std::sync::OnceLock;

pub(crate) use attention::{Heads, attend};
pub use finish::Activation;
pub(crate) use finish::Finish;
pub(crate) use geometry::Geometry;
use multiply::Packed;
pub(crate) use product::{product, product_by_columns, product_by_rows};
pub(crate) use weights_gradient::weights_gradient;

/// Weights of one group of a convolution, packed when first needed.
#[derive(Debug, Default)]
pub(crate) struct Weights {
    direct: OnceLock<Packed>,
    winograd: OnceLock<winograd::Frequencies>,
}

impl Weights {
    /// Convolves `input` (`[images, channels, height, width]`) with the weights `[n_out, channels,
    /// kernel]`, which must be the same at every call. The output is `[images, n_out, pixels]`.
    ///
    /// The geometry's kernel must fit into the padded input.
    pub(crate) fn convolve(
        &self,
        input: &[f32],
        weights: &[f32],
        geometry: &Geometry,
        output: [usize; 2],
        finish: Finish<'_>,
    ) -> Vec<f32> {
        let n_out = geometry.n_out;
        if winograd::suits(geometry, output) {
            let new = || winograd::Frequencies::new(weights, n_out, geometry.input[1]);
            winograd::convolve(input, self.winograd.get_or_init(new), geometry, output, finish)
        } else {
            let new = || Packed::new(weights, geometry.depth());
            direct::convolve(input, self.direct.get_or_init(new), geometry, output, finish)
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The definition, in f64.
    fn slow(input: &[f32], weights: &[f32], geometry: &Geometry, output: [usize; 2]) -> Vec<f64> {
        let [n_images, n_channels, height, width] = geometry.input;
        let mut values = Vec::new();
        for image in 0..n_images {
            for out in 0..geometry.n_out {
                for pixel in 0..output[0] * output[1] {
                    let mut sum = 0.0;
                    for at in 0..geometry.depth() {
                        let [kh, kw] = geometry.kernel;
                        let (channel, ky, kx) = (at / (kh * kw), at / kw % kh, at % kw);
                        let y = pixel / output[1] * geometry.stride[0] + ky * geometry.dilation[0];
                        let x = pixel % output[1] * geometry.stride[1] + kx * geometry.dilation[1];
                        let y = y.checked_sub(geometry.before[0]).filter(|&it| it < height);
                        let x = x.checked_sub(geometry.before[1]).filter(|&it| it < width);
                        if let Some((y, x)) = y.zip(x) {
                            let value =
                                input[((image * n_channels + channel) * height + y) * width + x];
                            sum +=
                                f64::from(value) * f64::from(weights[out * geometry.depth() + at]);
                        }
                    }
                    values.push(sum);
                }
            }
        }
        values
    }

    pub(super) fn noise(n: usize, seed: u32) -> Vec<f32> {
        let mut state = seed.wrapping_mul(2_654_435_761).wrapping_add(12345);
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f32::from(u16::try_from(state >> 16).unwrap_or(0)) / 32768.0 - 1.0
        };
        (0..n).map(|_| next()).collect()
    }

    /// ‖ours − exact‖ / ‖exact‖.
    fn relative_error(geometry: &Geometry, seed: u32) -> f64 {
        let output = geometry.output().unwrap();
        let input = noise(geometry.input.iter().product(), seed);
        let weights = noise(geometry.n_out * geometry.depth(), seed + 1);
        let finish =
            Finish { scale: None, shift: None, residual: None, activation: Activation::None };
        let fast = Weights::default().convolve(&input, &weights, geometry, output, finish);
        let slow = slow(&input, &weights, geometry, output);
        assert_eq!(fast.len(), slow.len());
        let square = |values: &mut dyn Iterator<Item = f64>| values.map(|it| it * it).sum::<f64>();
        let error = square(&mut fast.iter().zip(&slow).map(|(&a, b)| f64::from(a) - b));
        (error / square(&mut slow.iter().copied()).max(f64::MIN_POSITIVE)).sqrt()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn equals_the_definition(
            (n, c, k) in (1usize..3, 1usize..20, 1usize..36),
            (h, w) in (1usize..20, 1usize..20),
            kernel in prop::array::uniform2(1usize..5),
            stride in prop::array::uniform2(1usize..4),
            dilation in prop::array::uniform2(1usize..3),
            before in prop::array::uniform2(0usize..4),
            after in prop::array::uniform2(0usize..4),
            seed in 0u32..1000,
        ) {
            let input = [n, c, h, w];
            let geometry = Geometry { input, n_out: k, kernel, stride, before, after, dilation };
            prop_assume!(geometry.output().is_some());
            prop_assert!(relative_error(&geometry, seed) < 1e-5);
        }

        #[test]
        fn winograd_equals_the_definition(
            (n, c, k) in (1usize..4, 16usize..40, 16usize..40),
            (h, w) in (3usize..30, 3usize..30),
            before in prop::array::uniform2(0usize..3),
            after in prop::array::uniform2(0usize..3),
            seed in 0u32..1000,
        ) {
            let geometry = Geometry {
                input: [n, c, h, w], n_out: k, kernel: [3, 3], stride: [1, 1], before, after,
                dilation: [1, 1],
            };
            prop_assert!(relative_error(&geometry, seed) < 1e-5);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn a_product_equals_the_definition(
            (n, depth, width) in (1usize..40, 1usize..600, 1usize..90),
            seed in 0u32..1000,
        ) {
            let (rows, matrix) = (noise(n * depth, seed), noise(depth * width, seed + 1));
            let fast = product(&rows, &matrix, depth);
            prop_assert_eq!(fast.len(), n * width);
            let transposed = |matrix: &[f32], width: usize| -> Vec<f32> {
                let columns = (0..width).map(|at| matrix.iter().skip(at).step_by(width));
                columns.flatten().copied().collect()
            };
            let by_rows = product_by_rows(&rows, &transposed(&matrix, width), depth);
            prop_assert_eq!(&by_rows, &fast);
            let by_columns = product_by_columns(&transposed(&rows, depth), &matrix, depth);
            prop_assert_eq!(&by_columns, &fast);
            for (index, &fast) in fast.iter().enumerate() {
                let row = &rows[index / width * depth..][..depth];
                let column = matrix.iter().skip(index % width).step_by(width);
                let exact: f64 =
                    row.iter().zip(column).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum();
                prop_assert!((f64::from(fast) - exact).abs() < 1e-4, "{index}");
            }
        }
    }

    #[test]
    fn deep_sums_and_large_batches_equal_the_definition() {
        let geometry = Geometry {
            input: [5, 300, 9, 10],
            n_out: 70,
            kernel: [3, 3],
            stride: [1, 1],
            before: [1, 1],
            after: [1, 1],
            dilation: [1, 1],
        };
        assert!(winograd::suits(&geometry, [9, 10]));
        assert!(relative_error(&geometry, 7) < 1e-5);
        let strided = Geometry { stride: [2, 2], ..geometry };
        assert!(relative_error(&strided, 8) < 1e-5);
    }

    #[test]
    fn the_finish_scales_shifts_adds_and_activates() {
        for (n_channels, activation) in [
            (2, Activation::Relu),
            (2, Activation::Relu6),
            (24, Activation::Relu),
            (24, Activation::Relu6),
        ] {
            let geometry = Geometry {
                input: [2, n_channels, 8, 9],
                n_out: 20,
                kernel: [3, 3],
                stride: [1, 1],
                before: [1, 1],
                after: [1, 1],
                dilation: [1, 1],
            };
            assert_eq!(winograd::suits(&geometry, [8, 9]), n_channels == 24);
            let input = noise(geometry.input.iter().product(), 1);
            let weights = noise(20 * geometry.depth(), 2);
            let (scale, shift, residual) = (noise(20, 3), noise(20, 4), noise(2 * 20 * 72, 5));
            let finish = Finish {
                scale: Some(&scale),
                shift: Some(&shift),
                residual: Some(&residual),
                activation,
            };
            let fast = Weights::default().convolve(&input, &weights, &geometry, [8, 9], finish);
            for (index, sum) in slow(&input, &weights, &geometry, [8, 9]).into_iter().enumerate() {
                let channel = index / 72 % 20;
                let value = sum * f64::from(scale[channel]) + f64::from(shift[channel]);
                let value = value + f64::from(residual[index]);
                let top = if activation == Activation::Relu { f64::MAX } else { 6.0 };
                let value = value.clamp(0.0, top);
                assert!((f64::from(fast[index]) - value).abs() < 1e-4, "{index}");
            }
        }
    }
}
