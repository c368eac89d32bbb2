//! How descriptors are stored: single, half or byte precision.

use std::{fmt, str::FromStr};

use half::f16;

use super::header::ElementType;
use crate::knn::{Int8Row, encode_f16, encode_int8};

/// How one descriptor is stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RowType {
    /// Single precision: what encoders give, kept bit by bit.
    #[default]
    F32,
    /// Half precision, rounded to nearest even; values beyond ±65 504 are refused.
    F16,
    /// Signed bytes −127..=127 with one scale per row: its largest magnitude ÷ 127.
    I8,
}

impl RowType {
    /// Bytes of one value.
    #[must_use]
    pub fn size(self) -> usize {
        match self {
            Self::F32 => 4,
            Self::F16 => 2,
            Self::I8 => 1,
        }
    }

    /// The tensor's element type.
    #[must_use]
    pub fn element(self) -> ElementType {
        match self {
            Self::F32 => ElementType::F32,
            Self::F16 => ElementType::F16,
            Self::I8 => ElementType::I8,
        }
    }

    /// The row type of a tensor's element type, if descriptors can be stored that way.
    #[must_use]
    pub fn of_element(element: ElementType) -> Option<Self> {
        match element {
            ElementType::F32 => Some(Self::F32),
            ElementType::F16 => Some(Self::F16),
            ElementType::I8 => Some(Self::I8),
            _ => None,
        }
    }

    /// Appends the bytes of one row to `bytes` and returns its scale (1 but for bytes).
    ///
    /// # Errors
    ///
    /// The column of the first value that is not finite once stored.
    pub fn encode(self, row: &[f32], bytes: &mut Vec<u8>) -> Result<f32, usize> {
        if let Some(column) = row.iter().position(|value| !value.is_finite()) {
            return Err(column);
        }
        match self {
            Self::F32 => bytes.extend(row.iter().flat_map(|value| value.to_le_bytes())),
            Self::F16 => {
                let codes = encode_f16(row);
                if let Some(column) = codes.iter().position(|code| !code.is_finite()) {
                    return Err(column);
                }
                bytes.extend(codes.iter().flat_map(|code| code.to_le_bytes()));
            }
            Self::I8 => {
                let Int8Row { scale, codes } = encode_int8(row);
                bytes.extend(codes.iter().flat_map(|code| code.to_le_bytes()));
                return Ok(scale);
            }
        }
        Ok(1.0)
    }

    /// Writes the values of one stored row into `row`; `bytes` has `row.len() ×` [`Self::size`].
    ///
    /// Gives the bits of [`crate::knn::decode_f16`] and [`crate::knn::decode_int8`].
    pub fn decode(self, bytes: &[u8], scale: f32, row: &mut [f32]) {
        match self {
            Self::F32 => {
                for (value, chunk) in row.iter_mut().zip(bytes.as_chunks().0) {
                    *value = f32::from_le_bytes(*chunk);
                }
            }
            Self::F16 => {
                for (value, chunk) in row.iter_mut().zip(bytes.as_chunks().0) {
                    *value = f16::from_le_bytes(*chunk).to_f32();
                }
            }
            Self::I8 => {
                for (value, &byte) in row.iter_mut().zip(bytes) {
                    *value = f32::from(i8::from_le_bytes([byte])) * scale;
                }
            }
        }
    }

    /// The index of the first stored value that is NaN or infinite.
    #[must_use]
    pub fn first_not_finite(self, bytes: &[u8]) -> Option<usize> {
        const F32_EXPONENT: u32 = 0x7f80_0000;
        const F16_EXPONENT: u16 = 0x7c00;
        let f32_bad = |chunk: &[u8; 4]| u32::from_le_bytes(*chunk) & F32_EXPONENT == F32_EXPONENT;
        let f16_bad = |chunk: &[u8; 2]| u16::from_le_bytes(*chunk) & F16_EXPONENT == F16_EXPONENT;
        match self {
            Self::F32 => first(bytes.as_chunks().0, f32_bad),
            Self::F16 => first(bytes.as_chunks().0, f16_bad),
            Self::I8 => None,
        }
    }
}

impl fmt::Display for RowType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::F32 => "f32",
            Self::F16 => "f16",
            Self::I8 => "int8",
        })
    }
}

impl FromStr for RowType {
    type Err = String;

    /// Reads `f32`, `f16` or `int8`.
    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "f32" => Ok(Self::F32),
            "f16" => Ok(Self::F16),
            "int8" => Ok(Self::I8),
            _ => Err(format!("`{text}` is none of f32, f16, int8")),
        }
    }
}

/// The first element that is `bad`; whole groups are tested at once, so that good data are fast.
fn first<const N: usize>(chunks: &[[u8; N]], bad: impl Fn(&[u8; N]) -> bool) -> Option<usize> {
    const GROUP: usize = 256;
    for (group, chunks) in chunks.chunks(GROUP).enumerate() {
        if chunks.iter().fold(false, |any, chunk| any | bad(chunk)) {
            return chunks.iter().position(bad).map(|index| group * GROUP + index);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn round_trip(row_type: RowType, row: &[f32]) -> Vec<f32> {
        let mut bytes = Vec::new();
        let scale = row_type.encode(row, &mut bytes).unwrap();
        assert_eq!(bytes.len(), row.len() * row_type.size());
        let mut decoded = vec![0.0; row.len()];
        row_type.decode(&bytes, scale, &mut decoded);
        decoded
    }

    #[test]
    fn single_precision_is_kept_bit_by_bit() {
        let row = [0.1, -0.0, f32::MIN_POSITIVE, 1e30];
        let bits = |row: &[f32]| row.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&round_trip(RowType::F32, &row)), bits(&row));
    }

    #[test]
    fn bytes_err_by_half_a_step() {
        let row = [0.3, -1.0, 0.004, 0.0];
        for (value, stored) in row.iter().zip(round_trip(RowType::I8, &row)) {
            assert!((value - stored).abs() <= 0.5 / 127.0 * 1.0001, "{value} became {stored}");
        }
    }

    #[test]
    fn half_precision_refuses_what_it_cannot_hold() {
        assert_eq!(RowType::F16.encode(&[1.0, 1e6], &mut Vec::new()), Err(1));
        assert_eq!(RowType::F32.encode(&[f32::NAN], &mut Vec::new()), Err(0));
    }

    #[test]
    fn a_nan_is_found_in_any_group() {
        let mut row = vec![1.0_f32; 1000];
        row[777] = f32::NAN;
        let bytes: Vec<u8> = row.iter().flat_map(|value| value.to_le_bytes()).collect();
        assert_eq!(RowType::F32.first_not_finite(&bytes), Some(777));
        assert_eq!(RowType::F32.first_not_finite(&bytes[..4 * 777]), None);
    }
}
