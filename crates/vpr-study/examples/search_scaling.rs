//! Time of exact search against the number of references, of values per descriptor and of queries,
//! with the time of one plain pass over the same memory as the limit.
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
    knn::{SearchParams, search},
};
use vpr_report::figure::{Curve, Figure, Panel, Scale};

/// Values per descriptor where something else varies.
const DIM: usize = 128;
const SIZES: [usize; 7] = [1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000];
const DIMS: [usize; 8] = [32, 64, 128, 256, 512, 1024, 2048, 4096];
/// References where dimensions vary.
const N_FOR_DIMS: usize = 30_000;
const BATCHES: [usize; 9] = [1, 3, 10, 30, 100, 300, 1000, 3000, 10_000];
/// References where queries vary.
const N_FOR_BATCHES: usize = 30_000;

/// One quantity that varies, and how long everything took for each value of it.
struct Sweep {
    title: String,
    /// What varies.
    quantity: &'static str,
    /// Names of the times of a row; the last is that of one pass over memory.
    times: &'static [&'static str],
    rows: Vec<(usize, Vec<f64>)>,
}

fn main() -> Result<()> {
    let folder = env::args().nth(1).context("usage: search_scaling <folder>")?;
    let sweeps = [over_references()?, over_dimensions()?, over_queries()?];
    let mut page = format!(
        "Exact search, Euclidean, k = 10, uniform random values, {} threads; milliseconds, least of \
         several runs. Written by `cargo run --example search_scaling -- \
         docs/results`. The slope of the logarithms is 1 where cost is proportional.\n",
        rayon::current_num_threads()
    );
    for sweep in &sweeps {
        sweep.write_table(&mut page)?;
    }
    let panels = sweeps.iter().map(Sweep::panel).collect();
    let svg = Figure { panels }.svg("Time of exact search, Euclidean, k = 10");
    fs::create_dir_all(&folder)?;
    fs::write(Path::new(&folder).join("search-scaling.svg"), svg)?;
    fs::write(Path::new(&folder).join("search-scaling.md"), page)?;
    Ok(())
}

fn random(n_rows: usize, dim: usize, seed: u64) -> Array2<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    Array2::from_shape_simple_fn((n_rows, dim), || rng.random_range(-1.0_f32..1.0))
}

/// Milliseconds of one query, of each of 100, and of a pass over the references.
fn times(references: &Descriptors, queries: &Descriptors, runs: usize) -> Result<Vec<f64>> {
    let one = Descriptors::new(queries.view().slice(s![..1, ..]).to_owned())?;
    let run = |queries| search(references, queries, &SearchParams::default());
    Ok(vec![
        least(runs, || run(&one))?,
        least(runs.div_ceil(6), || run(queries))? / queries.len() as f64,
        least(runs, || Ok(plain_pass(references.as_slice())))?,
    ])
}

fn over_references() -> Result<Sweep> {
    let (all, queries) = (random(SIZES[6], DIM, 1), Descriptors::new(random(100, DIM, 2))?);
    let mut rows = Vec::new();
    for n in SIZES {
        let references = Descriptors::new(all.slice(s![..n, ..]).to_owned())?;
        rows.push((n, times(&references, &queries, 24)?));
    }
    Ok(Sweep {
        title: format!("References of {DIM} values"),
        quantity: "references",
        times: &["1 query", "100 queries, per query", "one pass over memory"],
        rows,
    })
}

fn over_dimensions() -> Result<Sweep> {
    let mut rows = Vec::new();
    for dim in DIMS {
        let references = Descriptors::new(random(N_FOR_DIMS, dim, 3))?;
        let queries = Descriptors::new(random(100, dim, 4))?;
        rows.push((dim, times(&references, &queries, 24)?));
    }
    Ok(Sweep {
        title: format!("Values of {N_FOR_DIMS} references"),
        quantity: "values",
        times: &["1 query", "100 queries, per query", "one pass over memory"],
        rows,
    })
}

fn over_queries() -> Result<Sweep> {
    let references = Descriptors::new(random(N_FOR_BATCHES, DIM, 5))?;
    let all = random(BATCHES[8], DIM, 6);
    let pass = least(24, || Ok(plain_pass(references.as_slice())))?;
    let mut rows = Vec::new();
    for n in BATCHES {
        let queries = Descriptors::new(all.slice(s![..n, ..]).to_owned())?;
        let runs = (1000 / n).clamp(3, 24);
        let time = least(runs, || search(&references, &queries, &SearchParams::default()))?;
        rows.push((n, vec![time, pass]));
    }
    Ok(Sweep {
        title: format!("Queries in {N_FOR_BATCHES} references of {DIM} values"),
        quantity: "queries",
        times: &["all queries", "one pass over memory"],
        rows,
    })
}

impl Sweep {
    fn write_table(&self, page: &mut String) -> Result<()> {
        writeln!(page, "\n## {}\n", self.title)?;
        writeln!(page, "| {} | {} |", self.quantity, self.times.join(" | "))?;
        writeln!(page, "|--:|{}", "--:|".repeat(self.times.len()))?;
        for (value, times) in &self.rows {
            let times: Vec<String> = times.iter().map(|time| format!("{time:.4}")).collect();
            writeln!(page, "| {value} | {} |", times.join(" | "))?;
        }
        let half = self.rows.len() / 2;
        let slopes = (0..self.times.len()).map(|column| format!("{:.2}", self.slope(half, column)));
        let slopes: Vec<String> = slopes.collect();
        writeln!(page, "| slope from {} on | {} |", self.rows[half].0, slopes.join(" | "))?;
        Ok(())
    }

    /// Least-squares slope of the logarithm of a time over that of the quantity, from a row on.
    fn slope(&self, first: usize, column: usize) -> f64 {
        let rows = &self.rows[first..];
        let points = rows.iter().map(|(value, times)| ((*value as f64).ln(), times[column].ln()));
        let points: Vec<(f64, f64)> = points.collect();
        let mean =
            |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / points.len() as f64;
        let (x, y) = (mean(|point| point.0), mean(|point| point.1));
        let along: f64 = points.iter().map(|point| (point.0 - x) * (point.1 - y)).sum();
        along / points.iter().map(|point| (point.0 - x).powi(2)).sum::<f64>()
    }

    fn panel(&self) -> Panel {
        let curve = |column: usize| {
            let points = self.rows.iter().map(|(value, times)| (*value as f64, times[column]));
            Curve::new(self.times[column], points.collect())
        };
        Panel {
            title: self.title.clone(),
            x_label: self.quantity.to_owned(),
            y_label: "milliseconds".to_owned(),
            curves: (0..self.times.len()).map(curve).collect(),
            x_scale: Scale::Log,
            y_scale: Scale::Log,
            ..Panel::default()
        }
    }
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
