//! Which samples are drawn.

#![expect(clippy::cast_possible_truncation, reason = "sizes of samples, halves of products")]

use rand_chacha::{
    ChaCha8Rng,
    rand_core::{Rng, SeedableRng},
};

use super::{Correspondence, geometry::Geometry};

/// A sample is drawn again at most so often; then it is taken as it is.
const ATTEMPTS: usize = 100;

/// Samples of distinct correspondences that a geometry finds fair, all equally likely.
pub(super) struct Draws<'a> {
    rng: ChaCha8Rng,
    points: &'a [Correspondence],
    indices: Vec<u32>,
    sample: Vec<Correspondence>,
}

impl<'a> Draws<'a> {
    pub(super) fn new(seed: u64, points: &'a [Correspondence]) -> Self {
        let rng = ChaCha8Rng::seed_from_u64(seed);
        Self { rng, points, indices: Vec::new(), sample: Vec::new() }
    }

    /// The next sample. There must be at least as many correspondences as it has.
    pub(super) fn next<G: Geometry>(&mut self) -> &[Correspondence] {
        for _ in 0..ATTEMPTS {
            self.draw(G::SAMPLE);
            self.sample.clear();
            self.sample.extend(self.indices.iter().map(|&at| self.points[at as usize]));
            if G::is_fair(&self.sample) {
                break;
            }
        }
        &self.sample
    }

    /// Floyd's algorithm (Bentley & Floyd 1987), in the order of draws of the crate `rand` 0.10.
    fn draw(&mut self, size: usize) {
        let n = u32::try_from(self.points.len()).unwrap_or(u32::MAX);
        self.indices.clear();
        for last in n - size as u32..n {
            let drawn = self.at_most(last);
            if let Some(twice) = self.indices.iter().position(|&it| it == drawn) {
                self.indices[twice] = last;
            }
            self.indices.push(drawn);
        }
    }

    /// A number from 0 to `last`: the high half of a product, with a second draw where the low half shows a bias
    /// (Canon's method).
    fn at_most(&mut self, last: u32) -> u32 {
        let range = last.wrapping_add(1);
        if range == 0 {
            return self.rng.next_u32();
        }
        let mut multiply = || {
            let product = u64::from(self.rng.next_u32()) * u64::from(range);
            ((product >> 32) as u32, product as u32)
        };
        let (high, low) = multiply();
        let carries = low > range.wrapping_neg() && low.checked_add(multiply().0).is_none();
        high + u32::from(carries)
    }
}
