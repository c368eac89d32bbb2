//! Smaller rows against exact neighbours: share found, bytes per reference, time per query.
//!
//! Reads the 7-Scenes frames under `$VPR_DATA/7scenes`, describes them by HOG and prints a table in
//! Markdown. Every fifth frame is a query, the others are references.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "an example prints, and stops at the first error"
)]

use std::{collections::HashSet, env, error::Error, hint::black_box, path::PathBuf, time::Instant};

use ndarray::{Array2, Axis};
use rayon::prelude::*;
use vpr_core::{
    Descriptors, Retrieval,
    knn::{
        Coarse, F16Rows, Int8Rows, Pca, PcaParams, RowSource, SearchParams, SignRows, rescore,
        search, search_rescored,
    },
};
use vpr_vision::{
    hog::{Hog, HogParams},
    image::decode,
};

const K: usize = 10;
const REPEATS: usize = 5;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(env::var("VPR_DATA")?).join("7scenes/redkitchen/seq-01");
    let mut frames: Vec<PathBuf> =
        folder.read_dir()?.map(|entry| Ok(entry?.path())).collect::<std::io::Result<_>>()?;
    frames.retain(|path| path.to_string_lossy().contains(".color."));
    frames.sort();
    let hog = Hog::new(HogParams::THESIS)?;
    let described: Vec<Vec<f32>> = frames
        .par_iter()
        .map(|path| hog.describe(&decode(path)?))
        .collect::<vpr_core::Result<_>>()?;
    let all = Array2::from_shape_vec((frames.len(), described[0].len()), described.concat())?;
    let part = |queries: bool| {
        let rows: Vec<usize> =
            (0..frames.len()).filter(|frame| frame.is_multiple_of(5) == queries).collect();
        Descriptors::new(all.select(Axis(0), &rows))
    };
    let (references, queries) = (part(false)?, part(true)?);
    println!(
        "{} references, {} queries, HOG of {} values, k = {K}\n",
        references.len(),
        queries.len(),
        all.ncols()
    );
    println!("| rows | bytes per reference | recall@1 | recall@5 | recall@10 | ms per query |");
    println!("|---|--:|--:|--:|--:|--:|");
    table(&references, &queries)?;
    Ok(())
}

fn table(references: &Descriptors, queries: &Descriptors) -> Result<(), Box<dyn Error>> {
    let params = SearchParams { k: K, ..SearchParams::default() };
    let bytes = |per_value: usize| per_value * references.dim();
    let exact = search(references, queries, &params)?;
    let line = |name: &str,
                bytes: usize,
                run: &dyn Fn() -> vpr_core::Result<Retrieval>|
     -> vpr_core::Result<()> { report(name, bytes, queries, &exact, run) };
    line("f32", bytes(4), &|| search(references, queries, &params))?;

    let (half, int8) = (F16Rows::encode(references)?, Int8Rows::encode(references));
    let coarse: [(&str, usize, &dyn RowSource); 2] =
        [("f16", bytes(2), &half), ("int8", bytes(1) + 4, &int8)];
    for (name, bytes, rows) in coarse {
        line(name, bytes, &|| search(rows, queries, &params))?;
        let coarse = Coarse { rows, queries, oversample: 2 };
        line(&format!("{name}, 20 rescored"), bytes, &|| {
            search_rescored(&coarse, references, queries, &params)
        })?;
    }
    for n_components in [64, 256] {
        let pca = Pca::fit(references, &PcaParams { n_components, whiten: false })?;
        let (rows, projected) = (pca.apply(references)?, pca.apply(queries)?);
        line(&format!("PCA {n_components}"), 4 * n_components, &|| {
            search(&rows, &projected, &params)
        })?;
        let coarse = Coarse { rows: &rows, queries: &projected, oversample: 4 };
        let name = format!("PCA {n_components}, 40 rescored");
        line(&name, 4 * n_components, &|| search_rescored(&coarse, references, queries, &params))?;
        let coarse = Coarse { rows: &Int8Rows::encode(&rows), queries: &projected, oversample: 4 };
        let name = format!("PCA {n_components} as int8, 40 rescored");
        line(&name, n_components + 4, &|| search_rescored(&coarse, references, queries, &params))?;
        let (signs, query_signs) = (SignRows::encode(&rows), SignRows::encode(&projected));
        let name = format!("signs of PCA {n_components}, 100 rescored");
        line(&name, n_components / 8, &|| {
            rescore(references, queries, &signs.nearest(&query_signs, 100), &params)
        })?;
    }
    Ok(())
}

fn report(
    name: &str,
    bytes: usize,
    queries: &Descriptors,
    exact: &Retrieval,
    run: &dyn Fn() -> vpr_core::Result<Retrieval>,
) -> vpr_core::Result<()> {
    let mut fastest = f64::INFINITY;
    let mut found = run()?;
    for _ in 0..REPEATS {
        let start = Instant::now();
        found = black_box(run()?);
        fastest = fastest.min(start.elapsed().as_secs_f64());
    }
    let recall = |n: usize| {
        let shared = (0..exact.len()).map(|query| {
            let wanted: HashSet<usize> = exact.indices(query).iter().take(n).copied().collect();
            found.indices(query).iter().take(n).filter(|index| wanted.contains(index)).count()
        });
        shared.sum::<usize>() as f64 / (n * exact.len()) as f64
    };
    let [at_1, at_5, at_10] = [1, 5, 10].map(recall);
    let ms = fastest * 1e3 / queries.len() as f64;
    println!("| {name} | {bytes} | {at_1:.4} | {at_5:.4} | {at_10:.4} | {ms:.3} |");
    Ok(())
}
