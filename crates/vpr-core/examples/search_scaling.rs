//! Time of exact search from 1 000 to 1 000 000 references of 128 values, with the time of one
//! plain pass over the same memory.
//!
//! `search_scaling <folder>` writes `search-scaling.svg` and `search-scaling.md` there. Run it on a
//! quiet machine; it needs 1.1 GB.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "an example prints, and stops at the first error"
)]

use std::{env, fmt::Write, fs, hint::black_box, path::Path, time::Instant};

use anyhow::{Context, Result};
use ndarray::{Array2, s};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use vpr_core::{
    Descriptors,
    figure::{Curve, Figure, Panel},
    knn::{SearchParams, search},
};

const DIM: usize = 128;
const SIZES: [usize; 7] = [1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000];
const NAMES: [&str; 3] = ["1 query", "100 queries, per query", "one pass over memory"];

fn main() -> Result<()> {
    let folder = env::args().nth(1).context("usage: search_scaling <folder>")?;
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut rows =
        |n: usize| Array2::from_shape_simple_fn((n, DIM), || rng.random_range(-1.0_f32..1.0));
    let (all, queries) = (rows(SIZES[SIZES.len() - 1]), Descriptors::new(rows(100))?);
    let one = Descriptors::new(queries.view().slice(s![..1, ..]).to_owned())?;
    let mut curves = NAMES.map(|name| Curve { name: name.to_owned(), points: Vec::new() });
    let mut table = format!(
        "Exact search, Euclidean, k = 10, {DIM} values, {} threads; milliseconds, least of several runs.\n\n\
         | references | {} | {} | {} |\n|--:|--:|--:|--:|\n",
        rayon::current_num_threads(),
        NAMES[0],
        NAMES[1],
        NAMES[2]
    );
    for n_references in SIZES {
        let references = Descriptors::new(all.slice(s![..n_references, ..]).to_owned())?;
        let run = |queries| search(&references, queries, &SearchParams::default());
        let times = [
            least(30, || run(&one))?,
            least(5, || run(&queries))? / 100.0,
            least(30, || Ok(plain_pass(references.as_slice())))?,
        ];
        for (curve, time) in curves.iter_mut().zip(times) {
            curve.points.push(((n_references as f64).log10(), time.log10()));
        }
        writeln!(
            table,
            "| {n_references} | {:.4} | {:.4} | {:.4} |",
            times[0], times[1], times[2]
        )?;
    }
    let panel = Panel {
        title: "Exact search".to_owned(),
        x_label: "references, log10".to_owned(),
        y_label: "milliseconds, log10".to_owned(),
        curves: curves.into(),
        is_scatter: false,
    };
    let svg = Figure { panels: vec![panel] }.svg().map_err(anyhow::Error::msg)?;
    fs::create_dir_all(&folder)?;
    fs::write(Path::new(&folder).join("search-scaling.svg"), svg)?;
    fs::write(Path::new(&folder).join("search-scaling.md"), table)?;
    Ok(())
}

/// Milliseconds of the fastest of several runs.
fn least<T>(runs: usize, mut run: impl FnMut() -> vpr_core::Result<T>) -> Result<f64> {
    let mut least = f64::INFINITY;
    for _ in 0..runs {
        let start = Instant::now();
        black_box(run()?);
        least = least.min(start.elapsed().as_secs_f64() * 1e3);
    }
    Ok(least)
}

fn plain_pass(values: &[f32]) -> u32 {
    let words = |chunk: &[f32]| {
        let mut lanes = [0; 64];
        for values in chunk.as_chunks::<64>().0 {
            lanes.iter_mut().zip(values).for_each(|(lane, value)| *lane ^= value.to_bits());
        }
        lanes.iter().fold(0, |all, lane| all ^ lane)
    };
    values.par_chunks(1 << 16).map(words).reduce(|| 0, |a, b| a ^ b)
}
