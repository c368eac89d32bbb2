//! Nearest neighbours among binary descriptors, by the number of differing bits.

use rayon::prelude::*;
use vpr_core::{Error, Result};

use super::Nearest;
use crate::features::BinaryDescriptors;

/// Queries that one task compares with all references.
const QUERIES_PER_TASK: usize = 64;

/// The two nearest of `references` for every one of `queries`, ties by lower index; nothing if there is none.
pub(super) fn nearest(
    queries: &BinaryDescriptors,
    references: &BinaryDescriptors,
) -> Result<Vec<Nearest>> {
    if queries.row_bytes() != references.row_bytes() {
        return Err(Error::Mismatch {
            what: "bytes of the query descriptors",
            expected: references.row_bytes(),
            actual: queries.row_bytes(),
        });
    }
    if references.is_empty() {
        return Ok(Vec::new());
    }
    let words = queries.row_bytes().div_ceil(8);
    let [queries, references] = [queries, references].map(as_words);
    let of = |query: &[u64]| two_nearest(query, &references);
    Ok(queries
        .par_chunks(words * QUERIES_PER_TASK)
        .flat_map_iter(|chunk| chunk.chunks_exact(words).map(of))
        .collect())
}

/// Rows as whole words; bits beyond the last byte are zero on both sides.
fn as_words(rows: &BinaryDescriptors) -> Vec<u64> {
    let word = |bytes: &[u8]| {
        let mut word = [0; 8];
        word[..bytes.len()].copy_from_slice(bytes);
        u64::from_le_bytes(word)
    };
    (0..rows.len()).flat_map(|index| rows.row(index).chunks(8).map(word)).collect()
}

fn two_nearest(query: &[u64], references: &[u64]) -> Nearest {
    let (mut best, mut index, mut second) = (u32::MAX, 0, None);
    for (at, reference) in references.chunks_exact(query.len()).enumerate() {
        let bits = query.iter().zip(reference).map(|(a, b)| (a ^ b).count_ones()).sum();
        if bits < best {
            second = (best < u32::MAX).then_some(best);
            (best, index) = (bits, at);
        } else if second.is_none_or(|second| bits < second) {
            second = Some(bits);
        }
    }
    #[expect(clippy::cast_precision_loss, reason = "a row has fewer than 2^24 bits")]
    let number = |bits: u32| bits as f32;
    Nearest { index, distance: number(best), second: second.map(number) }
}
