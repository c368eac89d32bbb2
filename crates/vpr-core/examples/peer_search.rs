//! Our side of `experiments/peers/faiss_flat.py`: times one search per line of stdin.
//!
//! `peer_search <references.f32> <queries.f32> <dim>` reads two raw little-endian files, then obeys
//! `time <metric> <batch> <threads> [<rows per block>]` (answers milliseconds), `read <threads>` (milliseconds of one
//! plain pass over the references) and `save <metric> <path>` (indices as u32, then distances).

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "an example prints, and stops at the first error"
)]

use std::{
    env,
    fs::{self, File},
    hint::black_box,
    io::{self, BufRead, BufReader, Read, Write},
    time::Instant,
};

use anyhow::{Context, Result, bail};
use ndarray::{Array2, s};
use rayon::{ThreadPool, prelude::*};
use vpr_core::{
    Descriptors, Retrieval,
    knn::{Metric, SearchParams, search},
};

const K: usize = 10;

fn main() -> Result<()> {
    let args: Vec<String> = env::args().skip(1).collect();
    let [references, queries, dim] = args.as_slice() else {
        bail!("usage: peer_search <references.f32> <queries.f32> <dim>");
    };
    let dim = dim.parse()?;
    let (references, queries) = (load(references, dim)?, load(queries, dim)?);
    let pools = [pool(1)?, pool(2)?];
    let mut out = io::stdout();
    for line in io::stdin().lock().lines() {
        let line = line?;
        match line.split_whitespace().collect::<Vec<_>>().as_slice() {
            ["time", metric, batch, threads, block_rows @ ..] => {
                let block_rows = block_rows.first().map(|rows| rows.parse()).transpose()?;
                let params = SearchParams { block_rows, ..params(metric)? };
                let batch = queries.view().slice(s![..batch.parse::<usize>()?, ..]).to_owned();
                let batch = Descriptors::new(batch)?;
                let start = Instant::now();
                let found =
                    chosen(&pools, threads)?.install(|| search(&references, &batch, &params));
                black_box(found?);
                writeln!(out, "{}", milliseconds(start))?;
            }
            ["read", threads] => {
                let start = Instant::now();
                black_box(chosen(&pools, threads)?.install(|| plain_pass(references.as_slice())));
                writeln!(out, "{}", milliseconds(start))?;
            }
            ["save", metric, path] => {
                let params = params(metric)?;
                let found = pools[1].install(|| search(&references, &queries, &params))?;
                fs::write(path, bytes(&found)?)?;
                writeln!(out, "saved")?;
            }
            _ => bail!("cannot obey `{line}`"),
        }
        out.flush()?;
    }
    Ok(())
}

fn load(path: &str, dim: usize) -> Result<Descriptors> {
    let mut file = BufReader::new(File::open(path).with_context(|| path.to_owned())?);
    let n_values = usize::try_from(file.get_ref().metadata()?.len())? / size_of::<f32>();
    let mut values = Vec::with_capacity(n_values);
    let mut bytes = [0; size_of::<f32>()];
    for _ in 0..n_values {
        file.read_exact(&mut bytes)?;
        values.push(f32::from_le_bytes(bytes));
    }
    Ok(Descriptors::new(Array2::from_shape_vec((n_values / dim, dim), values)?)?)
}

fn pool(threads: usize) -> Result<ThreadPool> {
    Ok(rayon::ThreadPoolBuilder::new().num_threads(threads).build()?)
}

fn chosen<'a>(pools: &'a [ThreadPool; 2], threads: &str) -> Result<&'a ThreadPool> {
    let threads: usize = threads.parse()?;
    pools.get(threads.wrapping_sub(1)).context("1 or 2 threads")
}

fn params(metric: &str) -> Result<SearchParams> {
    let metric = match metric {
        "l2" => Metric::Euclidean,
        "ip" => Metric::InnerProduct,
        "l1" => Metric::Manhattan,
        "cosine" => Metric::Cosine,
        _ => bail!("no metric `{metric}`"),
    };
    Ok(SearchParams { metric, k: K, ..SearchParams::default() })
}

fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

/// Reads every value once: the exclusive or of the bits, which no processor finds hard.
fn plain_pass(values: &[f32]) -> u32 {
    let words = |chunk: &[f32]| {
        let mut lanes = [0; 64];
        for values in chunk.as_chunks::<64>().0 {
            lanes.iter_mut().zip(values).for_each(|(lane, value)| *lane ^= value.to_bits());
        }
        lanes.iter().fold(0, |all, lane| all ^ lane)
    };
    values.par_chunks(1 << 18).map(words).reduce(|| 0, |a, b| a ^ b)
}

fn bytes(found: &Retrieval) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    for query in 0..found.len() {
        for &index in found.indices(query) {
            bytes.extend(u32::try_from(index)?.to_le_bytes());
        }
    }
    for query in 0..found.len() {
        found.distances(query).iter().for_each(|distance| bytes.extend(distance.to_le_bytes()));
    }
    Ok(bytes)
}
