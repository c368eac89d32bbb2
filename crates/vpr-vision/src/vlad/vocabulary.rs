//! VLAD with a vocabulary from k-means: every feature belongs to its nearest centre.

use ndarray::{Array1, Array2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use vpr_core::{Descriptors, Error, Result, knn::nearest, retrieve};

/// How a [`Vocabulary`] is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct VocabularyParams {
    /// Number of centres.
    pub clusters: usize,
    /// Most rounds of Lloyd's algorithm; it ends earlier if no feature changes its centre.
    pub rounds: usize,
    /// Seed of the first centres.
    pub seed: u64,
}

impl Default for VocabularyParams {
    fn default() -> Self {
        Self { clusters: 64, rounds: 50, seed: 0 }
    }
}

/// Cluster centres of local features, `clusters × dim`.
///
/// Jégou et al., *Aggregating Local Descriptors into a Compact Image Representation* (2010).
#[derive(Clone, Debug, PartialEq)]
pub struct Vocabulary {
    centres: Descriptors,
}

impl Vocabulary {
    /// Clusters features, `n × dim`: k-means++ from a seed, then Lloyd's rounds in f64.
    ///
    /// The result is the same for any number of threads. A centre that loses all its features
    /// moves to the feature farthest from its own centre.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if there are fewer features than clusters, or none are wanted.
    pub fn fit(features: &Descriptors, params: &VocabularyParams) -> Result<Self> {
        if params.clusters == 0 || params.clusters > features.len() {
            return Err(Error::Parameter {
                name: "clusters",
                value: params.clusters.to_string(),
                reason: "must be positive and at most the number of features",
            });
        }
        let mut centres = first_centres(features, params)?;
        let mut assigned = Vec::new();
        for _ in 0..params.rounds {
            let nearest = retrieve(features, &centres, 1)?;
            let now = nearest.best();
            if now == assigned {
                break;
            }
            let far = |image: usize| nearest.distances(image)[0];
            centres = means(features, &now, params.clusters, far)?;
            assigned = now;
        }
        Ok(Self { centres })
    }

    /// A vocabulary from stored centres, `clusters × dim`.
    #[must_use]
    pub fn from_centres(centres: Descriptors) -> Self {
        Self { centres }
    }

    /// The centres, `clusters × dim`.
    #[must_use]
    pub fn centres(&self) -> &Descriptors {
        &self.centres
    }

    /// The VLAD of one image's features (`n × dim`): unit length, cluster by cluster, `clusters · dim`.
    ///
    /// `intra_normalise` scales every cluster's residual to unit length before the whole; clusters
    /// without features stay zero.
    ///
    /// # Errors
    ///
    /// [`Error::Mismatch`] if the features have another dimension than the centres.
    pub fn encode(&self, features: &Descriptors, intra_normalise: bool) -> Result<Array1<f32>> {
        self.encode_all(std::slice::from_ref(features), intra_normalise)
    }

    /// [`Self::encode`] of several sets of features of one image, such as those of several scales.
    ///
    /// # Errors
    ///
    /// As [`Self::encode`].
    pub fn encode_all(&self, sets: &[Descriptors], intra_normalise: bool) -> Result<Array1<f32>> {
        let (clusters, dim) = (self.centres.len(), self.centres.dim());
        let row_len = dim.max(1);
        let mut sums = vec![0.0_f64; clusters * dim];
        let mut counts = vec![0_usize; clusters];
        for features in sets.iter().filter(|it| !it.is_empty()) {
            let assigned = nearest(&self.centres, features)?;
            for (row, cluster) in features.as_slice().chunks_exact(row_len).zip(assigned) {
                counts[cluster] += 1;
                let sum = &mut sums[cluster * dim..(cluster + 1) * dim];
                sum.iter_mut().zip(row).for_each(|(sum, x)| *sum += f64::from(*x));
            }
        }
        let centres = self.centres.as_slice().chunks_exact(row_len);
        for ((row, centre), count) in sums.chunks_exact_mut(row_len).zip(centres).zip(counts) {
            row.iter_mut().zip(centre).for_each(|(sum, c)| *sum -= count as f64 * f64::from(*c));
            if intra_normalise {
                scale_to_unit(row);
            }
        }
        scale_to_unit(&mut sums);
        Ok(sums.iter().map(|&x| narrow(x)).collect())
    }
}

#[expect(clippy::cast_possible_truncation, reason = "descriptors are f32")]
fn narrow(x: f64) -> f32 {
    x as f32
}

fn scale_to_unit(values: &mut [f64]) {
    let norm = values.iter().map(|x| x * x).sum::<f64>().sqrt();
    if norm > 0.0 {
        for x in values {
            *x /= norm;
        }
    }
}

