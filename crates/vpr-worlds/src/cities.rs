//! The cities of training: generated streets, each place photographed on several visits.

use std::{fs, path::Path};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vpr_core::{Error, Observer, Result};
use vpr_files::replace;
use xxhash_rust::xxh3::xxh3_64;

use crate::{RENDERER, Recipe, Traverse, photograph_city, recipe_with};

/// Places of a city.
pub const PLACES: usize = 80;
/// Visits to it: each gives one image of every place.
pub const VISITS: usize = 5;
/// Avenues of a city: a quarter of the places lies on each.
pub const AVENUES: usize = 4;
/// Seed of the first city; the worlds that come with `vpr-worlds` have seeds below.
const FIRST_SEED: u64 = 5_001;
/// Width and height of an image: a crop of it becomes a network's input.
pub const SIZE: (usize, usize) = (160, 120);

/// The pixels of `n` cities, rendered unless the cache has them: of each `PLACES × VISITS` images
/// back to back, rows of red, green, blue at [`SIZE`], a place's visits beside each other.
///
/// # Errors
///
/// [`Error::Io`] with the path, if the cache cannot be written.
pub fn open(n: usize, seed: u64, cache: &Path, observer: &dyn Observer) -> Result<Vec<Vec<u8>>> {
    fs::create_dir_all(cache).map_err(Error::io(cache))?;
    observer.start("cities", n);
    let mut cities = Vec::with_capacity(n);
    for city in 0..n as u64 {
        let (recipe, visits) = (recipe(seed, city)?, visits(seed, city));
        let path = cache.join(file_name(&recipe, &visits));
        let bytes = match fs::read(&path) {
            Ok(bytes) if bytes.len() == PLACES * VISITS * 3 * SIZE.0 * SIZE.1 => bytes,
            _ => render(&recipe, &visits, &path)?,
        };
        cities.push(bytes);
        observer.step();
    }
    observer.end();
    Ok(cities)
}

/// Where a city lies in the cache: under a digest of all that decides it.
fn file_name(recipe: &Recipe, visits: &[Traverse]) -> String {
    let digest = xxh3_64(format!("{recipe:?} {visits:?}").as_bytes());
    format!("training-{RENDERER}-{digest:016x}.rgb")
}

fn render(recipe: &Recipe, visits: &[Traverse], path: &Path) -> Result<Vec<u8>> {
    let photographs = photograph_city(recipe, visits)?;
    let bytes: Vec<u8> =
        photographs.into_iter().flat_map(|photograph| photograph.image.into_raw()).collect();
    replace(path, &bytes)?;
    Ok(bytes)
}

/// Streets and camera of a city.
fn recipe(seed: u64, city: u64) -> Result<Recipe> {
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
    recipe_with("train-city", &pairs)
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

    /// The file's name is a digest of streets, camera, light and viewpoints: a seed gives the
    /// cities it has always given, and what was rendered is found again.
    #[test]
    fn a_seed_gives_the_cities_it_has_always_given() {
        for (seed, city, name) in [
            (1, 0, "training-5-d0e1d04a8711b0dd.rgb"),
            (1, 1, "training-5-a15566b77aa69c1f.rgb"),
            (7, 39, "training-5-43aa309789f7d507.rgb"),
        ] {
            assert_eq!(file_name(&recipe(seed, city).unwrap(), &visits(seed, city)), name);
        }
    }

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
