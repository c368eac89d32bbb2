//! Cosine similarity of descriptors, as VPR-Bench scores HOG.
#![expect(
    clippy::inline_always,
    reason = "only what is inlined into the dispatch is compiled for its registers"
)]

use ndarray::{Array2, ArrayViewMut2, Axis};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use vpr_core::{Descriptors, Error, Result, Similarities};

/// Numbers of every descriptor that are multiplied before the next ones: those of a batch of
/// queries stay in the second cache.
const RUN: usize = 1024;

/// Queries that are compared at a time, and sums of one product that are added up side by side.
const LANES: usize = 16;

/// Numbers of 16 queries at one place of their descriptors.
type Lanes = [f64; LANES];

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

/// [`similarity`] of every query to every reference, within 1e-12.
///
/// A product of two f32 is exact in f64, and sums run along the descriptor: the same bits on any
/// processor and for any number of threads.
///
/// # Errors
///
/// [`Error::Mismatch`] if queries and references differ in dimension.
pub fn similarities(queries: &Descriptors, references: &Descriptors) -> Result<Similarities> {
    check_dim(references.dim(), queries.dim())?;
    let (from, to) = (rows(queries), rows(references));
    let mut cosines = Array2::zeros((from.len(), to.len()));
    let batches = cosines.axis_chunks_iter_mut(Axis(0), LANES).into_par_iter();
    batches.zip(from.par_chunks(LANES)).for_each(|(sums, queries)| {
        Arch::new().dispatch(Products { queries, references: &to, sums });
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

/// Scalar products of up to 16 queries with all references, added to `queries × references` sums.
struct Products<'a> {
    queries: &'a [&'a [f32]],
    references: &'a [&'a [f32]],
    sums: ArrayViewMut2<'a, f64>,
}

impl WithSimd for Products<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match S::F64_LANES {
            8 => self.add::<S, 4, 2>(simd),
            4 => self.add::<S, 2, 4>(simd),
            2 => self.add::<S, 1, 8>(simd),
            _ => self.add::<S, 1, 16>(simd),
        }
    }
}

impl Products<'_> {
    /// `ROWS` references at a time; `VECTORS` registers hold a number of 16 queries.
    #[inline(always)]
    fn add<S: Simd, const ROWS: usize, const VECTORS: usize>(mut self, simd: S) {
        let dim = self.queries.first().map_or(0, |query| query.len());
        let mut panel = vec![[0.0; LANES]; RUN.min(dim)];
        for start in (0..dim).step_by(RUN) {
            let run = start..(start + RUN).min(dim);
            for (lane, query) in self.queries.iter().enumerate() {
                for (lanes, &value) in panel.iter_mut().zip(&query[run.clone()]) {
                    lanes[lane] = f64::from(value);
                }
            }
            let panel = &panel[..run.len()];
            for first in (0..self.references.len()).step_by(ROWS) {
                // The last references may be taken twice; what they give is stored once.
                let mut rows: [&[f32]; ROWS] = [&[]; ROWS];
                for (index, row) in rows.iter_mut().enumerate() {
                    let reference = (first + index).min(self.references.len() - 1);
                    *row = &self.references[reference][run.clone()];
                }
                let products = multiply::<S, ROWS, VECTORS>(simd, panel, rows);
                let last = (first + ROWS).min(self.references.len());
                for (products, reference) in products.iter().zip(first..last) {
                    let sums = self.sums.column_mut(reference);
                    sums.into_iter().zip(products).for_each(|(sum, product)| *sum += product);
                }
            }
        }
    }
}

/// Products of 16 queries with some rows over one run, in its order.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "counted loops over constants stay in registers")]
fn multiply<S: Simd, const ROWS: usize, const VECTORS: usize>(
    simd: S,
    panel: &[Lanes],
    rows: [&[f32]; ROWS],
) -> [Lanes; ROWS] {
    let rows = rows.map(|row| &row[..panel.len()]);
    let mut sums = [[simd.splat_f64s(0.0); VECTORS]; ROWS];
    for (at, lanes) in panel.iter().enumerate() {
        let lanes = S::as_simd_f64s(lanes).0;
        for row in 0..ROWS {
            let value = simd.splat_f64s(f64::from(rows[row][at]));
            for vector in 0..VECTORS {
                // Exact product: with or without fusing it is the same sum.
                sums[row][vector] = simd.mul_add_e_f64s(value, lanes[vector], sums[row][vector]);
            }
        }
    }
    let mut products = [[0.0; LANES]; ROWS];
    for row in 0..ROWS {
        for vector in 0..VECTORS {
            S::as_mut_simd_f64s(&mut products[row]).0[vector] = sums[row][vector];
        }
    }
    products
}

/// a·b by 16 partial sums.
#[inline(always)]
fn dot(a: &[f32], b: &[f32]) -> f64 {
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
        let (queries, references) = (descriptors(70, 2300), descriptors(45, 2300));
        let all = similarities(&queries, &references).unwrap();
        for ((query, reference), &fast) in all.view().indexed_iter() {
            let [a, b] = [queries.row(query), references.row(reference)];
            let slow = similarity(a.as_slice().unwrap(), b.as_slice().unwrap()).unwrap();
            assert!((fast - slow).abs() < 1e-12, "{query} {reference}: {fast} {slow}");
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
