//! How far a score computed in f32 can be from the distance it stands for: the proof behind exact
//! search.
//!
//! With u = 2⁻²⁴ and γₙ = n·u / (1 − n·u), a sum of n products in f32, in any order, with or
//! without fused multiply-add, obeys |fl(q·x) − q·x| ≤ γₙ Σ|qᵢxᵢ| ≤ γₙ ‖q‖ ‖x‖ as long as nothing
//! overflows (Higham, *Accuracy and Stability of Numerical Algorithms*, 2nd ed., §3.1). Underflow
//! adds at most n·2⁻¹²⁶, even on hardware that flushes subnormal numbers to zero. From this:
//!
//! | score | stands for | bound |
//! |---|---|---|
//! | fl(‖x‖² − 2 q·x) | ‖q − x‖² − ‖q‖² | γₙ₊₁ (‖x‖² + 2 ‖q‖ ‖x‖), absolute |
//! | fl(−q·x) | −q·x | γₙ ‖q‖ ‖x‖, absolute |
//! | fl(−q·x · w), w = fl(1/‖x‖) | −q·x / ‖x‖ | γ₂ₙ₊₅ ‖q‖, absolute |
//! | fl(Σ (qᵢ − xᵢ)²), fl(Σ abs(qᵢ − xᵢ)) | the sum | γₙ₊₂, relative |
//!
//! ‖x‖ is the largest norm of the block, computed in f32 with a relative error below γₙ and widened
//! by it. Every n below is larger than needed by [`SPARE`]; one unit of it already covers the f64
//! arithmetic of these bounds and of [`Metric::key`](super::Metric), 2²⁹ times finer. A score that is
//! not finite (overflow) bounds nothing: its reference is always a candidate.

/// Terms added to every count of roundings; see the module.
const SPARE: usize = 8;

/// Half the distance of 1 to the next f32: the largest relative error of one rounding.
const UNIT_ROUNDOFF: f64 = 1.0 / 16_777_216.0;

/// Smallest normal f32: no term of a sum loses more than this to underflow.
const UNDERFLOW: f64 = f32::MIN_POSITIVE as f64;

/// Squared norms within this range are normal f32 with room for underflow in the terms; others
/// are not divided by.
pub(super) const SAFE_SQUARED_NORM: std::ops::RangeInclusive<f32> = 8.7e-19..=1.3e36;

/// γₙ: the relative error of n roundings; infinite if it is not a small number.
fn gamma(n: usize) -> f64 {
    let nu = n as f64 * UNIT_ROUNDOFF;
    if nu < 0.25 { nu / (1.0 - nu) } else { f64::INFINITY }
}

/// From the scores of one query in one block to bounds of [`Metric::key`](super::Metric):
/// key = offset + slope · score, up to a relative error of the score and an absolute one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Margin {
    offset: f64,
    slope: f64,
    relative: f64,
    absolute: f64,
}

impl Margin {
    /// Scores fl(‖x‖² − 2 q·x) of rows up to `largest_norm` (see [`norm_bound`]).
    pub(super) fn expanded(dim: usize, query_norm: f64, largest_norm: f64) -> Self {
        let magnitude = largest_norm * (largest_norm + 2.0 * query_norm);
        // The last term: f64 rounding of the offset, where the query dwarfs every row.
        let absolute = gamma(dim + SPARE) * magnitude
            + 4.0 * dim as f64 * UNDERFLOW
            + 8.0 * f64::EPSILON * query_norm * query_norm;
        Self { offset: query_norm * query_norm, slope: 1.0, relative: 0.0, absolute }
    }

    /// Scores fl(−q·x) of rows up to `largest_norm`.
    pub(super) fn product(dim: usize, query_norm: f64, largest_norm: f64) -> Self {
        let absolute =
            gamma(dim + SPARE) * query_norm * largest_norm + 2.0 * dim as f64 * UNDERFLOW;
        Self { offset: 0.0, slope: 1.0, relative: 0.0, absolute }
    }

