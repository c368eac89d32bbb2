//! What "near" means, and the one routine that decides which of two references is nearer.

use serde::{Deserialize, Serialize};

/// How two descriptors are compared; whatever the metric, a lower distance is nearer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Metric {
    /// Euclidean distance ‖q − x‖, not squared.
    #[default]
    Euclidean,
    /// Cosine distance 1 − q·x / (‖q‖ ‖x‖), between 0 and 2; it is 1 if a descriptor is zero.
    Cosine,
    /// Inner product, negated: the distance is −q·x, so that the largest product is nearest.
    InnerProduct,
    /// Manhattan (L1) distance Σ |qᵢ − xᵢ|.
    Manhattan,
}

impl Metric {
    /// The distance of two descriptors of the same length, to the last bit of every search.
    ///
    /// # Panics
    ///
    /// If they differ in length.
    #[must_use]
    pub fn distance(self, query: &[f32], reference: &[f32]) -> f32 {
        self.distance_of_key(self.key(query, reference))
    }

    /// What references are ordered by: the distance in f64, squared if it is Euclidean.
    ///
    /// Every term is computed in f64 from the f32 values and added in one order, the same on every
    /// machine; the relative error of a sum of n terms is below (n + 3)·2⁻⁵³ of the sum of their
    /// magnitudes. Two searches agree to the bit because both order by this number.
    pub(super) fn key(self, query: &[f32], reference: &[f32]) -> f64 {
        match self {
            Self::Euclidean => sum(query, reference, |q, x| (q - x) * (q - x)),
            Self::Manhattan => sum(query, reference, |q, x| (q - x).abs()),
            Self::InnerProduct => 0.0 - sum(query, reference, |q, x| q * x),
            Self::Cosine => {
                let product = sum(query, reference, |q, x| q * x);
                let norms = (squared_norm(query) * squared_norm(reference)).sqrt();
                // NaN stays NaN, so that it is found.
                if norms == 0.0 { 1.0 } else { (1.0 - product / norms).clamp(0.0, 2.0) }
            }
        }
    }

    /// The distance, in the units of the metric, that belongs to a key.
    #[expect(clippy::cast_possible_truncation, reason = "distances are f32")]
    pub(super) fn distance_of_key(self, key: f64) -> f32 {
        match self {
            Self::Euclidean => key.sqrt() as f32,
            Self::Cosine | Self::InnerProduct | Self::Manhattan => key as f32,
        }
    }
}

/// ‖x‖² in f64, added in the order of [`Metric::key`].
pub(super) fn squared_norm(values: &[f32]) -> f64 {
    sum(values, values, |a, b| a * b)
}

/// Independent sums that run side by side, so that the sum need not wait for every addition.
const LANES: usize = 8;

/// Σ term(qᵢ, xᵢ): lane i mod 8 collects term i, then the lanes are added pairwise.
#[inline]
fn sum(query: &[f32], reference: &[f32], term: impl Fn(f64, f64) -> f64) -> f64 {
    assert_eq!(query.len(), reference.len(), "descriptors of different dimension");
    let mut lanes = [0.0; LANES];
    let (q_chunks, q_rest) = query.as_chunks::<LANES>();
    let (x_chunks, x_rest) = reference.as_chunks::<LANES>();
    for (q, x) in q_chunks.iter().zip(x_chunks) {
        for lane in 0..LANES {
            lanes[lane] += term(f64::from(q[lane]), f64::from(x[lane]));
        }
    }
    for (lane, (&q, &x)) in lanes.iter_mut().zip(q_rest.iter().zip(x_rest)) {
        *lane += term(f64::from(q), f64::from(x));
    }
    let [even, odd] = [0, 1].map(|i| (lanes[i] + lanes[i + 4]) + (lanes[i + 2] + lanes[i + 6]));
    even + odd
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    #[expect(clippy::float_cmp, reason = "small integers are exact")]
    fn distances_by_hand() {
        let (q, x) = ([1.0, 2.0, -2.0], [1.0, -2.0, 1.0]);
        assert_eq!(Metric::Euclidean.distance(&q, &x), 5.0);
        assert_eq!(Metric::Manhattan.distance(&q, &x), 7.0);
        assert_eq!(Metric::InnerProduct.distance(&q, &x), 5.0);
        assert_eq!(Metric::Cosine.distance(&[3.0, 4.0], &[4.0, 3.0]), 0.04);
    }

    #[test]
    #[expect(clippy::float_cmp, reason = "defined, not computed")]
    fn cosine_distance_of_a_zero_descriptor_is_one() {
        assert_eq!(Metric::Cosine.distance(&[0.0, 0.0], &[1.0, 0.0]), 1.0);
    }

    proptest! {
        #[test]
        fn lanes_agree_with_a_plain_sum(pairs in prop::collection::vec((-1e3_f32..1e3, -1e3_f32..1e3), 0..70)) {
            let (q, x): (Vec<f32>, Vec<f32>) = pairs.iter().copied().unzip();
            let plain: f64 = pairs.iter().map(|&(q, x)| (f64::from(q) - f64::from(x)).powi(2)).sum();
            let key = Metric::Euclidean.key(&q, &x);
            prop_assert!((key - plain).abs() <= 1e-13 * plain, "{key} {plain}");
        }
    }
}
