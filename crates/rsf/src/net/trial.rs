//! Held-out references under augmentations that training does not see.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vpr_core::Descriptors;
use vpr_nets::model::Tunable;

use super::{Material, material::descriptors};
use crate::{Augmentations, MiningParams, Result};

/// Images that are described at a time.
const BATCH: usize = 32;
/// Draws of a trial come from a stream that no training step has.
const STREAM: u64 = u64::MAX;

/// Variants of some references, which are looked up among all references.
#[derive(Clone)]
pub struct Trial {
    /// The reference that each shows, and its input.
    of: Vec<usize>,
    images: Vec<f32>,
    /// Width and height of an input.
    size: (usize, usize),
    /// References of the same place, for each query.
    correct: Vec<Vec<usize>>,
}

/// What a network makes of a trial.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// Share of variants whose nearest reference shows their place.
    pub recall: f64,
    /// Mean of how much farther the nearest wrong reference is than the nearest right one.
    pub gap: f64,
    /// Number of variants.
    pub n: usize,
}

impl Trial {
    /// `variants` of each of these references. What is nearer than [`MiningParams::negative_m`] is
    /// the same place; without poses only the reference itself is.
    ///
    /// # Errors
    ///
    /// An image without pixels.
    pub fn new(
        material: &Material,
        rows: &[usize],
        variants: usize,
        augmentations: &Augmentations,
        (mining, seed): (&MiningParams, u64),
    ) -> Result<Self> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(STREAM);
        let variants = rows.iter().flat_map(|&row| std::iter::repeat_n(row, variants));
        let drawn: Vec<(usize, u64)> = variants.map(|row| (row, random.random::<u64>())).collect();
        let images = material.changed(augmentations, &drawn)?;
        let of: Vec<usize> = drawn.into_iter().map(|it| it.0).collect();
        let same = |row: usize| match material.poses() {
            None => vec![row],
            Some(poses) => {
                let metres = |other: &usize| (poses.position(row) - poses.position(*other)).norm();
                let is_near = |it: &usize| *it == row || metres(it) < mining.negative_m;
                (0..material.len()).filter(is_near).collect()
            }
        };
        let correct = of.iter().map(|&row| same(row)).collect();
        Ok(Self { of, images, size: material.size(), correct })
    }

    /// The reference that each variant shows.
    #[must_use]
    pub fn of(&self) -> &[usize] {
        &self.of
    }

    /// References of the same place, for each variant, in rising order.
    #[must_use]
    pub fn correct(&self) -> &[Vec<usize>] {
        &self.correct
    }

    /// Descriptors of the variants.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::NotFinite`] if the network gives numbers that are none.
    pub fn describe<N: Tunable>(&self, network: &N) -> Result<Descriptors> {
        let each = 3 * self.size.0 * self.size.1;
        let mut values = Vec::new();
        for part in self.images.chunks(each * BATCH) {
            values.extend_from_slice(network.rows(part, self.size, BATCH)?.as_slice());
        }
        descriptors(values, self.of.len())
    }

    /// Judges a network, given its descriptors of all references.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::NotFinite`] if it gives numbers that are none.
    pub fn score<N: Tunable>(&self, network: &N, references: &Descriptors) -> Result<Score> {
        let n = self.of.len();
        let rows = self.describe(network)?;
        let (mut hits, mut sum, mut n_compared) = (0_usize, 0.0, 0_usize);
        for (query, correct) in self.correct.iter().enumerate() {
            let row = rows.row(query);
            let (mut right, mut wrong) = (f64::INFINITY, f64::INFINITY);
            let mut nearest = (f64::INFINITY, false);
            for reference in 0..references.len() {
                let other = references.row(reference);
                let square = |(a, b): (&f32, &f32)| (f64::from(*a) - f64::from(*b)).powi(2);
                let distance = row.iter().zip(&other).map(square).sum::<f64>().sqrt();
                let is_right = correct.binary_search(&reference).is_ok();
                let side = if is_right { &mut right } else { &mut wrong };
                *side = side.min(distance);
                // Ties stay with the lower row.
                if distance < nearest.0 {
                    nearest = (distance, is_right);
                }
            }
            hits += usize::from(nearest.1);
            if wrong.is_finite() {
                (sum, n_compared) = (sum + wrong - right, n_compared + 1);
            }
        }
        let recall = hits as f64 / n.max(1) as f64;
        Ok(Score { recall, gap: sum / n_compared.max(1) as f64, n })
    }
}
