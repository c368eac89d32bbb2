//! Cosine similarity of descriptors, as VPR-Bench scores HOG.

use ndarray::{Array1, Array2, ArrayView1, ArrayView2, ArrayViewMut2, Axis, s};
use rayon::prelude::*;
use vpr_core::{Descriptors, Error, Result, Similarities};

/// Numbers whose products are summed in f32, by matrix multiplication, before the sums are added in f64.
const RUN: usize = 512;

/// Queries that one thread compares at a time.
const BATCH: usize = 32;

/// Cosine of the angle between two descriptors, in f64: `a·b / (‖a‖ ‖b‖)`, higher is more alike.
///
/// Zero if one of them has no length, where VPR-Bench divides by zero.
///
/// # Errors
///
/// [`Error::Mismatch`] if they differ in dimension.
pub fn similarity(a: &[f32], b: &[f32]) -> Result<f64> {
    check_dim(a.len(), b.len())?;
    let (a, b) = (ArrayView1::from(a), ArrayView1::from(b));
    Ok(cosine(dot(a, b), dot(a, a).sqrt(), dot(b, b).sqrt()))
}

/// [`similarity`] of every query to every reference, within 1e-6.
///
/// Products are summed in f32 over runs of 512 numbers and from there on in f64. Every thread compares whole queries,
/// so the result does not depend on how many there are.
///
/// # Errors
///
/// [`Error::Mismatch`] if queries and references differ in dimension.
pub fn similarities(queries: &Descriptors, references: &Descriptors) -> Result<Similarities> {
    check_dim(references.dim(), queries.dim())?;
    let lengths = |it: &Descriptors| -> Array1<f64> {
        it.view().outer_iter().map(|it| dot(it, it).sqrt()).collect()
    };
    let (query_lengths, reference_lengths) = (lengths(queries), lengths(references));
    let mut cosines = Array2::zeros((queries.len(), references.len()));
    cosines
        .axis_chunks_iter_mut(Axis(0), BATCH)
        .into_par_iter()
        .zip(queries.view().axis_chunks_iter(Axis(0), BATCH))
        .for_each(|(sums, queries)| add_products(queries, references.view(), sums));
    for (mut row, &query) in cosines.outer_iter_mut().zip(&query_lengths) {
        row.zip_mut_with(&reference_lengths, |it, &reference| *it = cosine(*it, query, reference));
    }
    Similarities::new(cosines)
}

/// Adds the scalar product of every query with every reference to `queries × references` sums.
fn add_products(
    queries: ArrayView2<f32>,
    references: ArrayView2<f32>,
    mut sums: ArrayViewMut2<f64>,
) {
    for start in (0..queries.ncols()).step_by(RUN) {
        let run = s![.., start..(start + RUN).min(queries.ncols())];
        let products = queries.slice(run).dot(&references.slice(run).t());
        sums.zip_mut_with(&products, |sum, &product| *sum += f64::from(product));
    }
}

fn dot(a: ArrayView1<f32>, b: ArrayView1<f32>) -> f64 {
    a.iter().zip(b).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum()
}

fn cosine(dot: f64, a_length: f64, b_length: f64) -> f64 {
    let lengths = a_length * b_length;
    if lengths > 0.0 { dot / lengths } else { 0.0 }
}

fn check_dim(expected: usize, actual: usize) -> Result<()> {
    if expected == actual {
        Ok(())
    } else {
        Err(Error::Mismatch { what: "numbers in a descriptor", expected, actual })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn descriptors(rows: usize, dim: usize) -> Descriptors {
        let value = |(row, column)| ((row * 37 + column * column * 11) % 101) as f32 / 500.0;
        Descriptors::new(Array2::from_shape_fn((rows, dim), value)).unwrap()
    }

    #[test]
    fn right_angle_is_zero_and_same_direction_is_one() {
        assert!(similarity(&[1.0, 0.0], &[0.0, 3.0]).unwrap().abs() < 1e-15);
        assert!((similarity(&[1.0, 2.0], &[2.0, 4.0]).unwrap() - 1.0).abs() < 1e-15);
    }

    #[test]
    fn descriptor_without_length_is_like_nothing() {
        assert!(similarity(&[0.0, 0.0], &[0.0, 3.0]).unwrap().abs() < 1e-15);
    }

    #[test]
    fn all_pairs_equal_one_at_a_time() {
        let (queries, references) = (descriptors(70, 1300), descriptors(45, 1300));
        let all = similarities(&queries, &references).unwrap();
        for ((query, reference), &fast) in all.view().indexed_iter() {
            let [a, b] = [queries.row(query), references.row(reference)];
            let slow = similarity(a.as_slice().unwrap(), b.as_slice().unwrap()).unwrap();
            assert!((fast - slow).abs() < 1e-6, "{query} {reference}: {fast} {slow}");
        }
    }

    #[test]
    fn dimensions_must_agree() {
        assert!(similarity(&[1.0], &[1.0, 2.0]).is_err());
        assert!(similarities(&descriptors(2, 3), &descriptors(2, 4)).is_err());
    }
}
