//! Cosine similarity of descriptors, as VPR-Bench scores HOG.
#![expect(
    clippy::inline_always,
    reason = "only what is inlined into the dispatch is compiled for its registers"
)]

use ndarray::{Array2, ArrayViewMut2, Axis};
use pulp::Arch;
use rayon::prelude::*;
use vpr_core::{Descriptors, Error, Result, Similarities};

/// Numbers of every descriptor that are multiplied before the next ones: a run of a batch of
/// queries stays in the second cache.
const RUN: usize = 1024;

/// Queries that one thread compares at a time.
const BATCH: usize = 32;

/// Sums that are added up side by side.
const LANES: usize = 16;

/// Cosine of the angle between two descriptors, in f64: `a·b / (‖a‖ ‖b‖)`, higher is more alike.
///
/// Zero if one of them has no length, where VPR-Bench divides by zero.
///
/// # Errors
///
/// [`Error::Mismatch`] if they differ in dimension.
pub fn similarity(a: &[f32], b: &[f32]) -> Result<f64> {
    check_dim(a.len(), b.len())?;
    Ok(Arch::new().dispatch(
        #[inline(always)]
        || cosine(dot(a, b), length(a), length(b)),
    ))
}

/// [`similarity`] of every query to every reference, the same bits on any processor and for any
/// number of threads.
///
/// # Errors
///
/// [`Error::Mismatch`] if queries and references differ in dimension.
pub fn similarities(queries: &Descriptors, references: &Descriptors) -> Result<Similarities> {
    check_dim(references.dim(), queries.dim())?;
    let (from, to) = (rows(queries), rows(references));
    let mut cosines = Array2::zeros((from.len(), to.len()));
    let batches = cosines.axis_chunks_iter_mut(Axis(0), BATCH).into_par_iter();
    batches.zip(from.par_chunks(BATCH)).for_each(|(sums, queries)| {
        Arch::new().dispatch(
            #[inline(always)]
            || add_products(queries, &to, sums),
        );
    });
    let lengths =
        |rows: &[&[f32]]| -> Vec<f64> { rows.par_iter().map(|row| length(row)).collect() };
    let (from, to) = (lengths(&from), lengths(&to));
    for (mut row, query) in cosines.outer_iter_mut().zip(from) {
        row.iter_mut().zip(&to).for_each(|(it, &reference)| *it = cosine(*it, query, reference));
    }
    Similarities::new(cosines)
}

fn rows(descriptors: &Descriptors) -> Vec<&[f32]> {
    descriptors.as_slice().chunks_exact(descriptors.dim()).collect()
}

/// Adds the scalar product of every query with every reference to `queries × references` sums.
#[inline(always)]
fn add_products(queries: &[&[f32]], references: &[&[f32]], mut sums: ArrayViewMut2<f64>) {
    let dim = queries.first().map_or(0, |query| query.len());
    for start in (0..dim).step_by(RUN) {
        let run = start..(start + RUN).min(dim);
        for (index, reference) in references.iter().enumerate() {
            let reference = &reference[run.clone()];
            for (query, sum) in queries.iter().zip(sums.column_mut(index)) {
                *sum += run_dot(&query[run.clone()], reference);
            }
        }
    }
}

/// a·b, run by run as [`add_products`] has it.
#[inline(always)]
fn dot(a: &[f32], b: &[f32]) -> f64 {
    let mut sum = 0.0;
    for (a, b) in a.chunks(RUN).zip(b.chunks(RUN)) {
        sum += run_dot(a, b);
    }
    sum
}

/// a·b of one run. A product of two f32 is exact in f64, and the order of the sums is fixed.
#[inline(always)]
fn run_dot(a: &[f32], b: &[f32]) -> f64 {
    let (a, a_rest) = a.as_chunks::<LANES>();
    let (b, b_rest) = b.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for (a, b) in a.iter().zip(b) {
        for lane in 0..LANES {
            sums[lane] += f64::from(a[lane]) * f64::from(b[lane]);
        }
    }
    for ((sum, &a), &b) in sums.iter_mut().zip(a_rest).zip(b_rest) {
        *sum += f64::from(a) * f64::from(b);
    }
    sums.iter().sum()
}

#[inline(always)]
fn length(values: &[f32]) -> f64 {
    dot(values, values).sqrt()
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
            assert_eq!(fast.to_bits(), slow.to_bits(), "{query} {reference}: {fast} {slow}");
        }
    }

    #[test]
    fn sums_lose_nothing() {
        let descriptors = descriptors(2, 1300);
        let [a, b] = [0, 1].map(|index| descriptors.row(index).to_vec());
        let slow = |a: &[f32], b: &[f32]| -> f64 {
            a.iter().zip(b).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum()
        };
        let exact = slow(&a, &b) / (slow(&a, &a) * slow(&b, &b)).sqrt();
        assert!((similarity(&a, &b).unwrap() - exact).abs() < 1e-13);
    }

    #[test]
    fn dimensions_must_agree() {
        assert!(similarity(&[1.0], &[1.0, 2.0]).is_err());
        assert!(similarities(&descriptors(2, 3), &descriptors(2, 4)).is_err());
    }
}
