//! Our side of `experiments/peers/faiss_hnsw.py`: one command per line of stdin.
//!
//! `peer_hnsw <references.f32> <queries.f32> <dim>` reads two raw little-endian files, then obeys
//! `build <codes> <connectivity> <expansion> <path>` (answers seconds),
//! `open <path>`, `recall <expansion> <oversample>` (answers recall@10 against exact search, all
//! queries) and `time <batch> <threads>` (answers milliseconds of all queries, batch by batch).

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "an example prints, and stops at the first error"
)]

use std::{
    env, fs,
    hint::black_box,
    io::{self, BufRead, Write},
    path::Path,
    time::Instant,
};

use anyhow::{Context, Result, bail};
use ndarray::{Array2, s};
use vpr_core::{
    Descriptors,
    knn::{Hnsw, HnswCodes, HnswParams, Metric, SearchParams, search},
};

const K: usize = 10;

fn main() -> Result<()> {
    let args: Vec<String> = env::args().skip(1).collect();
    let [references, queries, dim] = args.as_slice() else {
        bail!("usage: peer_hnsw <references.f32> <queries.f32> <dim>");
    };
    let dim = dim.parse()?;
    let (references, queries) = (load(references, dim)?, load(queries, dim)?);
    let exact = search(&references, &queries, &SearchParams { k: K, ..SearchParams::default() })?;
    let mut hnsw = None;
    let mut out = io::stdout();
    for line in io::stdin().lock().lines() {
        let line = line?;
        match line.split_whitespace().collect::<Vec<_>>().as_slice() {
            ["build", codes, connectivity, expansion_add, path] => {
                let (connectivity, expansion_add) = (connectivity.parse()?, expansion_add.parse()?);
                let codes = codes_of(codes)?;
                let params =
                    HnswParams { codes, connectivity, expansion_add, ..HnswParams::default() };
                let start = Instant::now();
                let built = Hnsw::build(&references, Metric::Euclidean, &params, None)?;
                built.save(Path::new(path))?;
                writeln!(out, "{}", start.elapsed().as_secs_f64())?;
            }
            ["open", path] => {
                hnsw = Some(Hnsw::open(Path::new(path))?);
                writeln!(out, "opened")?;
            }
            ["recall", expansion, oversample] => {
                let hnsw = hnsw.as_mut().context("no graph is open")?;
                hnsw.set_expansion_search(expansion.parse()?);
                hnsw.set_oversample(oversample.parse()?);
                let found = hnsw.search(&references, &queries, K)?;
                let shared = (0..queries.len()).map(|query| {
                    let found = found.indices(query).to_vec();
                    exact.indices(query).iter().filter(|index| found.contains(index)).count()
                });
                writeln!(out, "{}", shared.sum::<usize>() as f64 / (K * queries.len()) as f64)?;
            }
            ["time", batch, threads] => {
                let hnsw = hnsw.as_ref().context("no graph is open")?;
                let threads = rayon::ThreadPoolBuilder::new().num_threads(threads.parse()?);
                let batches = batches(&queries, batch.parse()?)?;
                let milliseconds = threads.build()?.install(|| -> Result<f64> {
                    let start = Instant::now();
                    for batch in &batches {
                        black_box(hnsw.search(&references, batch, K)?);
                    }
                    Ok(start.elapsed().as_secs_f64() * 1e3)
                })?;
                writeln!(out, "{milliseconds}")?;
            }
            _ => bail!("cannot obey `{line}`"),
        }
        out.flush()?;
    }
    Ok(())
}

fn codes_of(name: &str) -> Result<HnswCodes> {
    Ok(match name {
        "f32" => HnswCodes::F32,
        "f16" => HnswCodes::F16,
        "int8" => HnswCodes::Int8,
        _ => bail!("no codes `{name}`"),
    })
}

fn batches(queries: &Descriptors, size: usize) -> Result<Vec<Descriptors>> {
    let starts = (0..queries.len()).step_by(size);
    let batch = |start: usize| {
        let rows = start..(start + size).min(queries.len());
        Ok(Descriptors::new(queries.view().slice(s![rows, ..]).to_owned())?)
    };
    starts.map(batch).collect()
}

fn load(path: &str, dim: usize) -> Result<Descriptors> {
    let bytes = fs::read(path).with_context(|| path.to_owned())?;
    let values: Vec<f32> =
        bytes.as_chunks().0.iter().map(|four| f32::from_le_bytes(*four)).collect();
    Ok(Descriptors::new(Array2::from_shape_vec((values.len() / dim, dim), values)?)?)
}
