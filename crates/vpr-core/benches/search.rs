//! `cargo bench -p vpr-core`: exact search by metric and batch, rows as f32, f16, int8 and signs, maps
//! on disk, searches near a position, and with `--features approximate` graphs.
//!
//! Machines differ in memory bandwidth more than in anything else: compare with `plain_read`, one
//! pass over the same bytes.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "an example prints, and stops at the first error"
)]

use std::{hint::black_box, path::PathBuf};

use divan::{Bencher, counter::BytesCount};
use ndarray::Array2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vpr_core::{
    Descriptors, PlanarPosition, Poses,
    knn::{
        F16Rows, Int8Rows, Metric, Pca, PcaParams, PositionIndex, RowSource, SearchParams,
        SignRows, rescore, search, search_among,
    },
    map::{About, Access, MapFile, MapWriter, Opening, RowType},
};

const N_REFERENCES: usize = 20_000;
const DIM: usize = 512;

fn main() {
    divan::main();
}

fn unit_rows(n_rows: usize) -> Descriptors {
    let mut rng = ChaCha8Rng::seed_from_u64(n_rows as u64);
    let rows = Array2::from_shape_simple_fn((n_rows, DIM), || rng.random_range(-1.0_f32..1.0));
    Descriptors::new(rows).expect("finite").normalized()
}

fn run(bencher: Bencher<'_, '_>, rows: &dyn RowSource, metric: Metric, batch: usize) {
    let queries = unit_rows(batch);
    let params = SearchParams { metric, ..SearchParams::default() };
    bencher
        .counter(BytesCount::of_many::<f32>(N_REFERENCES * DIM))
        .bench_local(|| search(rows, black_box(&queries), &params).expect("valid"));
}

#[divan::bench(args = [1, 4, 100], sample_count = 20)]
fn euclidean(bencher: Bencher<'_, '_>, batch: usize) {
    run(bencher, &unit_rows(N_REFERENCES), Metric::Euclidean, batch);
}

#[divan::bench(args = [1, 4, 100], sample_count = 20)]
fn inner_product(bencher: Bencher<'_, '_>, batch: usize) {
    run(bencher, &unit_rows(N_REFERENCES), Metric::InnerProduct, batch);
}

#[divan::bench(args = [1, 100], sample_count = 10)]
fn cosine(bencher: Bencher<'_, '_>, batch: usize) {
    run(bencher, &unit_rows(N_REFERENCES), Metric::Cosine, batch);
}

#[divan::bench(args = [1, 100], sample_count = 10)]
fn manhattan(bencher: Bencher<'_, '_>, batch: usize) {
    run(bencher, &unit_rows(N_REFERENCES), Metric::Manhattan, batch);
}

#[divan::bench(args = [1, 100], sample_count = 10)]
fn f16(bencher: Bencher<'_, '_>, batch: usize) {
    let rows = F16Rows::encode(&unit_rows(N_REFERENCES)).expect("small values");
    run(bencher, &rows, Metric::Euclidean, batch);
}

#[divan::bench(args = [1, 100], sample_count = 10)]
fn int8(bencher: Bencher<'_, '_>, batch: usize) {
    run(bencher, &Int8Rows::encode(&unit_rows(N_REFERENCES)), Metric::Euclidean, batch);
}

#[divan::bench(args = [1, 100], sample_count = 10)]
fn signs_rescored(bencher: Bencher<'_, '_>, batch: usize) {
    let (rows, queries) = (unit_rows(N_REFERENCES), unit_rows(batch));
    let (signs, query_signs) = (SignRows::encode(&rows), SignRows::encode(&queries));
    bencher.bench_local(|| {
        let candidates = signs.nearest(black_box(&query_signs), 100);
        rescore(&rows, &queries, &candidates, &SearchParams::default()).expect("valid")
    });
}

/// A map of the references in a folder that goes away.
fn map_file(row_type: RowType) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.safetensors");
    let mut writer = MapWriter::create(&path, DIM, row_type, About::default()).unwrap();
    writer.append(unit_rows(N_REFERENCES).view(), None, None).unwrap();
    writer.finish().unwrap();
    (folder, path)
}

#[divan::bench(sample_count = 50)]
fn open_a_map(bencher: Bencher<'_, '_>) {
    let (_folder, path) = map_file(RowType::F32);
    bencher.bench_local(|| MapFile::open(black_box(&path)).expect("a sound map"));
}

/// Checks every block on the way.
#[divan::bench(args = [Access::Mapped, Access::Read], sample_count = 20)]
fn first_query_from_disk(bencher: Bencher<'_, '_>, access: Access) {
    let (_folder, path) = map_file(RowType::F32);
    let (query, opening) = (unit_rows(1), Opening { access, trust: false });
    bencher
        .counter(BytesCount::of_many::<f32>(N_REFERENCES * DIM))
        .with_inputs(|| MapFile::open_with(&path, opening).expect("a sound map"))
        .bench_local_refs(|map| search(map, &query, &SearchParams::default()).expect("valid"));
}

#[divan::bench(args = [RowType::F32, RowType::F16, RowType::I8], sample_count = 10)]
fn batch_from_disk(bencher: Bencher<'_, '_>, row_type: RowType) {
    let (_folder, path) = map_file(row_type);
    let map = MapFile::open_with(&path, Opening { access: Access::Read, trust: true });
    run(bencher, &map.expect("a sound map"), Metric::Euclidean, 100);
}

#[divan::bench(sample_count = 10)]
fn write_a_map(bencher: Bencher<'_, '_>) {
    bencher.bench_local(|| map_file(RowType::F32));
}

/// One of a hundred references is within the radius.
#[divan::bench(sample_count = 100)]
fn near_a_position(bencher: Bencher<'_, '_>) {
    let (rows, query) = (unit_rows(N_REFERENCES), unit_rows(1));
    let position = |row: usize| PlanarPosition::new((row % 200) as f64, (row / 200) as f64);
    let poses = Poses::Planar((0..N_REFERENCES).map(position).collect());
    let index = PositionIndex::new(&poses).expect("finite");
    bencher.bench_local(|| {
        let among = index.within([100.0, 50.0, 0.0].into(), 8.0).expect("finite");
        search_among(&rows, among, &query, &SearchParams::default()).expect("valid")
    });
}

#[cfg(feature = "approximate")]
#[divan::bench(args = [1, 100], sample_count = 20)]
fn graph(bencher: Bencher<'_, '_>, batch: usize) {
    use vpr_core::knn::{Hnsw, HnswParams};
    let (rows, queries) = (unit_rows(N_REFERENCES), unit_rows(batch));
    let graph = Hnsw::build(&rows, Metric::Euclidean, &HnswParams::default(), None);
    let graph = graph.expect("valid");
    bencher.bench_local(|| graph.search(&rows, black_box(&queries), 10).expect("valid"));
}

#[divan::bench(sample_count = 2)]
fn fit_pca_of_64(bencher: Bencher<'_, '_>) {
    let rows = unit_rows(1000);
    let params = PcaParams { n_components: 64, whiten: true };
    bencher.bench_local(|| Pca::fit(black_box(&rows), &params).expect("valid"));
}

#[divan::bench(sample_count = 20)]
fn plain_read(bencher: Bencher<'_, '_>) {
    let rows = unit_rows(N_REFERENCES);
    bencher.counter(BytesCount::of_many::<f32>(N_REFERENCES * DIM)).bench_local(|| {
        black_box(rows.as_slice()).iter().fold(0, |all, value| all ^ value.to_bits())
    });
}
