//! How similar two places are: the mean over the query's regions of interest of their best match.

use ndarray::{Array2, s};
use rayon::prelude::*;
use vpr_core::{Error, Result, Similarities};

use super::{
    CoHogDescriptor,
    best_match::{QueryPanels, ReferenceGroups, best_matches},
};

/// References that are packed for multiplication at a time, 8 MB as published.
const PACKED_REFERENCES: usize = 64;

/// Mean over the query's regions of interest of the best dot product with any region of the reference.
///
/// From −1 to 1 for regions of length one; not symmetric. Regions that are not of interest are not multiplied.
///
/// # Errors
///
/// [`Error::Mismatch`] if the two differ in the number or depth of their regions.
pub fn similarity(query: &CoHogDescriptor, reference: &CoHogDescriptor) -> Result<f64> {
    check_shape(reference, query)?;
    Ok(mean_best_match(&pack_query(query), &pack_reference(reference)))
}

/// [`similarity`] of every query with every reference, in parallel; the same bits for any number of threads.
///
/// # Errors
///
/// [`Error::Empty`] without a query or a reference, [`Error::Mismatch`] if the images differ in the number or depth
/// of their regions, [`Error::NotFinite`] if a similarity overflows.
///
/// # Panics
///
/// Never: every query is matched with every reference.
pub fn similarities(
    queries: &[CoHogDescriptor],
    references: &[CoHogDescriptor],
) -> Result<Similarities> {
    let Some(first) = references.first() else { return Err(Error::Empty("references")) };
    queries.iter().chain(references).try_for_each(|other| check_shape(first, other))?;

    let queries: Vec<QueryPanels> = queries.par_iter().map(pack_query).collect();
    let mut scores = Array2::zeros((queries.len(), references.len()));
    for (start, block) in (0..).step_by(PACKED_REFERENCES).zip(references.chunks(PACKED_REFERENCES))
    {
        let block: Vec<ReferenceGroups> = block.par_iter().map(pack_reference).collect();
        let pairs = queries.par_iter().flat_map(|query| {
            block.par_iter().map(move |reference| mean_best_match(query, reference))
        });
        let pairs = Array2::from_shape_vec((queries.len(), block.len()), pairs.collect())
            .expect("every query with every reference");
        scores.slice_mut(s![.., start..start + block.len()]).assign(&pairs);
    }
    Similarities::new(scores)
}

fn check_shape(expected: &CoHogDescriptor, actual: &CoHogDescriptor) -> Result<()> {
    let mismatch = |what, expected, actual| Err(Error::Mismatch { what, expected, actual });
    if expected.n_regions() != actual.n_regions() {
        mismatch("regions of an image", expected.n_regions(), actual.n_regions())
    } else if expected.depth() != actual.depth() {
        mismatch("depth of a region", expected.depth(), actual.depth())
    } else {
        Ok(())
    }
}

fn pack_query(query: &CoHogDescriptor) -> QueryPanels {
    let regions = query.regions_slice().chunks_exact(query.depth());
    let of_interest = regions.zip(query.of_interest()).filter(|&(_, &of_interest)| of_interest);
    QueryPanels::pack(of_interest.map(|(region, _)| region), query.depth())
}

fn pack_reference(reference: &CoHogDescriptor) -> ReferenceGroups {
    ReferenceGroups::pack(reference.regions_slice(), reference.depth())
}

fn mean_best_match(query: &QueryPanels, reference: &ReferenceGroups) -> f64 {
    let best = best_matches(query, reference);
    best.iter().map(|&product| f64::from(product)).sum::<f64>() / best.len() as f64
}

#[cfg(test)]
mod tests {
    use rayon::ThreadPoolBuilder;

    use super::*;

    /// Regions of length one that differ from seed to seed; every `skip`-th is of no interest.
    fn place(seed: u32, n_regions: usize, depth: usize, skip: usize) -> CoHogDescriptor {
        let mut state = seed.wrapping_mul(0x9E37_79B9) | 1;
        let mut regions = Array2::from_shape_simple_fn((n_regions, depth), || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f32::from((state >> 16) as u16)
        });
        for mut region in regions.outer_iter_mut() {
            let length = region.dot(&region).sqrt();
            region /= length;
        }
        let of_interest = (0..n_regions).map(|region| region % skip != 0).collect();
        CoHogDescriptor::new(regions, of_interest).unwrap()
    }

    #[test]
    fn a_place_is_exactly_as_similar_as_its_best_regions() {
        let query = CoHogDescriptor::new(
            ndarray::array![[1.0, 0.0], [0.0, 1.0], [0.6, 0.8]],
            vec![true, false, true],
        );
        let reference = CoHogDescriptor::new(
            ndarray::array![[0.0, 1.0], [0.8, 0.6], [0.0, 0.5]],
            vec![false, true, true],
        );
        // best are 0.8 and 0.96, both with the second region; the second query region is not asked
        let mean = similarity(&query.unwrap(), &reference.unwrap()).unwrap();
        assert!((mean - 0.88).abs() < 1e-6, "{mean}");
    }

    #[test]
    fn regions_of_no_interest_are_not_multiplied() {
        let (query, reference) = (place(1, 50, 32, 3), place(2, 50, 32, 3));
        let clean = similarity(&query, &reference).unwrap();
        let mut poisoned = query.regions().to_owned();
        for region in (0..50).step_by(3) {
            poisoned.row_mut(region).fill(f32::MAX);
        }
        let poisoned = CoHogDescriptor::new(poisoned, query.of_interest().to_vec()).unwrap();
        assert_eq!(similarity(&poisoned, &reference).unwrap().to_bits(), clean.to_bits());
        assert_eq!(pack_query(&poisoned).n_regions(), 33);
    }

    #[test]
    fn a_batch_equals_its_pairs_for_any_number_of_threads() {
        let queries: Vec<_> = (0..5).map(|seed| place(seed, 40, 32, 4)).collect();
        let references: Vec<_> = (50..180).map(|seed| place(seed, 40, 32, 4)).collect();
        let batch = |threads| {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| similarities(&queries, &references)).unwrap()
        };
        let one = batch(1);
        assert_eq!(one, batch(2));
        assert_eq!(one, batch(5));
        for ((query, reference), &score) in one.view().indexed_iter() {
            let pair = similarity(&queries[query], &references[reference]).unwrap();
            assert_eq!(score.to_bits(), pair.to_bits(), "{query} × {reference}");
        }
    }

    #[test]
    fn images_of_different_shape_are_refused() {
        let (small, large) = (place(1, 4, 32, 2), place(1, 9, 32, 2));
        assert!(matches!(similarity(&small, &large), Err(Error::Mismatch { .. })));
        let other = place(1, 4, 36, 2);
        assert!(matches!(similarities(&[other], &[small]), Err(Error::Mismatch { .. })));
        assert!(matches!(similarities(&[], std::slice::from_ref(&large)), Err(Error::Empty(_))));
        assert!(matches!(similarities(&[large], &[]), Err(Error::Empty(_))));
    }

    #[test]
    fn an_overflow_is_an_error() {
        let huge =
            CoHogDescriptor::new(Array2::from_elem((4, 32), f32::MAX), vec![true; 4]).unwrap();
        let result = similarities(std::slice::from_ref(&huge), std::slice::from_ref(&huge));
        assert!(matches!(result, Err(Error::NotFinite { .. })));
    }
}
