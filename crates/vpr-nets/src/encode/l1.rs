//! How AMOSNet and HybridNet compare descriptors.

use ndarray::Array2;
use rayon::prelude::*;
use vpr_core::{Descriptors, Error, Similarities};

use crate::Result;

/// What sums of absolute differences are divided by: VPR-Bench's `AMOSNet.py` and `HybridNet.py` have
/// 256², although descriptors have 256 · 30 values.
const SCALE: f64 = 65_536.0;

/// `1 − Σ|a − b| / 256²` of every query and every reference, the published match; higher is more similar.
///
/// It ranks as the L1 distance does. The thesis calls it normalised to 0 to 1, which it is only as long as
/// the differences sum to less than 256².
///
/// # Errors
///
/// [`Error::Mismatch`] if queries and references differ in dimension.
pub fn similarities(queries: &Descriptors, references: &Descriptors) -> Result<Similarities> {
    let (expected, actual) = (references.dim(), queries.dim());
    if expected != actual {
        return Err(Error::Mismatch { what: "dimension of queries", expected, actual }.into());
    }
    let (n, m) = (queries.len(), references.len());
    // Sums run along the descriptor: the same bits for any number of threads.
    let row = |rows: &Descriptors, at: usize| at * rows.dim()..(at + 1) * rows.dim();
    let similarity = |at: usize| {
        let (query, reference) = (row(queries, at / m), row(references, at % m));
        of_pair(&queries.as_slice()[query], &references.as_slice()[reference])
    };
    let values: Vec<f64> = (0..n * m).into_par_iter().map(similarity).collect();
    let of = |(query, reference)| values[query * m + reference];
    Ok(Similarities::new(Array2::from_shape_fn((n, m), of))?)
}

/// [`similarities`] of two descriptors of one length.
#[must_use]
pub fn of_pair(a: &[f32], b: &[f32]) -> f64 {
    let differences = a.iter().zip(b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).abs());
    1.0 - differences.sum::<f64>() / SCALE
}
