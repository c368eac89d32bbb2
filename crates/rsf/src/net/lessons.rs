//! Which triplets a step sees: a function of the seed, the step and what was mined.

use rand::{RngExt, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;

use super::Material;
use crate::{Augmentations, Error, Mined, Result};

/// Queries, then positives, then negatives, `n` of each.
#[derive(Clone, Debug, PartialEq)]
pub struct TripletBatch {
    /// `3 n × 3 × height × width` values.
    pub images: Vec<f32>,
    /// Width and height.
    pub size: (usize, usize),
    /// Number of triplets.
    pub n: usize,
}

/// Triplets by number.
pub struct Lessons<'a> {
    material: &'a Material,
    mined: Mined,
    queries: Vec<usize>,
    augmentations: &'a Augmentations,
    size: usize,
    seed: u64,
}

impl<'a> Lessons<'a> {
    /// Batches of `size` triplets from what was mined; queries are changed by `augmentations`.
    ///
    /// # Errors
    ///
    /// [`Error::TooFew`] if no reference can be a query.
    pub fn new(
        material: &'a Material,
        mined: Mined,
        augmentations: &'a Augmentations,
        size: usize,
        seed: u64,
    ) -> Result<Self> {
        let queries = mined.queries();
        if queries.is_empty() {
            let purpose = "that have a negative";
            return Err(Error::TooFew { n: 0, needed: 1, purpose });
        }
        Ok(Self { material, mined, queries, augmentations, size: size.max(1), seed })
    }

    /// The triplets of a step: every reference is a query once before one is again, in an order of
    /// each pass.
    ///
    /// # Errors
    ///
    /// An image without pixels.
    pub fn batch(&self, step: usize) -> Result<TripletBatch> {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(2 * step as u64);
        let (mut queries, mut others) = (Vec::new(), (Vec::new(), Vec::new()));
        for number in step * self.size..(step + 1) * self.size {
            let query = self.query(number);
            if let Some(triplet) = self.mined.triplet(query, &mut random) {
                queries.push((query, random.random::<u64>()));
                others.0.push(triplet.positive);
                others.1.push(triplet.negative);
            }
        }
        let mut images = self.material.changed(self.augmentations, &queries)?;
        images.extend(self.material.plain(&others.0)?);
        images.extend(self.material.plain(&others.1)?);
        Ok(TripletBatch { images, size: self.material.size(), n: queries.len() })
    }

    fn query(&self, number: usize) -> usize {
        let (pass, at) = (number / self.queries.len(), number % self.queries.len());
        let mut order = self.queries.clone();
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(2 * pass as u64 + 1);
        order.shuffle(&mut random);
        order[at]
    }
}
