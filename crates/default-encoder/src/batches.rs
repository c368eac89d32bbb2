//! Which images a step sees: a function of the seed and the step alone.

use std::ops::Range;

use rand::{RngExt, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use vpr_nets::train::Batch;

use crate::{
    augment::augment,
    cities::{AVENUES, PLACES, VISITS},
    pixels::Album,
};

/// How many images a step sees.
#[derive(Clone, Copy, Debug)]
pub struct Sizes {
    /// Width and height that the network takes.
    pub input: (usize, usize),
    /// Places, a multiple of four.
    pub places: usize,
    /// Images of each place, up to [`VISITS`].
    pub views: usize,
}

/// Neighbouring places of one city in a step: what a network confuses first.
const FROM_ONE_CITY: usize = 4;

/// The batch of a step.
#[must_use]
pub fn batch(cities: &[Album], sizes: Sizes, seed: u64, step: usize) -> Batch {
    let size = sizes.input;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(step as u64 + 1);
    let mut order: Vec<usize> = (0..cities.len()).collect();
    order.shuffle(&mut random);
    let mut chosen = Vec::new();
    let mut number = 0;
    for city in order.into_iter().cycle().take(sizes.places / FROM_ONE_CITY) {
        for place in neighbours(&mut random) {
            let mut views: Vec<usize> = (0..VISITS).collect();
            views.shuffle(&mut random);
            for view in views.into_iter().take(sizes.views) {
                chosen.push((city, place * VISITS + view, number, random.random::<u64>()));
            }
            number += 1;
        }
    }
    let each = 3 * size.0 * size.1;
    let mut images = vec![0.0; each * chosen.len()];
    images.par_chunks_mut(each).zip(&chosen).for_each(|(output, &(city, image, _, seed))| {
        augment(cities[city].get(image), size, seed, output);
    });
    Batch { images, size, places: chosen.iter().map(|&(_, _, place, _)| place).collect() }
}

/// One variant of every image of a city, `PLACES × VISITS` of them.
#[must_use]
pub fn variants(city: &Album, size: (usize, usize), seed: u64) -> Vec<f32> {
    let each = 3 * size.0 * size.1;
    let mut images = vec![0.0; each * PLACES * VISITS];
    images.par_chunks_mut(each).enumerate().for_each(|(number, output)| {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(number as u64);
        augment(city.get(number), size, random.random::<u64>(), output);
    });
    images
}

/// Places behind one another on one avenue.
fn neighbours(random: &mut ChaCha8Rng) -> Range<usize> {
    let per_avenue = PLACES / AVENUES;
    let avenue = random.random_range(0..AVENUES);
    let first = avenue * per_avenue + random.random_range(0..=per_avenue - FROM_ONE_CITY);
    first..first + FROM_ONE_CITY
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_are_on_one_avenue() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..200 {
            let places = neighbours(&mut random);
            assert_eq!(places.len(), FROM_ONE_CITY);
            assert_eq!(places.start / 20, (places.end - 1) / 20);
            assert!(places.end <= PLACES);
        }
    }
}
