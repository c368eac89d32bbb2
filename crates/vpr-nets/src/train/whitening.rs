//! Whitening learned from images of known places.

use faer::{Accum, Mat, MatRef, Par, Side, linalg::matmul::matmul};
use ndarray::{Array1, Array2, ArrayView2};
use vpr_core::{Error, Result};

/// Share of the mean variance within places that is added to all of them: directions in which
/// nothing was seen to change are not trusted without limit.
const RIDGE: f64 = 0.01;

/// An affine map of features, `x ↦ x · weight + bias`.
#[derive(Clone, Debug, PartialEq)]
pub struct Affine {
    /// `from × to`.
    pub weight: Array2<f32>,
    /// `to`.
    pub bias: Array1<f32>,
}

/// Learned whitening (Mikolajczyk and Matas 2007; Radenović, Tolias and Chum 2019, section 3.3):
/// what differs between images of one place is brought to variance one, then the `to` directions
/// are kept in which the places' means differ most, the most telling first.
///
/// `features` has a row for each image, `places` says what it shows. Weights are scaled to a mean
/// square of one over `from`; unit descriptors do not change with the scale. The result is the same
/// for any number of threads.
///
/// # Errors
///
/// [`Error::Mismatch`] if there are not as many places as rows; [`Error::Parameter`] if `to` is not
/// below the number of places or above that of features; [`Error::Undefined`] if no two images of a
/// place differ.
pub fn learned_whitening(
    features: ArrayView2<'_, f32>,
    places: &[usize],
    to: usize,
) -> Result<Affine> {
    let (n, from) = features.dim();
    if places.len() != n {
        return Err(Error::Mismatch { what: "places", expected: n, actual: places.len() });
    }
    let (means, number) = means(features, places);
    if to == 0 || to > from || to >= means.nrows() {
        let reason = "needs more places than directions, and as many features";
        return Err(Error::Parameter { name: "to", value: to.to_string(), reason });
    }
    let residuals = Mat::from_fn(n, from, |row, column| {
        f64::from(features[(row, column)]) - means[(number[row], column)]
    });
    let within = products(residuals.as_ref());
    let ridge = RIDGE * (0..from).map(|k| within[(k, k)]).sum::<f64>() / from as f64;
    if ridge <= 0.0 {
        return Err(undefined("no two images of a place differ"));
    }
    let (variances, mut directions) = eigen(&within)?;
    for (column, variance) in variances.iter().enumerate() {
        let scale = (variance.max(0.0) + ridge).sqrt().recip();
        directions.col_mut(column).iter_mut().for_each(|value| *value *= scale);
    }
    let middle: Vec<f64> = (0..from)
        .map(|column| means.col(column).iter().sum::<f64>() / means.nrows() as f64)
        .collect();
    let centred =
        Mat::from_fn(means.nrows(), from, |row, column| means[(row, column)] - middle[column]);
    let between = products(times(centred.as_ref(), directions.as_ref()).as_ref());
    let (_, turns) = eigen(&between)?;
    // Ascending; the last ones are wanted.
    let turns = Mat::from_fn(from, to, |row, column| turns[(row, from - 1 - column)]);
    Ok(affine(&times(directions.as_ref(), turns.as_ref()), &middle))
}

#[expect(clippy::cast_possible_truncation, reason = "weights are f32")]
fn affine(weight: &Mat<f64>, middle: &[f64]) -> Affine {
    let (from, to) = (weight.nrows(), weight.ncols());
    let scale = (to as f64 / weight.squared_norm_l2()).sqrt();
    let shift = |column: usize| -> f64 {
        weight.col(column).iter().zip(middle).map(|(weight, middle)| weight * middle).sum()
    };
    Affine {
        weight: Array2::from_shape_fn((from, to), |at| (weight[at] * scale) as f32),
        bias: Array1::from_shape_fn(to, |column| (-shift(column) * scale) as f32),
    }
}

