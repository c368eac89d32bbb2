//! Rows in memory that take half, a quarter or a thirty-second of their bytes.

use std::ops::Range;

use half::f16;
use rayon::prelude::*;

use super::{RowSource, decode_f16, decode_int8, encode_f16, encode_int8};
use crate::{Descriptors, Error, Result};

/// Rows as f16: 2 bytes per value.
#[derive(Clone, Debug, PartialEq)]
pub struct F16Rows {
    codes: Vec<f16>,
    len: usize,
    dim: usize,
}

impl F16Rows {
    /// Rounds every value.
    ///
    /// # Errors
    ///
    /// [`Error::NotFinite`] if a magnitude is above 65504, the largest f16.
    pub fn encode(descriptors: &Descriptors) -> Result<Self> {
        let (len, dim) = (descriptors.len(), descriptors.dim());
        let codes = encode_f16(descriptors.as_slice());
        if let Some(at) = codes.iter().position(|code| !code.is_finite()) {
            let value = f64::from(descriptors.as_slice()[at]);
            let (row, column) = (at / dim, at % dim);
            return Err(Error::NotFinite { what: "descriptors as f16", row, column, value });
        }
        Ok(Self { codes, len, dim })
    }
}

impl RowSource for F16Rows {
    fn len(&self) -> usize {
        self.len
    }

    fn dim(&self) -> usize {
        self.dim
    }

    fn block<'a>(&'a self, rows: Range<usize>, scratch: &'a mut Vec<f32>) -> Result<&'a [f32]> {
        decode_f16(&self.codes[rows.start * self.dim..rows.end * self.dim], scratch);
        Ok(scratch)
    }
}

/// Rows as int8 with one scale per row: 1 byte per value and 4 per row.
#[derive(Clone, Debug, PartialEq)]
pub struct Int8Rows {
    codes: Vec<i8>,
    scales: Vec<f32>,
    dim: usize,
}

impl Int8Rows {
    /// Rounds every value to 1/127 of the largest magnitude of its row.
    #[must_use]
    pub fn encode(descriptors: &Descriptors) -> Self {
        let dim = descriptors.dim();
        let (mut codes, mut scales) =
            (Vec::with_capacity(descriptors.as_slice().len()), Vec::new());
        for row in 0..descriptors.len() {
            let encoded = encode_int8(&descriptors.as_slice()[row * dim..(row + 1) * dim]);
            codes.extend(encoded.codes);
            scales.push(encoded.scale);
        }
        Self { codes, scales, dim }
    }
}

impl RowSource for Int8Rows {
    fn len(&self) -> usize {
        self.scales.len()
    }

    fn dim(&self) -> usize {
        self.dim
    }

    fn block<'a>(&'a self, rows: Range<usize>, scratch: &'a mut Vec<f32>) -> Result<&'a [f32]> {
        let codes = &self.codes[rows.start * self.dim..rows.end * self.dim];
        decode_int8(codes, &self.scales[rows], scratch);
        Ok(scratch)
    }
}

/// The signs of rows, 1 bit per value: neighbours share most signs. Center the data first (a
/// [`Pca`](super::Pca) does), or the signs tell little.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SignRows {
    words: Vec<u64>,
    len: usize,
    words_per_row: usize,
}

impl SignRows {
    /// Keeps which values are negative.
    #[must_use]
    pub fn encode(descriptors: &Descriptors) -> Self {
        let words_per_row = descriptors.dim().div_ceil(64);
        let word =
            |values: &[f32]| values.iter().fold(0, |word, &x| word << 1 | u64::from(x < 0.0));
        let words = match descriptors.dim() {
            0 => Vec::new(),
            dim => {
                let rows = descriptors.as_slice().chunks_exact(dim);
                rows.flat_map(|row| row.chunks(64).map(word)).collect()
            }
        };
        Self { words, len: descriptors.len(), words_per_row }
    }

    /// The `count` rows that differ in the fewest signs from each query, ties by lower index; the
    /// candidates for [`rescore`](super::rescore).
    ///
    /// # Panics
    ///
    /// If the queries have another number of values per row.
    #[must_use]
    pub fn nearest(&self, queries: &Self, count: usize) -> Vec<Vec<usize>> {
        assert_eq!(self.words_per_row, queries.words_per_row, "signs of different dimension");
        let width = self.words_per_row.max(1);
        let signs_apart = |query: &[u64], index: usize| -> u32 {
            let row = &self.words[index * self.words_per_row..(index + 1) * self.words_per_row];
            query.iter().zip(row).map(|(a, b)| (a ^ b).count_ones()).sum()
        };
        let nearest = |query: &[u64]| {
            let mut all: Vec<(u32, usize)> =
                (0..self.len).map(|index| (signs_apart(query, index), index)).collect();
            if count < all.len() {
                all.select_nth_unstable(count);
                all.truncate(count);
            }
            all.sort_unstable();
            all.into_iter().map(|(_, index)| index).collect()
        };
        queries.words.par_chunks(width).map(nearest).collect()
    }
}

#[cfg(test)]
mod tests {
    use ndarray::{Array2, array};

    use super::*;
    use crate::knn::{Metric, SearchParams, search};

    #[test]
    fn encoded_rows_are_searched_like_their_decoded_values() {
        let value = |(row, column): (usize, usize)| ((row * 37 + column * 11) % 53) as f32 - 26.0;
        let rows = Descriptors::new(Array2::from_shape_fn((500, 24), value)).unwrap();
        let (int8, half) = (Int8Rows::encode(&rows), F16Rows::encode(&rows).unwrap());
        let params = SearchParams { metric: Metric::Euclidean, k: 7, block_rows: Some(33) };
        let sources: [&dyn RowSource; 2] = [&int8, &half];
        for source in sources {
            let mut decoded = Vec::new();
            source.block(0..500, &mut decoded).unwrap();
            let decoded = Array2::from_shape_vec((500, 24), decoded).unwrap();
            let decoded = Descriptors::new(decoded).unwrap();
            let expected = search(&decoded, &rows, &params).unwrap();
            assert_eq!(search(source, &rows, &params).unwrap(), expected);
        }
    }

    #[test]
    fn what_does_not_fit_f16_is_refused() {
        let rows = Descriptors::new(array![[1.0, 2.0], [3.0, 7e4]]).unwrap();
        let err = F16Rows::encode(&rows).unwrap_err();
        assert!(matches!(err, Error::NotFinite { row: 1, column: 1, .. }), "{err}");
    }

    #[test]
    fn signs_rank_by_how_many_differ() {
        let rows = array![[1.0, 1.0, 1.0], [-1.0, -1.0, 1.0], [-1.0, 1.0, 1.0], [1.0, 1.0, 2.0]];
        let signs = SignRows::encode(&Descriptors::new(rows).unwrap());
        assert_eq!(signs.nearest(&signs, 3)[0], [0, 3, 2]);
    }
}
