//! How far a map is from what an encoder was trained on (thesis figure 4.1, as numbers).

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use vpr_core::{Descriptors, Error as CoreError, retrieve};

use crate::Result;

/// Fréchet distance of two sets of descriptors taken as normal distributions (Dowson and Landau
/// 1982; used by Heusel et al. 2017 on features of images):
/// `‖μ₁ − μ₂‖² + tr(Σ₁ + Σ₂ − 2 (Σ₁^½ Σ₂ Σ₁^½)^½)`, its square as the literature gives it.
///
/// With fewer descriptors than dimensions the covariances are singular and the value has a bias that
/// grows as sets shrink: compare sets of equal size only.
///
/// # Errors
///
/// [`CoreError::Mismatch`] if the dimensions differ; [`CoreError::Empty`] below two rows.
pub fn frechet(a: &Descriptors, b: &Descriptors) -> Result<f64> {
    if a.dim() != b.dim() {
        let what = "dimension of the descriptors";
        return Err(CoreError::Mismatch { what, expected: a.dim(), actual: b.dim() }.into());
    }
    if a.len().min(b.len()) < 2 {
        return Err(CoreError::Empty("spread of fewer than two descriptors").into());
    }
    let ((mean_a, cov_a), (mean_b, cov_b)) = (moments(a), moments(b));
    let root = square_root(&cov_a);
    let product = square_root(&(&root * &cov_b * &root));
    let spread = cov_a.trace() + cov_b.trace() - 2.0 * product.trace();
    Ok((mean_a - mean_b).norm_squared() + spread.max(0.0))
}

/// Share of rows of `a` whose nearest neighbour among all other rows of both sets is of `a` too: 1 if
/// the sets are apart, and about half of it for equally many rows of one distribution.
///
/// # Errors
///
/// [`CoreError::Mismatch`] if the dimensions differ.
pub fn own_neighbours(a: &Descriptors, b: &Descriptors) -> Result<f64> {
    let (within, across) = (retrieve(a, a, 2)?, retrieve(a, b, 1)?);
    let is_own = |row: &usize| {
        // The row itself comes first, unless another one is equal to it.
        let own = (0..within.k()).find(|rank| within.indices(*row)[*rank] != *row);
        own.is_some_and(|rank| within.distances(*row)[rank] <= across.distances(*row)[0])
    };
    Ok((0..a.len()).filter(is_own).count() as f64 / a.len().max(1) as f64)
}

fn moments(rows: &Descriptors) -> (DVector<f64>, DMatrix<f64>) {
    let (n, dim) = (rows.len(), rows.dim());
    let matrix =
        DMatrix::from_row_iterator(n, dim, rows.as_slice().iter().map(|it| f64::from(*it)));
    let mean = matrix.row_mean().transpose();
    let centred = DMatrix::from_fn(n, dim, |row, column| matrix[(row, column)] - mean[column]);
    let covariance = centred.tr_mul(&centred) / (n as f64 - 1.0);
    (mean, covariance)
}

/// Of a symmetric matrix without negative eigenvalues but for rounding.
fn square_root(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let symmetric = (matrix + matrix.transpose()) / 2.0;
    let SymmetricEigen { eigenvectors, eigenvalues } = symmetric.symmetric_eigen();
    let roots = DMatrix::from_diagonal(&eigenvalues.map(|it| it.max(0.0).sqrt()));
    &eigenvectors * roots * eigenvectors.transpose()
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    fn rows(values: ndarray::Array2<f32>) -> Descriptors {
        Descriptors::new(values).unwrap()
    }

    #[test]
    fn a_shift_and_a_stretch_have_distances_by_hand() {
        let a = rows(array![[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]]);
        let shifted = rows(array![[2.0, 4.0], [4.0, 4.0], [3.0, 3.0], [3.0, 5.0]]);
        assert!((frechet(&a, &shifted).unwrap() - 25.0).abs() < 1e-9);
        // Variances 2/3 and 8/3 along x: the difference of their roots, squared, is 2/3.
        let wide = rows(array![[-2.0, 0.0], [2.0, 0.0], [0.0, -1.0], [0.0, 1.0]]);
        assert!((frechet(&a, &wide).unwrap() - 2.0 / 3.0).abs() < 1e-9);
        assert!(frechet(&a, &a).unwrap().abs() < 1e-9);
        assert!(frechet(&a, &rows(array![[1.0], [2.0]])).is_err());
    }

    #[test]
    fn sets_that_are_apart_have_their_own_neighbours() {
        let near = rows(array![[0.0], [0.1], [0.2], [0.3]]);
        let far = rows(array![[9.0], [9.1], [9.2]]);
        assert_eq!(own_neighbours(&near, &far).unwrap(), 1.0);
        let between = rows(array![[0.01], [0.11], [0.21], [0.29]]);
        assert_eq!(own_neighbours(&near, &between).unwrap(), 0.0);
    }
}
