//! More of a nuisance makes the images of a place less alike.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test fails by panicking and prints what it measured"
)]

use image::{GrayImage, imageops::grayscale};
use vpr_worlds::{Scenery, Side, recipe_with};

const SIZE: [(&str, &str); 4] =
    [("places", "14"), ("camera.width", "80"), ("camera.height", "60"), ("camera.focal", "57.5")];

/// Normalised cross-correlation of two images: 1 alike, 0 unrelated.
fn correlation(a: &GrayImage, b: &GrayImage) -> f64 {
    let centred = |image: &GrayImage| -> Vec<f64> {
        let values: Vec<f64> = image.as_raw().iter().map(|&value| f64::from(value)).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.into_iter().map(|value| value - mean).collect()
    };
    let (a, b) = (centred(a), centred(b));
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    dot(&a, &b) / (dot(&a, &a) * dot(&b, &b)).sqrt().max(1e-9)
}

/// Mean correlation of queries with the references of their places.
fn alike(world: &str, settings: &[(&str, &str)]) -> f64 {
    let all: Vec<_> = SIZE.iter().chain(settings).copied().collect();
    let scenery = Scenery::new(&recipe_with(world, &all).unwrap()).unwrap();
    let gray = |side| -> Vec<GrayImage> { scenery.images(side).iter().map(grayscale).collect() };
    let (queries, references) = (gray(Side::Queries), gray(Side::References));
    let each = queries.iter().enumerate().map(|(index, query)| {
        correlation(query, &references[scenery.place(Side::Queries, index).unwrap()])
    });
    each.sum::<f64>() / queries.len() as f64
}

/// Correlations along a dial; they must fall from step to step.
fn falls(world: &str, fixed: &[(&str, &str)], key: &str, values: &[&str]) {
    let along: Vec<f64> = values
        .iter()
        .map(|value| {
            let settings: Vec<_> = fixed.iter().copied().chain([(key, *value)]).collect();
            alike(world, &settings)
        })
        .collect();
    let shown: Vec<String> = along.iter().map(|value| format!("{value:.3}")).collect();
    println!("{world}, {key} = {values:?}: {}", shown.join(" "));
    assert!(along.windows(2).all(|pair| pair[1] < pair[0]), "{world}, {key}: {along:?}");
    assert!(along[along.len() - 1] < along[0] - 0.1, "{world}, {key}: {along:?}");
}

/// Both traverses of a city alike in all but what is set.
const SAME: [(&str, &str); 6] = [
    ("layout", "\"vpr-bench\""),
    ("tolerance", "{ frames = 0 }"),
    ("queries.offset", "{}"),
    ("queries.condition", "{ traffic = 0.0 }"),
    ("references.condition.traffic", "0.0"),
    ("street.heading_deg", "45.0"),
];

#[test]
fn every_dial_of_a_city_makes_its_places_less_alike() {
    for (key, values) in [
        ("queries.offset.lateral_m", ["0.0", "-0.5", "-1.0", "-2.0"]),
        ("queries.offset.yaw_deg", ["0.0", "4.0", "8.0", "16.0"]),
        ("queries.condition.darkness", ["0.0", "0.5", "0.75", "1.0"]),
        ("queries.condition.snow", ["0.0", "0.3", "0.6", "1.0"]),
        ("queries.condition.occlusion", ["0.0", "0.25", "0.5", "0.75"]),
        ("queries.condition.visibility_m", ["2500.0", "150.0", "40.0", "10.0"]),
        ("queries.condition.traffic", ["0.0", "0.3", "0.6", "1.0"]),
        ("queries.film.noise", ["0.0", "0.05", "0.15", "0.4"]),
    ] {
        falls("street", &SAME, key, &values);
    }
}

#[test]
fn dials_turn_in_the_other_families_too() {
    let same = [("queries.offset", "{}"), ("queries.condition", "{ traffic = 0.0 }")];
    falls("rail", &same, "queries.condition.snow", &["0.0", "0.4", "0.9"]);
    falls("rail", &same, "queries.condition.occlusion", &["0.0", "0.25", "0.75"]);
    falls("campus", &same, "queries.condition.darkness", &["0.0", "0.5", "1.0"]);
    falls("corridor", &same, "queries.offset.lateral_m", &["0.0", "0.3", "0.7"]);
    falls("corridor", &same, "queries.condition.occlusion", &["0.0", "0.25", "0.75"]);
    falls("rooms", &same, "queries.condition.changed", &["0.0", "0.4", "1.0"]);
}
