//! Which samples are drawn and how models are scored.

use kornia_3d::ransac::{Consensus, ConsensusOutcome, Match2d2d, Sampler, UniformSampler};
use kornia_algebra::Vec2F64;
use rand_chacha::ChaCha8Rng;

/// Whether a sample can be one of inliers.
pub(super) type Rule = fn(&[Match2d2d], &[usize]) -> bool;

/// A sample is drawn again at most so often; then it is taken as it is.
const ATTEMPTS: usize = 100;

/// Distinct indices that obey a rule.
pub(super) struct Draws<'a> {
    uniform: UniformSampler<ChaCha8Rng>,
    samples: &'a [Match2d2d],
    rule: Option<Rule>,
}

impl<'a> Draws<'a> {
    pub(super) fn new(rng: ChaCha8Rng, samples: &'a [Match2d2d], rule: Option<Rule>) -> Self {
        Self { uniform: UniformSampler::new(rng), samples, rule }
    }
}

impl Sampler for Draws<'_> {
    fn sample(&mut self, n: usize, out: &mut [usize]) {
        for _ in 0..ATTEMPTS {
            self.uniform.sample(n, out);
            if self.rule.is_none_or(|rule| rule(self.samples, out)) {
                return;
            }
        }
    }
}

/// The number of residuals below a bound.
pub(super) struct Count {
    /// Squared threshold, as kornia's residuals are squared.
    pub(super) below: f64,
    /// Whether the loop may end early.
    pub(super) adaptive: bool,
}

impl Consensus for Count {
    fn consensus(&self, residuals: &[f64], inliers: &mut Vec<bool>) -> ConsensusOutcome {
        inliers.clear();
        inliers.extend(residuals.iter().map(|&residual| residual < self.below));
        let count = inliers.iter().filter(|&&inlier| inlier).count();
        // The loop shortens itself by `inlier_count`, and not at all if that is zero.
        let inlier_count = if self.adaptive { count } else { 0 };
        ConsensusOutcome { score: count as f64, inlier_count }
    }
}

/// Whether four correspondences can belong to a homography: no three points on a line in either image, and every
/// triangle keeps its orientation, or every one changes it.
pub(super) fn is_fair_quad(samples: &[Match2d2d], indices: &[usize]) -> bool {
    const TRIANGLES: [[usize; 3]; 4] = [[0, 1, 2], [1, 2, 3], [0, 2, 3], [0, 1, 3]];
    let &[a, b, c, d] = indices else { return true };
    let quad = [samples[a], samples[b], samples[c], samples[d]];
    let mut turned = 0;
    for triangle in TRIANGLES {
        let before = area(triangle.map(|corner| quad[corner].x1));
        let after = area(triangle.map(|corner| quad[corner].x2));
        if before.abs() < FLAT || after.abs() < FLAT {
            return false;
        }
        turned += usize::from(before * after < 0.0);
    }
    turned == 0 || turned == TRIANGLES.len()
}

/// Triangles of less area, in square pixels, are flat.
const FLAT: f64 = 1e-3;

fn area([a, b, c]: [Vec2F64; 3]) -> f64 {
    0.5 * ((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x))
}
