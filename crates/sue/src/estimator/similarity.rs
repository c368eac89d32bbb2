//! Similarities of ranked references, from their distances.

use ndarray::ArrayView1;

/// Cosine similarity of unit descriptors at Euclidean distance `d`: `1 − d² / 2`, at least 0.
///
/// Ratios of similarities need a zero that means "not similar at all"; opposite descriptors count
/// as that.
pub(super) fn similarity(distance: f32) -> f64 {
    let distance = f64::from(distance);
    (1.0 - distance * distance / 2.0).max(0.0)
}

/// Mean over the ranks after the first of their similarity relative to the first; 1 if none is
/// similar at all.
pub(super) fn mean_ratio(distances: ArrayView1<'_, f32>) -> f64 {
    let best = similarity(distances[0]);
    if best == 0.0 || distances.len() < 2 {
        return 1.0;
    }
    let rest = distances.iter().skip(1).map(|&it| similarity(it)).sum::<f64>();
    rest / best / (distances.len() - 1) as f64
}

/// Median similarity of all ranks relative to the first; 1 if none is similar at all.
pub(super) fn median_ratio(distances: ArrayView1<'_, f32>) -> f64 {
    let best = similarity(distances[0]);
    if best == 0.0 {
        return 1.0;
    }
    // Ranks descend in similarity, so the middle ones are the median.
    let n = distances.len();
    let median = f64::midpoint(similarity(distances[(n - 1) / 2]), similarity(distances[n / 2]));
    median / best
}
