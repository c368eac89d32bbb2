//! Makes a map of images with the built-in network, opens it again and asks it where queries are.
//!
//! ```text
//! cargo run -p vpr-nets --example map_with_a_network
//! ```
//!
//! For folders with thousands of images, [`vpr_nets::encode::encode_to_map`] does the first half and
//! goes on where it was interrupted.
#![expect(clippy::print_stdout, reason = "an example prints what it found")]

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use vpr_core::{
    knn::{self, Metric, SearchParams},
    map::{About, MapWriter, Names, OpenMap, Opening, RowType},
};
use vpr_nets::encode::{Options, by_name, encode_files};
use vpr_worlds::{World, named_recipe};

/// Twenty places of a city, rendered once into `data/worlds`.
const WORLD: &str = "world/street?places=20&camera.width=160&camera.height=120&camera.focal=115.0";

fn main() -> Result<()> {
    let recipe = named_recipe(WORLD)?;
    let city = World::open(&recipe, Path::new("data/worlds"), &|| ())?.dataset;
    let (query_poses, reference_poses) = city.poses.context("a street knows its poses")?;

    // The network of this name is part of the program; others have their weights in a data folder,
    // which is the third argument.
    let network = by_name("default", None, &[])?;
    let options = Options::default();
    let references = encode_files(&*network, &city.references, &options, &mut |_| ())?;

    // A map file: descriptors, poses and names of the same images in the same order, and what made
    // them. It appears under its name when it is finished, never half.
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("city.safetensors");
    let about = About {
        encoder: Some(network.name().to_owned()),
        weights_digest: network.weights_digest().map(str::to_owned),
        metric: Some(Metric::Euclidean),
        ..About::default()
    };
    let names: Names = city.references.iter().map(|path| name_of(path)).collect();
    let mut writer = MapWriter::create(&file, references.dim(), RowType::F32, about)?;
    writer.append(references.view(), Some(&reference_poses), Some(&names))?;
    writer.finish()?;

    // From here on nothing but the file is needed: rows are read where they lie on disk.
    let map = OpenMap::open(&file, Opening::default())?;
    let names = map.names()?.context("names were written")?;
    let poses = map.poses()?.context("poses were written")?;
    let encoder = map.about().encoder.as_deref().unwrap_or("unknown");
    println!("{} references, {} values each, by `{encoder}`", map.len(), map.dim());

    // Exact search, three nearest references for each of three queries.
    let asked: Vec<PathBuf> = city.queries.into_iter().take(3).collect();
    let queries = encode_files(&*network, &asked, &options, &mut |_| ())?;
    let params = SearchParams { k: 3, ..SearchParams::default() };
    let found = knn::search(&map, &queries, &params)?;
    for (query, path) in asked.iter().enumerate() {
        println!("query {}", name_of(path));
        for (&reference, distance) in found.indices(query).iter().zip(found.distances(query)) {
            let metres = (poses.position(reference) - query_poses.position(query)).norm();
            let name = names.get(reference).unwrap_or_default();
            println!("  distance {distance:.3}, {metres:6.1} m away: {name}");
        }
    }
    Ok(())
}

/// The last part of a path.
fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}
