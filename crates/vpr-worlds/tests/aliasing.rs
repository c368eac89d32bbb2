//! At full aliasing an ideal appearance matcher finds one of the look-alikes, no matter which.
//!
//! Look-alikes are not the same bytes: edges differ where f32 rounds differently far from the
//! origin. The ideal matcher therefore holds images for equal that differ by less than 8 grey
//! levels RMS, which is below what sensor noise does, and picks among them at random.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test fails by panicking and prints what it measured"
)]

use vpr_worlds::{World, recipe_with};

/// Mean squared difference below which images are equal to the eye.
const EQUAL: u64 = 64;

/// Recall@1 of comparing images pixel by pixel, same poses, other noise: the expectation over the
/// draw among equal ones.
fn recall(aliasing: &str) -> (f64, usize) {
    let cache = tempfile::tempdir().unwrap();
    let settings = [
        ("street.aliasing", aliasing),
        ("camera.width", "80"),
        ("camera.height", "60"),
        ("camera.focal", "57.0"),
        ("references.film.noise", "0.003"),
        ("queries.film.noise", "0.003"),
    ];
    let recipe = recipe_with("street-aliased", &settings).unwrap();
    let world = World::open(&recipe, cache.path(), &|| {}).unwrap();
    let pixels = |paths: &[std::path::PathBuf]| -> Vec<Vec<u8>> {
        paths.iter().map(|path| image::open(path).unwrap().to_rgb8().into_raw()).collect()
    };
    let (queries, references) = (pixels(&world.dataset.queries), pixels(&world.dataset.references));
    let distance = |a: &[u8], b: &[u8]| -> u64 {
        a.iter().zip(b).map(|(a, b)| u64::from(a.abs_diff(*b)).pow(2)).sum()
    };
    let mut sum = 0.0;
    for (index, query) in queries.iter().enumerate() {
        let each: Vec<u64> =
            references.iter().map(|reference| distance(query, reference)).collect();
        let nearest = each.iter().copied().min().unwrap();
        let limit = nearest.max(EQUAL * query.len() as u64);
        let equal: Vec<usize> = (0..each.len()).filter(|&r| each[r] <= limit).collect();
        let n_correct = equal.iter().filter(|&&r| world.dataset.truth.is_correct(index, r)).count();
        sum += n_correct as f64 / equal.len() as f64;
    }
    (sum / queries.len() as f64, queries.len())
}

#[test]
fn full_aliasing_divides_recall_by_the_number_of_look_alikes() {
    let (unique, n) = recall("0.0");
    let (aliased, _) = recall("1.0");
    println!(
        "recall@1: {unique:.3} without aliasing, {aliased:.3} with 4 look-alikes, {n} queries"
    );
    assert!(unique > 0.97, "{unique}");
    assert!((aliased - 0.25).abs() < 0.02, "{aliased} is not 1/4");
}
