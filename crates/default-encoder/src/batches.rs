//! Which images a step sees: a function of the seed and the step alone.

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
#[derive(Clone, Copy)]
pub(crate) struct Sizes {
    /// Width and height that the network takes.
    pub(crate) input: (usize, usize),
    /// Places, a multiple of [`FROM_ONE_CITY`].
    pub(crate) places: usize,
    /// Images of each place, up to [`VISITS`].
    pub(crate) views: usize,
}

/// Places of one city in a step; they look more alike than those of different cities.
const FROM_ONE_CITY: usize = 4;
/// Places of one city in a step are at least so far apart along an avenue: more than 60 m.
const APART: usize = 3;

/// The batch of a step.
pub(crate) fn batch(cities: &[Album], sizes: Sizes, seed: u64, step: usize) -> Batch {
    let size = sizes.input;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(step as u64 + 1);
    let mut order: Vec<usize> = (0..cities.len()).collect();
    order.shuffle(&mut random);
    let mut chosen = Vec::new();
    let mut number = 0;
    for city in order.into_iter().cycle().take(sizes.places / FROM_ONE_CITY) {
        for place in apart(&mut random) {
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

/// Places of one city, none near another.
fn apart(random: &mut ChaCha8Rng) -> Vec<usize> {
    let per_avenue = PLACES / AVENUES;
    let mut chosen: Vec<usize> = Vec::new();
    while chosen.len() < FROM_ONE_CITY {
        let place = random.random_range(0..PLACES);
        let near = |other: &usize| {
            other / per_avenue == place / per_avenue && other.abs_diff(place) < APART
        };
        if !chosen.iter().any(near) {
            chosen.push(place);
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_of_a_step_are_apart() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..100 {
            let places = apart(&mut random);
            for (k, a) in places.iter().enumerate() {
                for b in &places[k + 1..] {
                    assert!(a / 20 != b / 20 || a.abs_diff(*b) >= APART);
                }
            }
        }
    }
}
