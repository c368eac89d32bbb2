//! Principal components: fewer values per descriptor, optionally whitened.

use std::{fs, path::Path};

use faer::{Accum, Mat, MatRef, Par, Side, linalg::matmul::matmul};
use ndarray::Array2;
use serde::{Deserialize, Serialize};

use crate::{Descriptors, Error, Result};

/// How a [`Pca`] is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PcaParams {
    /// Values per projected descriptor.
    pub n_components: usize,
    /// Divides every component by its standard deviation, so that all count alike.
    pub whiten: bool,
}

impl Default for PcaParams {
    fn default() -> Self {
        Self { n_components: 512, whiten: false }
    }
}

/// A projection onto the directions in which descriptors vary most.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pca {
    dim: usize,
    mean: Vec<f64>,
    /// `n_components × dim`, row by row; divided by the standard deviation if whitening.
    projection: Vec<f64>,
    /// Variance (divisor n − 1) along every component, descending.
    variances: Vec<f64>,
}

/// Components with a smaller share of the largest variance are noise of the decomposition.
const SMALLEST_SHARE: f64 = 1e-12;

impl Pca {
    /// Fits the components to descriptors, in f64, by the eigenvectors of their covariance or,
    /// with fewer images than values, of their inner products.
    ///
    /// The sign of a component makes its value of largest magnitude positive.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if the descriptors do not vary in that many directions, or the
    /// decomposition does not converge.
    pub fn fit(descriptors: &Descriptors, params: &PcaParams) -> Result<Self> {
        let (len, dim, wanted) = (descriptors.len(), descriptors.dim(), params.n_components);
        let refuse =
            |reason| Error::Parameter { name: "n_components", value: wanted.to_string(), reason };
        if wanted == 0 || wanted > dim.min(len.saturating_sub(1)) {
            return Err(refuse("must be positive, at most dim, and below the number of images"));
        }
        let mean = mean(descriptors);
        let centered = Mat::from_fn(len, dim, |row, column| {
            f64::from(descriptors.as_slice()[row * dim + column]) - mean[column]
        });
        let (variances, directions) =
            components(centered.as_ref(), wanted).ok_or(refuse("no decomposition was found"))?;
        if variances[wanted - 1] <= variances[0] * SMALLEST_SHARE {
            return Err(refuse("the descriptors vary in fewer directions"));
        }
        let mut projection = Vec::with_capacity(wanted * dim);
        for (component, &variance) in variances.iter().enumerate() {
            let direction = directions.col(component);
            let larger = |a: f64, b: &f64| if b.abs() > a.abs() { *b } else { a };
            let largest = direction.iter().fold(0.0, larger);
            let norm = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
            let scale = if params.whiten { variance.sqrt() } else { 1.0 };
            projection.extend(direction.iter().map(|x| x * largest.signum() / norm / scale));
        }
        Ok(Self { dim, mean, projection, variances })
    }

    /// Values per projected descriptor.
    #[must_use]
    pub fn n_components(&self) -> usize {
        self.variances.len()
    }

    /// The mean that is subtracted, one value per dimension.
    #[must_use]
    pub fn mean(&self) -> &[f64] {
        &self.mean
    }

    /// The components, `n_components × dim`, row by row; divided by the standard deviation if whitening.
    #[must_use]
    pub fn projection(&self) -> &[f64] {
        &self.projection
    }

    /// Variance along every component before whitening, descending.
    #[must_use]
    pub fn variances(&self) -> &[f64] {
        &self.variances
    }

    /// Projects descriptors, `n × dim` to `n × n_components`; computed in f64, not normalized.
    ///
    /// # Errors
    ///
    /// [`Error::Mismatch`] if they have another dimension than those of the fit.
    pub fn apply(&self, descriptors: &Descriptors) -> Result<Descriptors> {
        if descriptors.dim() != self.dim {
            return Err(Error::Mismatch {
                what: "dimension of the descriptors to project",
                expected: self.dim,
                actual: descriptors.dim(),
            });
        }
        let (n_components, dim) = (self.n_components(), self.dim);
        let projection = MatRef::from_row_major_slice(&self.projection[..], n_components, dim);
        let mut projected = Array2::zeros((descriptors.len(), n_components));
        // In blocks: f64 copies of all descriptors may not fit.
        for (start, mut rows) in (0..descriptors.len())
            .step_by(256)
            .zip(projected.axis_chunks_iter_mut(ndarray::Axis(0), 256))
        {
            let centered = Mat::from_fn(dim, rows.nrows(), |column, row| {
                f64::from(descriptors.as_slice()[(start + row) * dim + column]) - self.mean[column]
            });
            let mut product = Mat::zeros(n_components, rows.nrows());
            matmul(&mut product, Accum::Replace, projection, &centered, 1.0, Par::Seq);
            rows.indexed_iter_mut().for_each(|((row, component), value)| {
                *value = narrow(product[(component, row)]);
            });
        }
        Descriptors::new(projected)
    }

    /// Writes the projection as JSON.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<()> {
        let text =
            serde_json::to_vec(self).map_err(|err| Error::format(path, "pca", err.to_string()))?;
        Ok(vpr_files::replace(path, &text)?)
    }

    /// Reads what [`Self::save`] wrote.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the file cannot be read, [`Error::Format`] if it is not such a file or its
    /// lengths disagree.
    pub fn open(path: &Path) -> Result<Self> {
        let text = fs::read(path).map_err(Error::io(path))?;
        let pca: Self = serde_json::from_slice(&text).map_err(|err| {
            Error::format(
                path,
                format!("line {}, column {}", err.line(), err.column()),
                err.to_string(),
            )
        })?;
        let expected = pca.dim.checked_mul(pca.variances.len());
        if pca.mean.len() != pca.dim || Some(pca.projection.len()) != expected {
            return Err(Error::format(path, "projection", "lengths do not belong together"));
        }
        Ok(pca)
    }
}

