//! HNSW against exact search: recall@10 and time for one query, by effort, on raw little-endian files.
//!
//! `approximate_search <references.f32> <queries.f32> <dim>`, on one thread. Prints a table in Markdown.

use std::{env, fs, hint::black_box, time::Instant};

use anyhow::{Context, Result, bail};
use ndarray::Array2;
use vpr_core::{
    Descriptors,
    knn::{Hnsw, HnswParams, Metric},
};

fn main() -> Result<()> {
    let args: Vec<String> = env::args().skip(1).collect();
    let [references, queries, dim] = args.as_slice() else {
        bail!("usage: approximate_search <references.f32> <queries.f32> <dim>");
    };
    let dim = dim.parse()?;
    let (references, queries) = (load(references, dim)?, load(queries, dim)?);
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global()?;
    let start = Instant::now();
    let mut hnsw = Hnsw::build(&references, Metric::Euclidean, &HnswParams::default())?;
    println!(
        "built in {:.1} s\n\n| candidates | recall@10 | ms per query |\n|--:|--:|--:|",
        start.elapsed().as_secs_f64()
    );
    for candidates in [10, 16, 32, 64, 128] {
        hnsw.set_expansion_search(candidates);
        let recall = hnsw.measure(&references, &queries, 10)?.recall;
        let mut fastest = f64::INFINITY;
        for _ in 0..10 {
            let start = Instant::now();
            black_box(hnsw.search(&references, &queries, 10)?);
            fastest = fastest.min(start.elapsed().as_secs_f64());
        }
        println!("| {candidates} | {recall:.4} | {:.3} |", fastest * 1e3 / queries.len() as f64);
    }
    Ok(())
}

fn load(path: &str, dim: usize) -> Result<Descriptors> {
    let bytes = fs::read(path).with_context(|| path.to_owned())?;
    let values: Vec<f32> =
        bytes.as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b)).collect();
    Ok(Descriptors::new(Array2::from_shape_vec((values.len() / dim, dim), values)?)?)
}
