//! The graph beside a map, for `build --approximate` and `search --approximate`.

use std::path::{Path, PathBuf};

use anyhow::{bail, ensure};
use ndarray::Array2;
use vpr_core::{
    Descriptors, Retrieval,
    knn::{Hnsw, HnswParams, SearchParams, row},
    map::{Access, OpenMap, Opening},
};
use vpr_report::cli;

/// Neighbours and queries that the recall kept beside a graph is of.
const MEASURED_K: usize = 10;
const MEASURED_QUERIES: usize = 200;

/// Builds the graph of a map that has just been written, and measures its recall.
pub(super) fn build(map_path: &Path) -> anyhow::Result<()> {
    let map = OpenMap::open(map_path, Opening { access: Access::Read, trust: false })?;
    let metric = map.about().metric.unwrap_or_default();
    let params = HnswParams::default();
    let mut graph = Hnsw::build(&map, metric, &params, Some(map.digest()))?;
    let measured = graph.measure(&map, &some_references(&map)?, MEASURED_K)?;
    graph.save(&graph_of(map_path))?;
    let (recall, n) = (measured.recall, measured.n_queries);
    cli::note(&format!("graph: recall@{} {recall:.4}, of {n} of the references", measured.k));
    Ok(())
}

/// Searches the graph of a map.
pub(super) fn search(
    map_path: &Path,
    map: &OpenMap,
    queries: &Descriptors,
    params: &SearchParams,
) -> anyhow::Result<Retrieval> {
    let path = graph_of(map_path);
    let graph = Hnsw::open(&path)?;
    if graph.source() != Some(&map.digest()) {
        bail!("{}: is of another map; build it anew", path.display());
    }
    ensure!(
        graph.metric() == params.metric,
        "{}: is of another metric ({:?})",
        path.display(),
        graph.metric()
    );
    if let Some(measured) = graph.recall() {
        cli::note(&format!("approximate: recall@{} was {:.4}", measured.k, measured.recall));
    }
    Ok(graph.search(map, queries, params.k)?)
}

fn graph_of(map: &Path) -> PathBuf {
    // A folder may be named with a slash at its end.
    let mut name = map.components().as_path().as_os_str().to_owned();
    name.push(".hnsw");
    name.into()
}

/// Some references, evenly spread over the map, to stand for queries.
fn some_references(map: &OpenMap) -> anyhow::Result<Descriptors> {
    let n = MEASURED_QUERIES.min(map.len());
    let (mut values, mut scratch) = (Vec::with_capacity(n * map.dim()), Vec::new());
    for query in 0..n {
        values.extend_from_slice(row(map, query * map.len() / n, &mut scratch)?);
    }
    Ok(Descriptors::new(Array2::from_shape_vec((n, map.dim()), values)?)?)
}