fn mean(descriptors: &Descriptors) -> Vec<f64> {
    let mut mean = vec![0.0; descriptors.dim()];
    for row in descriptors.view().outer_iter() {
        mean.iter_mut().zip(row).for_each(|(sum, &value)| *sum += f64::from(value));
    }
    for sum in &mut mean {
        *sum /= descriptors.len() as f64;
    }
    mean
}

/// Variances, descending, and directions (columns, any length) of centered rows.
fn components(centered: MatRef<'_, f64>, wanted: usize) -> Option<(Vec<f64>, Mat<f64>)> {
    let (len, dim) = (centered.nrows(), centered.ncols());
    let size = len.min(dim);
    let mut products = Mat::zeros(size, size);
    let (left, right) = if dim <= len {
        (centered.transpose(), centered)
    } else {
        (centered, centered.transpose())
    };
    matmul(&mut products, Accum::Replace, left, right, 1.0 / (len - 1) as f64, Par::Seq);
    let eigen = products.self_adjoint_eigen(Side::Lower).ok()?;
    // Ascending; the last ones are wanted.
    let vectors = Mat::from_fn(size, wanted, |row, i| eigen.U()[(row, size - 1 - i)]);
    let variances = (0..wanted).map(|i| eigen.S()[size - 1 - i].max(0.0)).collect();
    if dim <= len {
        return Some((variances, vectors));
    }
    let mut directions = Mat::zeros(dim, wanted);
    matmul(&mut directions, Accum::Replace, centered.transpose(), &vectors, 1.0, Par::Seq);
    Some((variances, directions))
}

/// The one place where a projected value becomes f32.
#[expect(clippy::cast_possible_truncation, reason = "descriptors are f32")]
fn narrow(value: f64) -> f32 {
    value as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stretched(len: usize, dim: usize) -> Descriptors {
        let value = |(row, column): (usize, usize)| {
            let noise =
                ((row * 7919 + column * 104_729) * 2_654_435_761 % 1009) as f32 / 1009.0 - 0.5;
            noise * (dim - column) as f32 + 3.0
        };
        Descriptors::new(Array2::from_shape_fn((len, dim), value)).unwrap()
    }

    fn variance_and_covariance(descriptors: &Descriptors) -> (Vec<f64>, f64) {
        let n = descriptors.len() as f64;
        let columns = |i: usize| descriptors.view().column(i).mapv(f64::from);
        let variances =
            (0..descriptors.dim()).map(|i| columns(i).mapv(|x| x * x).sum() / (n - 1.0));
        let covariance = (columns(0) * columns(1)).sum() / (n - 1.0);
        (variances.collect(), covariance)
    }

    #[test]
    fn components_are_uncorrelated_and_have_their_variances() {
        for (len, dim) in [(300, 12), (20, 40)] {
            let descriptors = stretched(len, dim);
            let params = PcaParams { n_components: 5, whiten: false };
            let pca = Pca::fit(&descriptors, &params).unwrap();
            let (variances, covariance) =
                variance_and_covariance(&pca.apply(&descriptors).unwrap());
            assert!(covariance.abs() < 1e-4 * variances[0], "{covariance}");
            for (measured, variance) in variances.iter().zip(pca.variances()) {
                assert!((measured - variance).abs() < 1e-4 * variance, "{measured} {variance}");
            }
            assert!(pca.variances().is_sorted_by(|a, b| a >= b));
        }
    }

    #[test]
    fn whitened_components_have_variance_one() {
        let descriptors = stretched(300, 12);
        let pca = Pca::fit(&descriptors, &PcaParams { n_components: 12, whiten: true }).unwrap();
        for variance in variance_and_covariance(&pca.apply(&descriptors).unwrap()).0 {
            assert!((variance - 1.0).abs() < 1e-4, "{variance}");
        }
    }

    #[test]
    fn all_components_keep_all_distances() {
        let descriptors = stretched(50, 8);
        let pca = Pca::fit(&descriptors, &PcaParams { n_components: 8, whiten: false }).unwrap();
        let projected = pca.apply(&descriptors).unwrap();
        let distance = |set: &Descriptors| {
            crate::knn::Metric::Euclidean.distance(&set.as_slice()[..8], &set.as_slice()[8..16])
        };
        assert!((distance(&descriptors) - distance(&projected)).abs() < 1e-4);
    }

    #[test]
    fn a_saved_projection_is_the_same_projection() {
        let pca =
            Pca::fit(&stretched(50, 8), &PcaParams { n_components: 3, whiten: true }).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pca.json");
        pca.save(&path).unwrap();
        assert_eq!(Pca::open(&path).unwrap(), pca);
        fs::write(&path, fs::read_to_string(&path).unwrap().replace("\"dim\":8", "\"dim\":9"))
            .unwrap();
        assert!(matches!(Pca::open(&path), Err(Error::Format { .. })));
    }

    #[test]
    fn more_components_than_directions_are_refused() {
        let flat = Descriptors::new(Array2::from_shape_fn((9, 4), |(row, _)| row as f32)).unwrap();
        let err = Pca::fit(&flat, &PcaParams { n_components: 2, whiten: true }).unwrap_err();
        assert!(matches!(err, Error::Parameter { .. }), "{err}");
    }
}
