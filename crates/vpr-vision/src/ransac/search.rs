//! The loop: samples, models, and which explains most.

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    reason = "sizes of samples and blocks; a number of samples, above 0, saturates"
)]

use pulp::{Arch, Simd, WithSimd};
use vpr_core::Result;

use super::{
    Correspondence, Inliers, RansacParams,
    geometry::{Geometry, Matrix},
    sampling::Draws,
};

/// The model of a sample that explains most, the first of equals, or that of all its inliers if it explains no fewer.
pub(super) fn search<G: Geometry>(
    points: &[Correspondence],
    params: &RansacParams,
    threshold: f64,
) -> Result<Inliers> {
    params.check()?;
    let n = points.len();
    let mut found = Inliers { model: None, mask: vec![false; n], iterations: 0 };
    if n < G::SAMPLE {
        return Ok(found);
    }
    let below = threshold * threshold;
    let judge = Judge::new(points);
    let mut draws = Draws::new(params.seed, points);
    let mut models = Vec::new();
    let mut most = G::SAMPLE - 1;
    let mut limit = params.iterations;
    while found.iterations < limit {
        found.iterations += 1;
        models.clear();
        G::fit(draws.next::<G>(), &mut models);
        for model in &models {
            let Some(count) = judge.more_than::<G>(model, below, most) else { continue };
            most = count;
            found.model = Some(*model);
            if let Some(confidence) = params.confidence {
                limit = limit.min(enough(count as f64 / n as f64, G::SAMPLE, confidence));
            }
        }
    }
    let Some(model) = found.model else { return Ok(found) };
    found.mask = mask::<G>(&model, points, below);
    if most > G::SAMPLE {
        let inliers: Vec<_> =
            points.iter().zip(&found.mask).filter(|it| *it.1).map(|it| *it.0).collect();
        models.clear();
        G::refit(&inliers, &mut models);
        for model in &models {
            let Some(count) = judge.more_than::<G>(model, below, most - 1) else { continue };
            most = count;
            found.model = Some(*model);
            found.mask = mask::<G>(model, points, below);
        }
    }
    Ok(found)
}

/// Which correspondences a model explains.
pub(super) fn mask<G: Geometry>(
    model: &Matrix,
    points: &[Correspondence],
    below: f64,
) -> Vec<bool> {
    let explained = |it: &Correspondence| {
        let ([x, y], [u, v]) = (it.query, it.reference);
        G::explains(model, x, y, u, v, below)
    };
    points.iter().map(explained).collect()
}

/// Samples after which one of inliers alone was drawn with a probability (Fischler & Bolles 1981).
fn enough(share: f64, sample: usize, confidence: f64) -> u32 {
    let all = share.powi(sample as i32);
    if all >= 1.0 {
        return 1;
    }
    let needed = ((1.0 - confidence.min(1.0 - 1e-12)).ln() / (1.0 - all).ln()).ceil();
    // A share too small to change 1 needs infinitely many: the cast saturates.
    if needed > 0.0 { (needed as u32).max(1) } else { u32::MAX }
}

/// Correspondences that are judged at once; a multiple of what any register holds.
const BLOCK: usize = 32;

struct Block {
    x: [f64; BLOCK],
    y: [f64; BLOCK],
    u: [f64; BLOCK],
    v: [f64; BLOCK],
}

/// Counts what models explain.
struct Judge {
    arch: Arch,
    /// Coordinates by axis; the last are padded with what nothing explains.
    blocks: Vec<Block>,
    n: usize,
}

impl Judge {
    fn new(points: &[Correspondence]) -> Self {
        let block = |chunk: &[Correspondence]| {
            let mut block =
                Block { x: [f64::NAN; BLOCK], y: [0.0; BLOCK], u: [0.0; BLOCK], v: [0.0; BLOCK] };
            for (at, it) in chunk.iter().enumerate() {
                [block.x[at], block.y[at]] = it.query;
                [block.u[at], block.v[at]] = it.reference;
            }
            block
        };
        let blocks = points.chunks(BLOCK).map(block).collect();
        Self { arch: Arch::new(), blocks, n: points.len() }
    }

    /// How many a model explains, if more than `most`; the count ends where that cannot be.
    fn more_than<G: Geometry>(&self, model: &Matrix, below: f64, most: usize) -> Option<usize> {
        let blocks = &self.blocks;
        let geometry = std::marker::PhantomData::<G>;
        self.arch.dispatch(Count { blocks, n: self.n, model, below, most, geometry })
    }
}

struct Count<'a, G> {
    blocks: &'a [Block],
    n: usize,
    model: &'a Matrix,
    below: f64,
    most: usize,
    geometry: std::marker::PhantomData<G>,
}

impl<G: Geometry> WithSimd for Count<'_, G> {
    type Output = Option<usize>;

    /// Multiplications and additions are not fused, so all instruction sets count the same.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Option<usize> {
        let mut missed = 0;
        let may_miss = self.n.checked_sub(self.most + 1)?;
        let mut left = self.n;
        for Block { x, y, u, v } in self.blocks {
            let mut count = 0_u64;
            for at in 0..BLOCK {
                let explained = G::explains(self.model, x[at], y[at], u[at], v[at], self.below);
                count += u64::from(explained);
            }
            let held = left.min(BLOCK);
            left -= held;
            missed += held - count as usize;
            if missed > may_miss {
                return None;
            }
        }
        Some(self.n - missed)
    }
}
