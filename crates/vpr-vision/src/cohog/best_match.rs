//! The best dot product of every query region over all regions of a reference.
//!
//! This is a matrix product followed by a row maximum, fused: the product of `n × 32` and
//! `32 × m` is never stored. Query regions lie in the lanes of vector registers, reference regions
//! are broadcast, so the running maximum is one register per 16 query regions and needs no
//! horizontal step. The widest registers of the processor are chosen at run time.

#![expect(
    clippy::inline_always,
    reason = "only what is inlined into the dispatch is compiled for its registers"
)]

use pulp::{Arch, Simd, WithSimd};

/// Reference regions multiplied at once.
const GROUP: usize = 8;

/// Registers of query regions multiplied at once where there are 32 of them; 24 accumulators,
/// three query and three maximum registers just fit.
const WIDE_TILE: usize = 3;

/// Query regions of one image, packed for the multiplication: register by register, and within one
/// register's worth of regions value by value.
#[derive(Clone, Debug)]
pub(super) struct QueryPanels {
    values: Vec<f32>,
    n_regions: usize,
    depth: usize,
}

/// Reference regions of one image, packed in groups of [`GROUP`] and within one group value by
/// value. The last region is repeated to fill its group, which no maximum minds.
#[derive(Clone, Debug)]
pub(super) struct ReferenceGroups {
    values: Vec<f32>,
    depth: usize,
}

impl QueryPanels {
    /// Packs the regions of `depth` values that `regions` yields.
    pub(super) fn pack<'a>(regions: impl Iterator<Item = &'a [f32]>, depth: usize) -> Self {
        let lanes = lanes();
        let mut values = Vec::new();
        let mut n_regions = 0;
        for region in regions {
            let lane = n_regions % lanes;
            if lane == 0 {
                values.resize(values.len() + lanes * depth, 0.0);
            }
            let panel = values.len() - lanes * depth;
            for (slot, &value) in values[panel + lane..].iter_mut().step_by(lanes).zip(region) {
                *slot = value;
            }
            n_regions += 1;
        }
        Self { values, n_regions, depth }
    }

    /// Number of packed regions.
    #[cfg(test)]
    pub(super) fn n_regions(&self) -> usize {
        self.n_regions
    }
}

impl ReferenceGroups {
    /// Packs `regions`, rows of `depth` values.
    pub(super) fn pack(regions: &[f32], depth: usize) -> Self {
        let n_regions = regions.len() / depth;
        let mut values = vec![0.0; n_regions.next_multiple_of(GROUP) * depth];
        for (first, group) in
            (0..n_regions).step_by(GROUP).zip(values.chunks_exact_mut(GROUP * depth))
        {
            for member in 0..GROUP {
                let region = (first + member).min(n_regions - 1);
                let region = &regions[region * depth..][..depth];
                for (slot, &value) in group[member..].iter_mut().step_by(GROUP).zip(region) {
                    *slot = value;
                }
            }
        }
        Self { values, depth }
    }
}

/// For every region of `query` its best dot product over all regions of `reference`.
pub(super) fn best_matches(query: &QueryPanels, reference: &ReferenceGroups) -> Vec<f32> {
    debug_assert_eq!(query.depth, reference.depth, "regions of different depth");
    let mut best = vec![f32::NEG_INFINITY; query.values.len() / query.depth];
    Arch::new().dispatch(BestMatches { query, reference, best: &mut best });
    best.truncate(query.n_regions);
    best
}

/// How many f32 the widest register of this processor holds.
fn lanes() -> usize {
    struct Lanes;
    impl WithSimd for Lanes {
        type Output = usize;
        fn with_simd<S: Simd>(self, _: S) -> usize {
            S::F32_LANES
        }
    }
    Arch::new().dispatch(Lanes)
}

struct BestMatches<'a> {
    query: &'a QueryPanels,
    reference: &'a ReferenceGroups,
    best: &'a mut [f32],
}

