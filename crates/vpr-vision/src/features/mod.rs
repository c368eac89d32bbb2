//! Local features of one image: where they are, how strong they are, what they look like.

mod binary;

pub use self::binary::BinaryDescriptors;
use vpr_core::{Descriptors, Error, Result};

use crate::image::RgbImage;

/// A method that finds and describes keypoints.
pub trait Extractor: Send + Sync {
    /// The name that `--method` takes.
    fn name(&self) -> &'static str;

    /// The local features of an image.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if the image has a size that the method cannot take.
    fn extract(&self, image: &RgbImage) -> Result<LocalFeatures>;
}

/// Keypoints of one image with their scores and descriptors, whatever found them.
///
/// Keypoint *i* belongs to score *i* and to row *i* of the descriptors. Coordinates are pixels of the image that was
/// given, x to the right and y down, and (0, 0) is the centre of the first pixel.
///
/// ```
/// use ndarray::array;
/// use vpr_core::Descriptors;
/// use vpr_vision::features::{LocalDescriptors, LocalFeatures};
///
/// let descriptors = Descriptors::new(array![[1.0, 0.0], [0.0, 1.0]])?;
/// let features = LocalFeatures::new(
///     vec![[3.0, 4.0], [10.5, 2.0]],
///     vec![0.2, 0.9],
///     LocalDescriptors::Float(descriptors),
/// )?;
/// assert_eq!(features.strongest(1).keypoints(), [[10.5, 2.0]]);
/// # Ok::<(), vpr_core::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct LocalFeatures {
    keypoints: Vec<[f32; 2]>,
    scores: Vec<f32>,
    descriptors: LocalDescriptors,
}

/// What keypoints look like: numbers compared by Euclidean distance, or bits compared by how many differ.
#[derive(Clone, Debug, PartialEq)]
pub enum LocalDescriptors {
    /// `n × dim` numbers: SIFT and the learned features.
    Float(Descriptors),
    /// `n` strings of bits: ORB.
    Binary(BinaryDescriptors),
}

impl LocalDescriptors {
    /// Number of descriptors.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Float(rows) => rows.len(),
            Self::Binary(rows) => rows.len(),
        }
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The numbers, unless the descriptors are binary.
    #[must_use]
    pub fn as_float(&self) -> Option<&Descriptors> {
        match self {
            Self::Float(rows) => Some(rows),
            Self::Binary(_) => None,
        }
    }

    /// The bits, if the descriptors are binary.
    #[must_use]
    pub fn as_binary(&self) -> Option<&BinaryDescriptors> {
        match self {
            Self::Float(_) => None,
            Self::Binary(rows) => Some(rows),
        }
    }

    fn select(&self, indices: &[usize]) -> Self {
        match self {
            Self::Float(rows) => {
                let chosen = rows.view().select(ndarray::Axis(0), indices);
                Self::Float(
                    Descriptors::new(chosen).expect("rows of finite descriptors are finite"),
                )
            }
            Self::Binary(rows) => Self::Binary(rows.select(indices)),
        }
    }
}

impl LocalFeatures {
    /// Puts keypoints (x, y), scores and descriptors together.
    ///
    /// # Errors
    ///
    /// [`Error::Mismatch`] if their numbers differ, [`Error::NotFinite`] if a coordinate or score is NaN or infinite.
    pub fn new(
        keypoints: Vec<[f32; 2]>,
        scores: Vec<f32>,
        descriptors: LocalDescriptors,
    ) -> Result<Self> {
        let expected = keypoints.len();
        let counts = [
            ("scores, one per keypoint", scores.len()),
            ("descriptors, one per keypoint", descriptors.len()),
        ];
        if let Some(&(what, actual)) = counts.iter().find(|(_, len)| *len != expected) {
            return Err(Error::Mismatch { what, expected, actual });
        }
        let values = |row: usize| [keypoints[row][0], keypoints[row][1], scores[row]];
        for row in 0..expected {
            if let Some(column) = values(row).iter().position(|it| !it.is_finite()) {
                let value = f64::from(values(row)[column]);
                return Err(Error::NotFinite {
                    what: "keypoints (x, y, score)",
                    row,
                    column,
                    value,
                });
            }
        }
        Ok(Self { keypoints, scores, descriptors })
    }

    /// Number of keypoints.
    #[must_use]
    pub fn len(&self) -> usize {
        self.keypoints.len()
    }

    /// Whether there is no keypoint.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.keypoints.is_empty()
    }

    /// Positions (x, y) in pixels.
    #[must_use]
    pub fn keypoints(&self) -> &[[f32; 2]] {
        &self.keypoints
    }

    /// Scores; higher is stronger. Their scale depends on the method.
    #[must_use]
    pub fn scores(&self) -> &[f32] {
        &self.scores
    }

    /// Descriptors, one per keypoint.
    #[must_use]
    pub fn descriptors(&self) -> &LocalDescriptors {
        &self.descriptors
    }

    /// The `n` features of the highest scores, strongest first, ties by lower index; all if there are not more.
    #[must_use]
    pub fn strongest(&self, n: usize) -> Self {
        let mut order: Vec<usize> = (0..self.len()).collect();
        order.sort_by(|&a, &b| self.scores[b].total_cmp(&self.scores[a]));
        order.truncate(n);
        Self {
            keypoints: order.iter().map(|&i| self.keypoints[i]).collect(),
            scores: order.iter().map(|&i| self.scores[i]).collect(),
            descriptors: self.descriptors.select(&order),
        }
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;

    fn float(n: usize) -> LocalDescriptors {
        LocalDescriptors::Float(Descriptors::new(Array2::zeros((n, 4))).unwrap())
    }

    #[test]
    fn counts_must_agree() {
        let scores = LocalFeatures::new(vec![[0.0; 2]; 2], vec![0.0], float(2)).unwrap_err();
        assert_eq!(scores.to_string(), "scores, one per keypoint: expected 2, got 1");
        let rows = LocalFeatures::new(vec![[0.0; 2]; 2], vec![0.0; 2], float(3)).unwrap_err();
        assert_eq!(rows.to_string(), "descriptors, one per keypoint: expected 2, got 3");
    }

    #[test]
    fn positions_and_scores_must_be_finite() {
        let points = vec![[0.0, 1.0], [f32::NAN, 2.0]];
        let error = LocalFeatures::new(points, vec![0.0; 2], float(2)).unwrap_err();
        assert!(matches!(error, Error::NotFinite { row: 1, column: 0, .. }), "{error}");
        let error = LocalFeatures::new(vec![[0.0; 2]], vec![f32::INFINITY], float(1)).unwrap_err();
        assert!(matches!(error, Error::NotFinite { row: 0, column: 2, .. }), "{error}");
    }

    #[test]
    fn strongest_breaks_ties_by_lower_index() {
        let points = vec![[0.0; 2], [1.0; 2], [2.0; 2], [3.0; 2]];
        let bits = BinaryDescriptors::new(1, vec![10, 11, 12, 13]).unwrap();
        let scores = vec![0.5, 0.9, 0.5, 0.1];
        let features = LocalFeatures::new(points, scores, LocalDescriptors::Binary(bits)).unwrap();
        let best = features.strongest(3);
        assert_eq!(best.keypoints(), [[1.0; 2], [0.0; 2], [2.0; 2]]);
        assert_eq!(best.descriptors().as_binary().unwrap().row(2), [12]);
        assert_eq!(features.strongest(9).len(), 4);
    }
}
