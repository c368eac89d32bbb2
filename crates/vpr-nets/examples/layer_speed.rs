//! Times the layers of [`vpr_nets::layer`] beside burn's own: `layer_speed [repetitions]`.
//!
//! Prints a line per shape: milliseconds ours, burn's (medians), gigaflops of ours counted as the
//! definition counts. `experiments/peers/networks.py` runs PyTorch beside it.
#![expect(clippy::print_stdout, reason = "prints its measurements")]

use std::time::Instant;

use burn::{
    nn::{self, PaddingConfig2d},
    tensor::{Device, Distribution, Tensor},
};
use vpr_nets::layer::Conv2dConfig;

/// Images, channels in and out, side of the input, kernel, stride.
const SHAPES: [[usize; 6]; 14] = [
    [8, 64, 64, 56, 3, 1],
    [8, 3, 64, 224, 7, 2],
    [1, 3, 64, 224, 7, 2],
    [1, 64, 64, 56, 3, 1],
    [8, 128, 128, 28, 3, 1],
    [1, 128, 128, 28, 3, 1],
    [8, 256, 256, 14, 3, 1],
    [1, 256, 256, 14, 3, 1],
    [8, 512, 512, 7, 3, 1],
    [1, 512, 512, 7, 3, 1],
    [8, 64, 128, 56, 3, 2],
    [8, 256, 512, 14, 3, 2],
    [8, 64, 256, 56, 1, 1],
    [1, 1024, 256, 14, 1, 1],
];

fn main() {
    let n = std::env::args().nth(1).and_then(|it| it.parse().ok()).unwrap_or(15);
    let device = Device::flex();
    println!("images in out side kernel stride  ours_ms burn_ms gflops");
    for [images, channels, out, side, kernel, stride] in SHAPES {
        let pad = kernel / 2;
        let padding = PaddingConfig2d::Explicit(pad, pad, pad, pad);
        let ours = Conv2dConfig::new([channels, out], [kernel, kernel])
            .with_stride([stride, stride])
            .with_padding(padding.clone())
            .init(&device);
        let burns = nn::conv::Conv2dConfig::new([channels, out], [kernel, kernel])
            .with_stride([stride, stride])
            .with_padding(padding)
            .init(&device);
        let shape = [images, channels, side, side];
        let input = Tensor::<4>::random(shape, Distribution::Uniform(-1.0, 1.0), &device);
        let ours = median(n, || drop(ours.forward(input.clone())));
        let burns = median(n, || drop(burns.forward(input.clone())));
        let pixels = side.div_ceil(stride).pow(2);
        let flops = (2 * images * out * channels * kernel * kernel * pixels) as f64;
        println!(
            "{images} {channels} {out} {side} {kernel} {stride}  {:.2} {:.2} {:.0}",
            ours * 1e3,
            burns * 1e3,
            flops / ours / 1e9
        );
    }
}

/// Median seconds of one call, after one that is not counted.
fn median(n: usize, call: impl Fn()) -> f64 {
    call();
    let mut times: Vec<f64> = (0..n)
        .map(|_| {
            let start = Instant::now();
            call();
            start.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}