    /// Scores fl(−q·x · w), w = fl(1/‖x‖), NaN where ‖x‖² is outside of [`SAFE_SQUARED_NORM`].
    pub(super) fn cosine(dim: usize, query_norm: f64) -> Self {
        // Underflow: n·2⁻¹²⁶ / (‖q‖ ‖x‖) with both norms at least 2⁻³⁰ is below n·2⁻⁶⁶.
        let safe = (9.4e-10..1.1e18).contains(&query_norm);
        let absolute = if safe { gamma(2 * dim + 2 * SPARE) } else { f64::INFINITY };
        let slope = if safe { query_norm.recip() } else { 0.0 };
        Self { offset: 1.0, slope, relative: 0.0, absolute }
    }

    /// Scores that are sums of non-negative terms of qᵢ − xᵢ, squared or not.
    pub(super) fn direct(dim: usize) -> Self {
        let relative = gamma(dim + SPARE);
        let usable = relative.is_finite();
        Self {
            offset: 0.0,
            slope: 1.0,
            relative: if usable { relative } else { 0.0 },
            absolute: if usable { 2.0 * dim as f64 * UNDERFLOW } else { f64::INFINITY },
        }
    }

    /// No key of this score is below.
    pub(super) fn lower(&self, score: f32) -> f64 {
        if !score.is_finite() {
            return f64::NEG_INFINITY;
        }
        self.offset + self.slope * f64::from(score) * (1.0 - self.relative) - self.absolute
    }

    /// No key of this score is above.
    pub(super) fn upper(&self, score: f32) -> f64 {
        if !score.is_finite() {
            return f64::INFINITY;
        }
        self.offset + self.slope * f64::from(score) / (1.0 - self.relative) + self.absolute
    }

    /// Finite scores above this belong to keys above `key`, so their references may be dropped.
    #[expect(clippy::cast_possible_truncation, reason = "rounded up afterwards")]
    pub(super) fn cutoff(&self, key: f64) -> f32 {
        let score = (key + self.absolute - self.offset) / (self.slope * (1.0 - self.relative));
        (score as f32).next_up()
    }
}

/// Upper bound of a norm whose square was added up in f32; infinite if that overflowed.
pub(super) fn norm_bound(dim: usize, squared_norm: f32) -> f64 {
    if !squared_norm.is_finite() {
        return f64::INFINITY;
    }
    let squared = f64::from(squared_norm) / (1.0 - gamma(dim + SPARE)).max(0.0);
    (squared + 2.0 * dim as f64 * UNDERFLOW).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cutoff_never_drops_what_the_lower_bound_keeps() {
        for margin in [
            Margin::expanded(512, 3.0, 5.0),
            Margin::product(512, 3.0, 5.0),
            Margin::cosine(512, 3.0),
            Margin::direct(512),
        ] {
            for step in 0..2000_u16 {
                let score = f32::from(step) * 0.017 - 3.0;
                let score = if margin.relative > 0.0 { score.abs() } else { score };
                assert!(score <= margin.cutoff(margin.lower(score)), "{margin:?} {score}");
                assert!(margin.lower(score) < margin.upper(score), "{margin:?} {score}");
            }
        }
    }

    #[test]
    fn overflow_and_hopeless_sums_bound_nothing() {
        let hopeless = Margin::direct(1 << 24);
        assert!(hopeless.lower(1.0) == f64::NEG_INFINITY && hopeless.cutoff(0.0) == f32::INFINITY);
        let margin = Margin::expanded(4, 1.0, norm_bound(4, f32::INFINITY));
        assert!(margin.lower(1.0) == f64::NEG_INFINITY && margin.upper(1.0) == f64::INFINITY);
        let tiny = Margin::cosine(4, 1e-30);
        assert!(tiny.lower(0.5) == f64::NEG_INFINITY);
        let drops = 1e30 > tiny.cutoff(0.0);
        assert!(!drops, "a cutoff of NaN or infinity drops nothing");
    }
}
