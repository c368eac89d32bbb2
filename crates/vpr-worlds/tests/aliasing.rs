//! At full aliasing an ideal appearance matcher finds one of the look-alikes, no matter which.

use vpr_worlds::{World, recipe_with};

/// Recall@1 of comparing images pixel by pixel, same poses, other noise.
fn recall(aliasing: &str) -> (f64, usize) {
    let cache = tempfile::tempdir().unwrap();
    let settings = [
        ("street.aliasing", aliasing),
        ("camera.width", "80"),
        ("camera.height", "60"),
        ("camera.focal", "57.0"),
        ("references.film.noise", "0.02"),
        ("queries.film.noise", "0.02"),
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
    let best = queries.iter().map(|query| {
        (0..references.len()).min_by_key(|&index| distance(query, &references[index])).unwrap()
    });
    let correct = world.dataset.truth.judge(&best.collect::<Vec<_>>()).unwrap();
    (correct.iter().filter(|&&ok| ok).count() as f64 / correct.len() as f64, correct.len())
}

#[test]
fn full_aliasing_divides_recall_by_the_number_of_look_alikes() {
    let (unique, n) = recall("0.0");
    let (aliased, _) = recall("1.0");
    println!(
        "recall@1: {unique:.3} without aliasing, {aliased:.3} with 4 look-alikes, {n} queries"
    );
    assert!(unique > 0.97, "{unique}");
    // 95 % of draws of n places with chance 1/4 lie within 1.96 standard deviations.
    let spread = 1.96 * (0.25 * 0.75 / n as f64).sqrt();
    assert!((aliased - 0.25).abs() <= spread, "{aliased} is not within {spread:.3} of 1/4");
}
