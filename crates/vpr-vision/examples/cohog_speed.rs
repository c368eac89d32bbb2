//! Times CoHOG matching at its published size, 961 × 961 regions of 32 values, with all regions of interest, and the
//! machine's own limit: faer's f32 matrix product. Prints `name threads ms gflops` lines for `experiments/peers/cohog.py`.

#![expect(clippy::print_stdout, reason = "an example prints its result")]

use std::{error::Error, hint::black_box, time::Instant};

use faer::{Accum, Mat, Par, linalg::matmul::matmul};
use ndarray::Array2;
use rayon::{ThreadPool, ThreadPoolBuilder, prelude::*};
use vpr_vision::cohog::{CoHogDescriptor, similarities};

const N_REGIONS: usize = 961;
const DEPTH: usize = 32;
const N_IMAGES: usize = 16;
const ROUNDS: usize = 9;
const GEMM_SIDE: usize = 1024;

fn main() -> Result<(), Box<dyn Error>> {
    let mut state = 1;
    let images = (0..N_IMAGES).map(|_| place(&mut state)).collect::<Result<Vec<_>, _>>()?;
    for threads in [1, 2] {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build()?;
        let pair = median_ms(|| {
            pool.install(|| black_box(similarities(&images, &images)))
                .expect("places of one shape");
        }) / (N_IMAGES * N_IMAGES) as f64;
        report("cohog", threads, pair, (2 * N_REGIONS * N_REGIONS * DEPTH) as f64);
        report("faer-gemm", threads, gemm_ms(&pool, threads), 2.0 * (GEMM_SIDE as f64).powi(3));
    }
    Ok(())
}

fn report(name: &str, threads: usize, ms: f64, operations: f64) {
    println!("{name} {threads} {ms:.4} {:.1}", operations / ms / 1e6);
}

/// Random non-negative regions of length one, all of interest.
fn place(state: &mut u32) -> vpr_core::Result<CoHogDescriptor> {
    let mut regions = Array2::from_shape_simple_fn((N_REGIONS, DEPTH), || {
        *state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f32::from(state.to_be_bytes()[0])
    });
    for mut region in regions.outer_iter_mut() {
        let length = region.dot(&region).sqrt().max(1.0);
        region /= length;
    }
    CoHogDescriptor::new(regions, vec![true; N_REGIONS])
}

/// Time per 1024³ product in f32 where every thread computes one of its own.
fn gemm_ms(pool: &ThreadPool, threads: usize) -> f64 {
    let left = Mat::<f32>::from_fn(GEMM_SIDE, GEMM_SIDE, |row, column| ((row + column) % 7) as f32);
    let mut products = vec![Mat::<f32>::zeros(GEMM_SIDE, GEMM_SIDE); threads];
    let round = median_ms(|| {
        pool.install(|| {
            products.par_iter_mut().for_each(|product| {
                matmul(product, Accum::Replace, &left, &left, 1.0f32, Par::Seq);
            });
        });
        black_box(&products);
    });
    round / threads as f64
}

/// Median over [`ROUNDS`] after one to warm up.
fn median_ms(mut run: impl FnMut()) -> f64 {
    run();
    let mut times: Vec<f64> = (0..ROUNDS)
        .map(|_| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[ROUNDS / 2]
}
