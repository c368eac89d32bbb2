//! The cities of training: generated streets, each place photographed on several visits.

use std::{fs, path::Path};

use anyhow::Context;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vpr_report::cli;
use vpr_worlds::{RENDERER, Recipe, Traverse, photograph_city, recipe_with};
use xxhash_rust::xxh3::xxh3_64;

use crate::pixels::Album;

/// Places of a city.
pub const PLACES: usize = 80;
/// Visits to it: each gives one image of every place.
pub const VISITS: usize = 5;
/// Avenues of a city: a quarter of the places lies on each.
pub const AVENUES: usize = 4;
/// Seed of the first city; the worlds that come with `vpr-worlds` have seeds below.
const FIRST_SEED: u64 = 5_001;
/// Width and height of an image: a crop of it becomes the network's input.
const SIZE: (usize, usize) = (160, 120);

/// The cities, rendered unless the cache has them: `PLACES × VISITS` images each, a place's visits
/// beside each other.
///
/// # Errors
///
/// A cache that cannot be written, by its path.
pub fn open(n: usize, seed: u64, cache: &Path) -> anyhow::Result<Vec<Album>> {
    fs::create_dir_all(cache).with_context(|| cache.display().to_string())?;
    let bar = cli::progress("cities", n);
    let mut albums = Vec::with_capacity(n);
    for city in 0..n as u64 {
        let (recipe, visits) = (recipe(seed, city)?, visits(seed, city));
        let digest = xxh3_64(format!("{recipe:?} {visits:?}").as_bytes());
        let path = cache.join(format!("training-{RENDERER}-{digest:016x}.rgb"));
        let bytes = match fs::read(&path) {
            Ok(bytes) if bytes.len() == PLACES * VISITS * 3 * SIZE.0 * SIZE.1 => bytes,
            _ => render(&recipe, &visits, &path)?,
        };
        albums.push(Album::new(bytes, SIZE));
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(albums)
}

fn render(recipe: &Recipe, visits: &[Traverse], path: &Path) -> anyhow::Result<Vec<u8>> {
    let photographs = photograph_city(recipe, visits)?;
    let bytes: Vec<u8> =
        photographs.into_iter().flat_map(|photograph| photograph.image.into_raw()).collect();
    let partial = path.with_extension("partial");
    fs::write(&partial, &bytes).with_context(|| partial.display().to_string())?;
    fs::rename(&partial, path).with_context(|| path.display().to_string())?;
    Ok(bytes)
}

/// Streets and camera of a city.
fn recipe(seed: u64, city: u64) -> anyhow::Result<Recipe> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(2 * city);
    let side = if random.random_bool(0.5) { 1.0 } else { -1.0 };
    let mut within = |low: f64, high: f64| random.random_range(low..high);
    let numbers = [
        ("camera.focal", within(95.0, 145.0)),
        ("street.spacing_m", within(9.0, 15.0)),
        ("street.heading_deg", side * within(12.0, 80.0)),
        ("street.trees", within(0.15, 0.7)),
        ("street.eye_m", within(1.5, 2.5)),
    ];
    let mut settings: Vec<(&str, String)> =
        numbers.iter().map(|(key, value)| (*key, format!("{value:.3}"))).collect();
    settings.extend([
        ("seed", (FIRST_SEED + city).to_string()),
        ("places", PLACES.to_string()),
        ("camera.width", SIZE.0.to_string()),
        ("camera.height", SIZE.1.to_string()),
        ("street.avenues", AVENUES.to_string()),
    ]);
    let pairs: Vec<(&str, &str)> =
        settings.iter().map(|(key, value)| (*key, value.as_str())).collect();
    Ok(recipe_with("train-city", &pairs)?)
}

/// Light, weather and viewpoint of every visit: two by day, one under clouds, one that is often by
/// night, one that is often in snow or fog.
fn visits(seed: u64, city: u64) -> Vec<Traverse> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(2 * city + 1);
    (0..VISITS).map(|number| visit(number, &mut random)).collect()
}

fn visit(number: usize, random: &mut ChaCha8Rng) -> Traverse {
    let mut visit = Traverse::default();
    let condition = &mut visit.condition;
    condition.cloud = if number == 2 { 0.95 } else { random.random_range(0.0..0.8) };
    condition.sun_elevation_deg = random.random_range(10.0..65.0);
    condition.sun_azimuth_deg = random.random_range(0.0..360.0);
    condition.autumn = random.random_range(0.0..0.8);
    condition.traffic = random.random_range(0.1..0.9);
    condition.changed = random.random_range(0.0..0.3);
    if number == 3 && random.random_bool(0.7) {
        condition.darkness = random.random_range(0.4..1.0);
        condition.headlights = random.random_range(0.0..5.0);
        condition.max_gain = random.random_range(5.0..12.0);
    }
    if number == 4 && random.random_bool(0.5) {
        condition.snow = random.random_range(0.3..1.0);
        condition.bare = random.random_range(0.0..1.0);
        condition.falling = random.random_range(0.0..0.4);
    }
    if number == 4 && random.random_bool(0.5) {
        condition.visibility_m = random.random_range(70.0..500.0);
    }
    if number == 1 {
        condition.occlusion = random.random_range(0.0..0.15);
    }
    visit.offset.lateral_m = random.random_range(-1.5..1.5);
    visit.offset.yaw_deg = random.random_range(-8.0..8.0);
    visit.offset.pitch_deg = random.random_range(-2.0..4.0);
    visit.offset.jitter = random.random_range(0.2..0.9);
    visit.film.blur_px = random.random_range(0.0..0.5);
    visit.film.noise = random.random_range(0.002..0.015);
    visit
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_city_is_a_valid_street_with_seeds_of_its_own() {
        for city in 0..40 {
            let recipe = recipe(7, city).unwrap();
            assert!(recipe.seed > 5_000 && recipe.street.is_some());
            assert_eq!(visits(7, city).len(), VISITS);
            assert_eq!(visits(7, city), visits(7, city));
        }
        assert_ne!(visits(7, 0), visits(7, 1));
    }
}
