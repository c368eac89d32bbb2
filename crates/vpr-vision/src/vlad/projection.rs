//! Principal components of a VLAD, kept in eight bits.

use vpr_core::{Error, Result, knn::Pca};

/// Fewer values per descriptor: principal components, whitened or not, each kept as bytes and a scale.
///
/// Jégou and Chum, *Negative Evidences and Co-occurences in Image Retrieval* (2012). A value of a
/// component is off by at most 1/254 of the component's largest: what the file of a vocabulary
/// has room for.
#[derive(Clone, Debug, PartialEq)]
pub struct Projection {
    /// What is subtracted first, one value per dimension.
    pub(super) mean: Vec<f32>,
    /// One per component.
    pub(super) scales: Vec<f32>,
    /// `components × dim`.
    pub(super) bytes: Vec<i8>,
}

impl Projection {
    /// The components of a fitted projection, in eight bits.
    #[must_use]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "components in f32, values from -127 to 127"
    )]
    pub fn of(pca: &Pca) -> Self {
        let dim = pca.mean().len();
        let (mut scales, mut bytes) = (Vec::new(), Vec::new());
        for row in pca.projection().chunks_exact(dim) {
            let largest = row.iter().fold(0.0_f64, |largest, it| largest.max(it.abs()));
            let scale = if largest > 0.0 { largest / 127.0 } else { 1.0 };
            scales.push(scale as f32);
            bytes.extend(row.iter().map(|it| (it / scale).round() as i8));
        }
        // As they are kept: in half precision.
        let mean = pca.mean().iter().map(|&it| half::f16::from_f64(it).to_f32()).collect();
        Self { mean, scales, bytes }
    }

    /// Values of a projected descriptor.
    #[must_use]
    pub fn n_components(&self) -> usize {
        self.scales.len()
    }

    /// Projects a descriptor to unit length, or to zero; sums are f64.
    ///
    /// # Errors
    ///
    /// [`Error::Mismatch`] if it has another dimension than the components.
    #[expect(clippy::cast_possible_truncation, reason = "descriptors are f32")]
    pub fn apply(&self, descriptor: &[f32]) -> Result<Vec<f32>> {
        if descriptor.len() != self.mean.len() {
            return Err(Error::Mismatch {
                what: "dimension of the descriptor to project",
                expected: self.mean.len(),
                actual: descriptor.len(),
            });
        }
        let centered: Vec<f32> =
            descriptor.iter().zip(&self.mean).map(|(x, mean)| x - mean).collect();
        let rows = self.bytes.chunks_exact(self.mean.len());
        let values: Vec<f64> = rows
            .zip(&self.scales)
            .map(|(row, scale)| {
                let product = |(&byte, &x): (&i8, &f32)| f64::from(f32::from(byte) * x);
                row.iter().zip(&centered).map(product).sum::<f64>() * f64::from(*scale)
            })
            .collect();
        let norm = values.iter().map(|it| it * it).sum::<f64>().sqrt();
        let norm = if norm > 0.0 { norm } else { 1.0 };
        Ok(values.iter().map(|it| (it / norm) as f32).collect())
    }
}