/// k-means++: each further centre is a feature, drawn in proportion to its squared distance to the
/// centres so far.
#[expect(clippy::cast_possible_truncation, reason = "an index of features")]
fn first_centres(features: &Descriptors, params: &VocabularyParams) -> Result<Descriptors> {
    let mut rng = ChaCha8Rng::seed_from_u64(params.seed);
    let mut chosen = vec![rng.random_range(0..features.len() as u64) as usize];
    let mut squared = vec![f64::INFINITY; features.len()];
    while chosen.len() < params.clusters {
        let newest = features.row(chosen[chosen.len() - 1]);
        for (index, nearest) in squared.iter_mut().enumerate() {
            let difference = |(a, b): (&f32, &f32)| (f64::from(*a) - f64::from(*b)).powi(2);
            *nearest =
                features.row(index).iter().zip(newest).map(difference).sum::<f64>().min(*nearest);
        }
        let mut left = rng.random::<f64>() * squared.iter().sum::<f64>();
        let drawn = squared.iter().position(|&share| {
            left -= share;
            left < 0.0
        });
        // All features coincide with centres: any that is not one yet.
        let spare = || (0..features.len()).find(|index| !chosen.contains(index));
        chosen.extend(drawn.or_else(spare));
    }
    let rows = chosen.iter().flat_map(|&index| features.row(index).to_vec()).collect();
    let rows = Array2::from_shape_vec((chosen.len(), features.dim()), rows);
    Descriptors::new(rows.expect("one row per centre"))
}

/// The means of the features of every cluster, summed in order.
fn means(
    features: &Descriptors,
    assigned: &[usize],
    clusters: usize,
    distance: impl Fn(usize) -> f32,
) -> Result<Descriptors> {
    let mut sums = Array2::<f64>::zeros((clusters, features.dim()));
    let mut counts = vec![0_usize; clusters];
    for (index, &cluster) in assigned.iter().enumerate() {
        counts[cluster] += 1;
        for (sum, x) in sums.row_mut(cluster).iter_mut().zip(features.row(index)) {
            *sum += f64::from(*x);
        }
    }
    let mut farthest: Vec<usize> = (0..features.len()).collect();
    farthest.sort_by(|&a, &b| distance(b).total_cmp(&distance(a)));
    let mut farthest = farthest.into_iter();
    for (cluster, count) in counts.iter().enumerate() {
        let mut row = sums.row_mut(cluster);
        if let (0, Some(index)) = (*count, farthest.next()) {
            for (sum, x) in row.iter_mut().zip(features.row(index)) {
                *sum = f64::from(*x);
            }
        } else {
            row /= *count as f64;
        }
    }
    Descriptors::new(sums.mapv(narrow))
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    fn corners() -> Descriptors {
        let jitter = |index: usize| (index * 7 % 11) as f32 / 100.0;
        let rows = Array2::from_shape_fn((90, 2), |(row, column)| {
            let corner = [[0.0, 0.0], [5.0, 0.0], [0.0, 5.0]][row % 3];
            corner[column] + jitter(2 * row + column)
        });
        Descriptors::new(rows).unwrap()
    }

    #[test]
    fn clusters_are_found_and_the_seed_decides_all() {
        let params = VocabularyParams { clusters: 3, seed: 4, ..Default::default() };
        let first = Vocabulary::fit(&corners(), &params).unwrap();
        assert_eq!(first, Vocabulary::fit(&corners(), &params).unwrap());
        let mut centres: Vec<_> = first
            .centres()
            .view()
            .outer_iter()
            .map(|row| (row[0].round(), row[1].round()))
            .collect();
        centres.sort_by(|a, b| a.partial_cmp(b).unwrap());
        assert_eq!(centres, [(0.0, 0.0), (0.0, 5.0), (5.0, 0.0)]);
    }

    #[test]
    fn an_image_is_the_residuals_of_its_features() {
        let vocabulary =
            Vocabulary::from_centres(Descriptors::new(array![[0.0, 0.0], [10.0, 0.0]]).unwrap());
        let features = Descriptors::new(array![[1.0, 0.0], [1.0, 2.0], [10.0, 4.0]]).unwrap();
        // Residual sums (2, 2) and (0, 4).
        let plain = vocabulary.encode(&features, false).unwrap();
        let norm = 24f32.sqrt();
        for (a, b) in plain.iter().zip([2.0 / norm, 2.0 / norm, 0.0, 4.0 / norm]) {
            approx::assert_abs_diff_eq!(*a, b, epsilon = 1e-6);
        }
        let intra = vocabulary.encode(&features, true).unwrap();
        for (a, b) in intra.iter().zip([0.5, 0.5, 0.0, 0.5f32.sqrt()]) {
            approx::assert_abs_diff_eq!(*a, b, epsilon = 1e-6);
        }
    }

    #[test]
    fn identical_features_still_fill_the_vocabulary() {
        let features = Descriptors::new(Array2::ones((5, 3))).unwrap();
        let params = VocabularyParams { clusters: 4, ..Default::default() };
        assert_eq!(Vocabulary::fit(&features, &params).unwrap().centres().len(), 4);
        let params = VocabularyParams { clusters: 6, ..Default::default() };
        assert!(Vocabulary::fit(&features, &params).is_err());
    }
}
