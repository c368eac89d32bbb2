//! Descriptors in half or a quarter of the bytes: f16, and int8 with one scale per row.

use half::{f16, slice::HalfFloatSliceExt};

/// A row as int8: value = code × scale, codes in −127..=127.
///
/// The code of a value is off by at most half a step, so every value returns within
/// scale / 2 = max|value| / 254 of what it was.
#[derive(Clone, Debug, PartialEq)]
pub struct Int8Row {
    /// Length of one step: the largest magnitude of the row / 127; zero for a row of zeros.
    pub scale: f32,
    /// One code per value.
    pub codes: Vec<i8>,
}

/// Rounds finite values to f16, nearest even.
///
/// Magnitudes above 65504 become infinite: check with [`f16::is_finite`] where that can happen.
#[must_use]
pub fn encode_f16(values: &[f32]) -> Vec<f16> {
    let mut codes = vec![f16::ZERO; values.len()];
    codes.convert_from_f32_slice(values);
    codes
}

/// The values of f16 codes, exactly, in place of what `values` held.
pub fn decode_f16(codes: &[f16], values: &mut Vec<f32>) {
    values.resize(codes.len(), 0.0);
    codes.convert_to_f32_slice(values);
}

/// Rounds one finite row to int8 with a scale of its own.
#[must_use]
pub fn encode_int8(row: &[f32]) -> Int8Row {
    let largest = row.iter().fold(0.0_f32, |largest, value| largest.max(value.abs()));
    let scale = Some(largest / 127.0).filter(|scale| (scale * 127.0).is_finite());
    let scale = scale.unwrap_or((largest / 127.0).next_down());
    if scale == 0.0 {
        return Int8Row { scale, codes: vec![0; row.len()] };
    }
    let codes = row.iter().map(|&value| code(f64::from(value) / f64::from(scale))).collect();
    Int8Row { scale, codes }
}

/// The values of int8 rows, `scales.len() × dim` codes, in place of what `values` held.
///
/// # Panics
///
/// If there are not equally many codes for every scale.
pub fn decode_int8(codes: &[i8], scales: &[f32], values: &mut Vec<f32>) {
    if scales.is_empty() {
        assert!(codes.is_empty(), "codes without a scale");
        values.clear();
        return;
    }
    let dim = codes.len() / scales.len();
    assert_eq!(dim * scales.len(), codes.len(), "every int8 row has the same length");
    values.resize(codes.len(), 0.0);
    if dim == 0 {
        return;
    }
    for ((codes, &scale), values) in
        codes.chunks_exact(dim).zip(scales).zip(values.chunks_exact_mut(dim))
    {
        for (value, &code) in values.iter_mut().zip(codes) {
            *value = f32::from(code) * scale;
        }
    }
}

/// The one place where a scaled value becomes a code.
#[expect(clippy::cast_possible_truncation, reason = "clamped to the range of the codes")]
fn code(steps: f64) -> i8 {
    steps.round_ties_even().clamp(-127.0, 127.0) as i8
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_row_of_zeros_has_scale_zero_and_comes_back() {
        let encoded = encode_int8(&[0.0, -0.0, 0.0]);
        let mut decoded = vec![9.0];
        decode_int8(&encoded.codes, &[encoded.scale], &mut decoded);
        assert_eq!(decoded, [0.0; 3]);
    }

    #[test]
    fn smallest_subnormals_do_not_divide_by_zero() {
        let tiny = f32::from_bits(1);
        let encoded = encode_int8(&[tiny, 0.0]);
        assert_eq!((encoded.scale, encoded.codes), (0.0, vec![0, 0]));
    }

    #[test]
    fn the_largest_f32_stays_finite() {
        let encoded = encode_int8(&[f32::MAX, f32::MIN]);
        let mut decoded = Vec::new();
        decode_int8(&encoded.codes, &[encoded.scale], &mut decoded);
        assert!(decoded.iter().all(|value| value.is_finite()), "{decoded:?}");
    }

    proptest! {
        #[test]
        fn int8_is_off_by_at_most_half_a_step(row in prop::collection::vec(-1e3_f32..1e3, 1..50)) {
            let encoded = encode_int8(&row);
            let mut decoded = Vec::new();
            decode_int8(&encoded.codes, &[encoded.scale], &mut decoded);
            for (value, decoded) in row.iter().zip(decoded) {
                prop_assert!((value - decoded).abs() <= encoded.scale * 0.500_1, "{value} {decoded}");
            }
        }

        #[test]
        fn f16_is_off_by_at_most_one_part_in_2048(row in prop::collection::vec(-6e4_f32..6e4, 1..50)) {
            let mut decoded = Vec::new();
            decode_f16(&encode_f16(&row), &mut decoded);
            for (value, decoded) in row.iter().zip(decoded) {
                prop_assert!((value - decoded).abs() <= value.abs() / 2048.0 + 6e-8, "{value} {decoded}");
            }
        }
    }
}
