//! The cities of training: generated streets, each place seen four times.

use std::path::{Path, PathBuf};

use anyhow::Context;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vpr_core::cli;
use vpr_worlds::{Side, World, recipe_with};

/// Places of a city.
pub(crate) const PLACES: usize = 80;
/// Images of a place: two drives through the first world of a city, two through its second.
pub(crate) const VIEWS: usize = 4;
/// Avenues of a city: a quarter of the places lies on each.
pub(crate) const AVENUES: usize = 4;
/// Seed of the first city; the worlds that come with `vpr-worlds` have seeds below.
const FIRST_SEED: u64 = 5_001;

/// The images of one city: `PLACES × VIEWS` paths, a place's views beside each other.
pub(crate) struct City {
    pub(crate) images: Vec<PathBuf>,
}

/// Renders the cities that are not in the cache yet and lists their images.
pub(crate) fn open(n: usize, seed: u64, cache: &Path) -> anyhow::Result<Vec<City>> {
    let bar = cli::progress("cities", n * PLACES * VIEWS);
    let mut cities = Vec::with_capacity(n);
    for city in 0..n as u64 {
        let mut sides = Vec::with_capacity(VIEWS);
        for half in 0..2 {
            let settings = settings(seed, city, half);
            let pairs: Vec<(&str, &str)> =
                settings.iter().map(|(key, value)| (*key, value.as_str())).collect();
            let recipe = recipe_with("world/train-city", &pairs)?;
            let world = World::open(&recipe, cache, &|| bar.inc(1))
                .with_context(|| format!("city {city}"))?;
            for side in [Side::References, Side::Queries] {
                sides.push(world.images(side)?);
            }
        }
        let images =
            (0..PLACES).flat_map(|place| sides.iter().map(move |side| side[place].clone()));
        cities.push(City { images: images.collect() });
    }
    bar.finish_and_clear();
    Ok(cities)
}

/// How the recipe of one half of a city differs from `world/train-city`.
fn settings(seed: u64, city: u64, half: u64) -> Vec<(&'static str, String)> {
    let mut layout = ChaCha8Rng::seed_from_u64(seed ^ (2 * city + 1));
    let mut within = |low: f64, high: f64| format!("{:.3}", layout.random_range(low..high));
    let mut settings = vec![
        ("seed", (FIRST_SEED + city).to_string()),
        ("layout", "\"vpr-bench\"".to_owned()),
        ("tolerance", "{ frames = 0 }".to_owned()),
        ("places", PLACES.to_string()),
        ("camera.width", "160".to_owned()),
        ("camera.height", "120".to_owned()),
        ("camera.focal", within(95.0, 145.0)),
        ("street.spacing_m", within(22.0, 28.0)),
        ("street.avenues", AVENUES.to_string()),
        ("street.heading_deg", within(-100.0, 100.0)),
        ("street.trees", within(0.15, 0.75)),
        ("street.eye_m", within(1.4, 2.6)),
    ];
    let mut drive = ChaCha8Rng::seed_from_u64(seed ^ (1 << 32) ^ (2 * city + half));
    let mut chance = |share: f64| drive.random_bool(share);
    let kinds = [
        [half == 1 && chance(0.4), chance(0.15), chance(0.4)],
        [half == 1 && chance(0.6), chance(0.25), chance(0.4)],
    ];
    for (side, [night, snow, fog]) in ["references", "queries"].into_iter().zip(kinds) {
        settings.extend(traverse(side, [night, snow, fog], half, &mut drive));
    }
    settings
}

/// Light, weather and viewpoint of one drive.
fn traverse(
    side: &'static str,
    [night, snow, fog]: [bool; 3],
    half: u64,
    random: &mut ChaCha8Rng,
) -> Vec<(&'static str, String)> {
    let mut within = |low: f64, high: f64| format!("{:.3}", random.random_range(low..high));
    let mut numbers = vec![
        ("condition.cloud", within(0.0, 1.0)),
        ("condition.sun_elevation_deg", within(8.0, 65.0)),
        ("condition.sun_azimuth_deg", within(0.0, 360.0)),
        ("condition.autumn", within(0.0, 0.9)),
        ("condition.traffic", within(0.1, 0.9)),
        ("condition.changed", within(0.0, 0.35)),
        ("offset.lateral_m", within(-1.8, 1.8)),
        ("offset.yaw_deg", within(-14.0, 14.0)),
        ("offset.pitch_deg", within(-3.0, 5.0)),
        ("offset.jitter", within(0.4, 1.4)),
        ("film.blur_px", within(0.0, 0.6)),
        ("film.noise", within(0.002, 0.03)),
    ];
    if half == 1 {
        numbers.push(("condition.bare", within(0.0, 1.0)));
        numbers.push(("condition.occlusion", within(0.0, 0.2)));
    }
    if night {
        numbers.push(("condition.darkness", within(0.6, 1.0)));
        numbers.push(("condition.headlights", within(0.0, 5.0)));
        numbers.push(("condition.max_gain", within(5.0, 12.0)));
    }
    if snow {
        numbers.push(("condition.snow", within(0.3, 1.0)));
        numbers.push(("condition.falling", within(0.0, 0.5)));
    }
    if fog {
        numbers.push(("condition.visibility_m", within(60.0, 600.0)));
    }
    numbers.into_iter().map(|(key, value)| (name(side, key), value)).collect()
}

/// The full key of a traverse's number.
fn name(side: &str, key: &str) -> &'static str {
    Box::leak(format!("{side}.{key}").into_boxed_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_city_is_a_valid_recipe_and_both_halves_share_its_houses() {
        for city in 0..40 {
            let mut seeds = Vec::new();
            for half in 0..2 {
                let settings = settings(7, city, half);
                let pairs: Vec<(&str, &str)> =
                    settings.iter().map(|(key, value)| (*key, value.as_str())).collect();
                let recipe = recipe_with("world/train-city", &pairs).unwrap();
                seeds.push((recipe.seed, recipe.street, recipe.camera));
                assert!(recipe.seed > 5_000 && recipe.rail.is_none());
            }
            assert_eq!(seeds[0], seeds[1]);
        }
    }
}
