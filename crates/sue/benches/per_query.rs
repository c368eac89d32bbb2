//! Time of the efficient estimators for a batch of 10 000 queries on one thread, K = 10.
//!
//! Divide by 10 000 for the time per query: `cargo bench -p sue`.

use divan::{Bencher, black_box};
use ndarray::Array2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sue::{
    Density, DensityCompensatedSue, L2Distance, Neighbors, PaScore, Places, StatisticalUncertainty,
    Sue, UncertaintyEstimator,
};
use vpr_core::{PlanarPosition, Poses, Retrieval};

const QUERIES: usize = 10_000;
const REFERENCES: usize = 20_000;

fn main() {
    divan::main();
}

/// Random neighbours of a random map, at distances like those of unit descriptors.
fn world() -> (Retrieval, Poses) {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let place = |rng: &mut ChaCha8Rng| {
        PlanarPosition::new(rng.random_range(0.0..5e3), rng.random_range(0.0..5e3))
    };
    let poses = Poses::Planar((0..REFERENCES).map(|_| place(&mut rng)).collect());
    let indices = Array2::from_shape_simple_fn((QUERIES, 10), || rng.random_range(0..REFERENCES));
    let mut distances = Array2::from_shape_simple_fn((QUERIES, 10), || rng.random_range(0.5..1.2));
    for mut row in distances.outer_iter_mut() {
        row.as_slice_mut().expect("contiguous").sort_by(f32::total_cmp);
    }
    (Retrieval::new(indices, distances).expect("sorted"), poses)
}

fn places(
    bencher: Bencher,
    estimator: &impl for<'a> UncertaintyEstimator<Evidence<'a> = Places<'a>>,
) {
    let (retrieval, poses) = world();
    let evidence = Places::from_poses(&retrieval, &poses).expect("a map");
    let mut out = vec![0.0; QUERIES];
    bencher.bench_local(|| estimator.estimate_into(black_box(&evidence), &mut out));
}

fn neighbors(
    bencher: Bencher,
    estimator: &impl for<'a> UncertaintyEstimator<Evidence<'a> = Neighbors<'a>>,
) {
    let (retrieval, _) = world();
    let evidence = Neighbors::new(&retrieval).expect("queries");
    let mut out = vec![0.0; QUERIES];
    bencher.bench_local(|| estimator.estimate_into(black_box(&evidence), &mut out));
}

#[divan::bench]
fn l2_distance(bencher: Bencher) {
    neighbors(bencher, &L2Distance);
}

#[divan::bench]
fn pa_score(bencher: Bencher) {
    neighbors(bencher, &PaScore);
}

#[divan::bench]
fn statistical_uncertainty(bencher: Bencher) {
    neighbors(bencher, &StatisticalUncertainty);
}

#[divan::bench]
fn sue_corrected(bencher: Bencher) {
    places(bencher, &Sue::corrected());
}

#[divan::bench]
fn sue_published(bencher: Bencher) {
    places(bencher, &Sue::published());
}

#[divan::bench]
fn sue_density_compensated(bencher: Bencher) {
    let (_, poses) = world();
    let sue = DensityCompensatedSue::new(Sue::corrected(), &poses, 1, Density::Distinct);
    places(bencher, &sue.expect("a map"));
}
