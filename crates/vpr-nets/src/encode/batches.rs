//! Does a descriptor depend on the other images of its batch?

use std::path::PathBuf;

use rand::{SeedableRng as _, seq::SliceRandom as _};
use rand_chacha::ChaCha8Rng;
use vpr_core::Descriptors;

use super::{Encoder, Options, encode_files};
use crate::Result;

/// How far the descriptors of the same images differ between ways to put them into batches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BatchLeak {
    /// Largest ‖a − b‖ / ‖b‖ over images, between batches in order and batches of one.
    pub against_single: f64,
    /// The same between batches in order and shuffled batches.
    pub against_shuffled: f64,
}

impl BatchLeak {
    /// Rounding differs by less than this; a method that looks at its neighbours by far more.
    pub const TOLERANCE: f64 = 1e-3;

    /// Whether a descriptor depends on its batch.
    #[must_use]
    pub fn is_dependent(&self) -> bool {
        self.against_single.max(self.against_shuffled) > Self::TOLERANCE
    }
}

/// Encodes images in batches of `options.batch_size`, in the same batches shuffled by `seed`, and
/// one by one, and compares.
///
/// # Errors
///
/// As [`encode_files`].
pub fn batch_leak(
    encoder: &dyn Encoder,
    paths: &[PathBuf],
    options: &Options,
    seed: u64,
) -> Result<BatchLeak> {
    let in_order = encode_files(encoder, paths, options, &mut |_| ())?;
    let single = Options { batch_size: 1, ..*options };
    let single = encode_files(encoder, paths, &single, &mut |_| ())?;
    let mut order: Vec<usize> = (0..paths.len()).collect();
    order.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
    let shuffled: Vec<PathBuf> = order.iter().map(|&index| paths[index].clone()).collect();
    let shuffled = encode_files(encoder, &shuffled, options, &mut |_| ())?;
    let own: Vec<usize> = (0..paths.len()).collect();
    Ok(BatchLeak {
        against_single: largest_difference(&in_order, &own, &single),
        against_shuffled: largest_difference(&in_order, &order, &shuffled),
    })
}

/// Largest relative difference of row `order[i]` of `a` and row `i` of `b`.
fn largest_difference(a: &Descriptors, order: &[usize], b: &Descriptors) -> f64 {
    let differences = order.iter().enumerate().map(|(row, &index)| {
        let (a, b) = (a.row(index), b.row(row));
        let square = |x: f32| f64::from(x) * f64::from(x);
        let difference: f64 = a.iter().zip(&b).map(|(a, b)| square(a - b)).sum();
        let norm: f64 = b.iter().map(|&b| square(b)).sum();
        if difference == 0.0 { 0.0 } else { (difference / norm).sqrt() }
    });
    differences.fold(0.0, f64::max)
}