/// The mean of every place, and which row of them belongs to each image.
fn means(features: ArrayView2<'_, f32>, places: &[usize]) -> (Mat<f64>, Vec<usize>) {
    let mut known: Vec<usize> = places.to_vec();
    known.sort_unstable();
    known.dedup();
    let number: Vec<usize> = places.iter().map(|it| known.partition_point(|at| at < it)).collect();
    let mut sums = Mat::<f64>::zeros(known.len(), features.ncols());
    let mut counts = vec![0.0; known.len()];
    for (row, &place) in features.outer_iter().zip(&number) {
        counts[place] += 1.0;
        for (column, &value) in row.iter().enumerate() {
            sums[(place, column)] += f64::from(value);
        }
    }
    let means = Mat::from_fn(known.len(), features.ncols(), |row, column| {
        sums[(row, column)] / counts[row]
    });
    (means, number)
}

/// Mean products of the columns.
fn products(rows: MatRef<'_, f64>) -> Mat<f64> {
    let mut products = Mat::zeros(rows.ncols(), rows.ncols());
    let share = 1.0 / rows.nrows() as f64;
    matmul(&mut products, Accum::Replace, rows.transpose(), rows, share, Par::Seq);
    products
}

fn times(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Mat<f64> {
    let mut product = Mat::zeros(a.nrows(), b.ncols());
    matmul(&mut product, Accum::Replace, a, b, 1.0, Par::Seq);
    product
}

/// Eigenvalues, ascending, and their vectors as columns.
fn eigen(symmetric: &Mat<f64>) -> Result<(Vec<f64>, Mat<f64>)> {
    let eigen = symmetric
        .self_adjoint_eigen(Side::Lower)
        .map_err(|_| undefined("the eigenvalues do not converge"))?;
    let values = (0..symmetric.nrows()).map(|k| eigen.S()[k]).collect();
    Ok((values, eigen.U().to_owned()))
}

fn undefined(reason: &'static str) -> Error {
    Error::Undefined { metric: "learned whitening", reason }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// 40 places of 4 images: two telling features under a nuisance of four times their size.
    fn images() -> (Array2<f32>, Vec<usize>) {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let places: Vec<usize> = (0..160).map(|image| 100 + image / 4).collect();
        let mut features = Array2::zeros((160, 4));
        for (image, mut row) in features.outer_iter_mut().enumerate() {
            let place = (image / 4) as f32;
            let mut noise = || random.random_range(-1.0..1.0_f32);
            let nuisance = 20.0 * noise();
            row[0] = 5.0 * place.sin() + nuisance + 7.0;
            row[1] = 5.0 * place.cos() + nuisance + 0.01 * noise();
            row[2] = nuisance;
            row[3] = 0.01 * noise();
        }
        (features, places)
    }

    #[test]
    fn what_changes_within_places_is_gone_and_what_tells_them_apart_stays() {
        let (features, places) = images();
        let Affine { weight, bias } = learned_whitening(features.view(), &places, 2).unwrap();
        let rows = features.dot(&weight) + &bias;
        let gap = |a: usize, b: usize| (&rows.row(a) - &rows.row(b)).mapv(|x| x * x).sum().sqrt();
        let within = (0..40).map(|k| gap(4 * k, 4 * k + 3)).fold(0.0, f32::max);
        let between = (0..39).map(|k| gap(4 * k, 4 * k + 4)).fold(f32::INFINITY, f32::min);
        assert!(within < 0.3 * between, "{within} {between}");
        let mean = rows.mean_axis(ndarray::Axis(0)).unwrap();
        assert!(mean.iter().all(|it| it.abs() < 1e-3), "{mean}");
    }

    #[test]
    fn what_cannot_be_fitted_is_refused() {
        let (features, places) = images();
        assert!(learned_whitening(features.view(), &places[1..], 2).is_err());
        assert!(learned_whitening(features.view(), &places, 5).is_err());
        let alone: Vec<usize> = (0..160).collect();
        let err = learned_whitening(features.view(), &alone, 2).unwrap_err().to_string();
        assert!(err.contains("no two images"), "{err}");
    }
}
