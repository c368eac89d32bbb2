//! The middle of some values.

use crate::{Error, Result};

/// The median; the mean of the two in the middle of an even number, as NumPy's `median`.
///
/// # Errors
///
/// [`Error::Empty`] without values, [`Error::NotFinite`] if one is NaN or infinite.
pub fn median(values: &[f64]) -> Result<f64> {
    if let Some((row, &value)) = values.iter().enumerate().find(|(_, value)| !value.is_finite()) {
        return Err(Error::NotFinite { what: "values of a median", row, column: 0, value });
    }
    let mut values = values.to_vec();
    let middle = values.len() / 2;
    if values.is_empty() {
        return Err(Error::Empty("values of a median"));
    }
    let is_even = values.len().is_multiple_of(2);
    let (below, &mut upper, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    if !is_even {
        return Ok(upper);
    }
    let lower = below.iter().copied().max_by(f64::total_cmp).unwrap_or(upper);
    Ok(f64::midpoint(lower, upper))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_or_the_mean_of_both_middles() {
        assert_eq!(median(&[3.0, 1.0, 2.0]).unwrap(), 2.0);
        assert_eq!(median(&[4.0, 1.0, 3.0, -7.0]).unwrap(), 2.0);
        assert_eq!(median(&[5.0]).unwrap(), 5.0);
        assert!(matches!(median(&[]), Err(Error::Empty(_))));
        assert!(matches!(median(&[1.0, f64::NAN]), Err(Error::NotFinite { row: 1, .. })));
    }
}
