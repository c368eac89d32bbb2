//! Approximate search: what the graph finds is ranked exactly, and how much it finds is known.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a test fails by panicking and says what it skips"
)]

use std::fs;

use ndarray::Array2;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use vpr_core::{
    Descriptors, Error,
    knn::{Hnsw, HnswCodes, HnswParams, Metric, SearchParams, search},
    map::{About, MapFile, MapWriter, OpenMap, Opening, RowType},
};

const DIM: usize = 24;

/// Rows in clusters, as images of places are.
fn rows(n_rows: usize, seed: u64) -> Descriptors {
    let mut centers = ChaCha8Rng::seed_from_u64(99);
    let centers: Vec<f32> = (0..40 * DIM).map(|_| centers.random_range(-1.0_f32..1.0)).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut rows = Array2::zeros((n_rows, DIM));
    for mut row in rows.outer_iter_mut() {
        let center = rng.random_range(0..40) * DIM;
        for (value, center) in row.iter_mut().zip(&centers[center..]) {
            *value = 3.0 * (center + rng.random_range(-0.3_f32..0.3));
        }
    }
    Descriptors::new(rows).unwrap()
}

fn build(rows: &Descriptors, metric: Metric, params: &HnswParams) -> Hnsw {
    Hnsw::build(rows, metric, params, None).unwrap()
}

#[test]
fn every_metric_and_code_finds_nearly_all_neighbours_at_their_exact_distances() {
    let (references, queries) = (rows(3000, 1), rows(100, 2));
    for metric in [Metric::Euclidean, Metric::Cosine, Metric::InnerProduct] {
        for codes in [HnswCodes::F32, HnswCodes::F16, HnswCodes::Int8] {
            let mut hnsw =
                build(&references, metric, &HnswParams { codes, ..HnswParams::default() });
            let measured = hnsw.measure(&references, &queries, 10).unwrap();
            // A graph of inner products is a heuristic: that "distance" is no distance.
            let least = if metric == Metric::InnerProduct { 0.9 } else { 0.98 };
            assert!(measured.recall > least, "{metric:?} {codes:?} {measured:?}");
            let found = hnsw.search(&references, &queries, 10).unwrap();
            for query in 0..queries.len() {
                let values = &queries.as_slice()[query * DIM..][..DIM];
                let mut nearer = f32::NEG_INFINITY;
                for (&index, &distance) in found.indices(query).iter().zip(found.distances(query)) {
                    let row = &references.as_slice()[index * DIM..][..DIM];
                    assert_eq!(distance, metric.distance(values, row));
                    assert!(distance >= nearer);
                    nearer = distance;
                }
            }
        }
    }
}

#[test]
fn the_recall_that_is_kept_is_that_against_exact_search() {
    let (references, queries) = (rows(2000, 3), rows(50, 4));
    let poor =
        HnswParams { expansion_search: 1, oversample: 1, connectivity: 2, ..HnswParams::default() };
    let mut hnsw = build(&references, Metric::Euclidean, &poor);
    let measured = hnsw.measure(&references, &queries, 5).unwrap();
    let params = SearchParams { k: 5, ..SearchParams::default() };
    let exact = search(&references, &queries, &params).unwrap();
    let found = hnsw.search(&references, &queries, 5).unwrap();
    let shared = (0..50).flat_map(|query| {
        let found = found.indices(query).to_vec();
        exact.indices(query).to_vec().into_iter().filter(move |index| found.contains(index))
    });
    assert_eq!(measured.recall, shared.count() as f64 / 250.0);
    assert!(measured.recall < 1.0, "this graph is too poor to find everything");
    hnsw.set_expansion_search(200);
    assert_eq!(hnsw.recall(), None);
    assert!(hnsw.measure(&references, &queries, 5).unwrap().recall > measured.recall);
}

#[test]
fn building_and_searching_give_the_same_bits_for_any_number_of_threads() {
    let (references, queries) = (rows(2000, 5), rows(64, 6));
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let hnsw = build(&references, Metric::Euclidean, &HnswParams::default());
            hnsw.search(&references, &queries, 10).unwrap()
        })
    };
    assert_eq!(with(1), with(8));
}

#[test]
fn an_opened_index_finds_what_the_saved_one_found() {
    let folder = tempfile::tempdir().unwrap();
    let (references, queries) = (rows(2000, 7), rows(50, 8));
    let map = folder.path().join("map.safetensors");
    let mut writer = MapWriter::create(&map, DIM, RowType::F32, About::default()).unwrap();
    writer.append(references.view(), None, None).unwrap();
    writer.finish().unwrap();
    let digest = OpenMap::open(&map, Opening::default()).unwrap().digest();
    let rows = MapFile::open(&map).unwrap();
    let mut hnsw =
        Hnsw::build(&rows, Metric::Cosine, &HnswParams::default(), Some(digest.clone())).unwrap();
    let measured = hnsw.measure(&rows, &queries, 10).unwrap();
    let path = folder.path().join("map.hnsw");
    hnsw.save(&path).unwrap();
    let opened = Hnsw::open(&path).unwrap();
    assert_eq!((opened.recall(), opened.source()), (Some(measured), Some(&*digest)));
    let found = |hnsw: &Hnsw| hnsw.search(&rows, &queries, 10).unwrap();
    assert_eq!(found(&opened), found(&hnsw));
}

#[test]
fn damage_is_found_before_usearch_sees_it() {
    let hnsw = build(&rows(100, 9), Metric::Cosine, &HnswParams::default());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("index.hnsw");
    hnsw.save(&path).unwrap();
    let sound = fs::read(&path).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    for round in 0..200 {
        let at = rng.random_range(0..sound.len());
        let mut bytes = sound.clone();
        if round % 2 == 0 {
            bytes.truncate(at);
        } else {
            bytes[at] ^= 1 << rng.random_range(0..8);
        }
        fs::write(&path, &bytes).unwrap();
        assert!(matches!(Hnsw::open(&path), Err(Error::Format { .. })));
    }
    fs::write(&path, &sound).unwrap();
    Hnsw::open(&path).unwrap();
    let json = folder.path().join("index.hnsw.json");
    let text = fs::read(&json).unwrap();
    for _ in 0..200 {
        fs::write(&json, &text[..rng.random_range(0..text.len())]).unwrap();
        assert!(matches!(Hnsw::open(&path), Err(Error::Format { .. })));
    }
}

#[test]
fn what_does_not_fit_is_refused_and_small_maps_are_found_whole() {
    let references = rows(10, 10);
    let refused = Hnsw::build(&references, Metric::Manhattan, &HnswParams::default(), None);
    assert!(matches!(refused, Err(Error::Parameter { name: "metric", .. })));
    let hnsw = build(&references, Metric::Euclidean, &HnswParams::default());
    assert!(matches!(hnsw.search(&rows(9, 10), &references, 1), Err(Error::Mismatch { .. })));
    let params = SearchParams { k: 50, ..SearchParams::default() };
    let exact = search(&references, &references, &params).unwrap();
    assert_eq!(hnsw.search(&references, &references, 50).unwrap(), exact);
}

#[test]
fn equal_rows_do_not_leave_a_query_short() {
    let rows = Descriptors::new(Array2::ones((500, DIM))).unwrap();
    let params = HnswParams { connectivity: 2, expansion_search: 1, ..HnswParams::default() };
    let hnsw = build(&rows, Metric::Euclidean, &params);
    assert_eq!(hnsw.search(&rows, &rows, 20).unwrap().k(), 20);
}