impl WithSimd for BestMatches<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { query, reference, best } = self;
        let panels = S::as_simd_f32s(&query.values).0;
        let best = S::as_mut_simd_f32s(best).0;
        let references = reference.values.as_chunks::<GROUP>().0;
        if S::REGISTER_COUNT >= 32 {
            tiles::<S, WIDE_TILE>(simd, panels, references, best, query.depth);
        } else {
            tiles::<S, 1>(simd, panels, references, best, query.depth);
        }
    }
}

/// Walks over the query regions, `TILE` registers at a time.
#[inline(always)]
fn tiles<S: Simd, const TILE: usize>(
    simd: S,
    panels: &[S::f32s],
    references: &[[f32; GROUP]],
    best: &mut [S::f32s],
    depth: usize,
) {
    let (tiles, rest) = best.as_chunks_mut::<TILE>();
    let (panels, panels_of_rest) = panels.split_at(tiles.len() * TILE * depth);
    for (best, panels) in tiles.iter_mut().zip(panels.chunks_exact(TILE * depth)) {
        *best = tile(simd, std::array::from_fn(|i| &panels[i * depth..][..depth]), references);
    }
    for (best, panel) in rest.iter_mut().zip(panels_of_rest.chunks_exact(depth)) {
        [*best] = tile(simd, [panel], references);
    }
}

/// The best products of `TILE` registers of query regions over all references.
#[inline(always)]
fn tile<S: Simd, const TILE: usize>(
    simd: S,
    panels: [&[S::f32s]; TILE],
    references: &[[f32; GROUP]],
) -> [S::f32s; TILE] {
    let depth = panels[0].len();
    let mut best = [simd.splat_f32s(f32::NEG_INFINITY); TILE];
    for group in references.chunks_exact(depth) {
        let mut products = [[simd.splat_f32s(0.0); TILE]; GROUP];
        for (value, references) in group.iter().enumerate() {
            let queries: [S::f32s; TILE] = std::array::from_fn(|i| panels[i][value]);
            for (products, &reference) in products.iter_mut().zip(references) {
                let reference = simd.splat_f32s(reference);
                for (product, query) in products.iter_mut().zip(queries) {
                    *product = simd.mul_add_e_f32s(query, reference, *product);
                }
            }
        }
        for products in products {
            for (best, product) in best.iter_mut().zip(products) {
                *best = simd.max_f32s(*best, product);
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use proptest::{collection::vec, prelude::*};

    use super::*;

    /// The same by the definition, in f64.
    fn slow(queries: &[f32], references: &[f32], depth: usize) -> Vec<f64> {
        let dot = |a: &[f32], b: &[f32]| -> f64 {
            a.iter().zip(b).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum()
        };
        let best =
            |query| references.chunks(depth).map(|it| dot(query, it)).fold(f64::MIN, f64::max);
        queries.chunks(depth).map(best).collect()
    }

    fn regions(depth: usize) -> impl Strategy<Value = Vec<f32>> {
        (1usize..70).prop_flat_map(move |n_regions| vec(-1.0f32..1.0, n_regions * depth))
    }

    proptest! {
        #[test]
        fn the_fast_kernel_equals_the_slow_one(
            (depth, queries, references) in (1usize..=40).prop_flat_map(|depth| {
                (Just(depth), regions(depth), regions(depth))
            })
        ) {
            let panels = QueryPanels::pack(queries.chunks(depth), depth);
            let groups = ReferenceGroups::pack(&references, depth);
            let fast = best_matches(&panels, &groups);
            let slow = slow(&queries, &references, depth);
            prop_assert_eq!(fast.len(), slow.len());
            for (fast, slow) in fast.into_iter().zip(slow) {
                prop_assert!((f64::from(fast) - slow).abs() < 1e-5, "{} {}", fast, slow);
            }
        }
    }
}
