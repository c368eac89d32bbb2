//! Many comparisons at once.

use crate::{Error, Result};

/// Holm's step-down correction (Holm 1979) of p-values that are asked together: the adjusted ones, in
/// the order given. Calling different what is at most 0.05 then errs at all in at most 5 % of
/// studies, whatever the p-values have to do with each other.
///
/// The `i`-th smallest of `m`, counted from 0, is multiplied by `m − i`, and is not below the one
/// before; at most 1.
///
/// # Errors
///
/// [`Error::Parameter`] if a p-value is not between 0 and 1.
pub fn holm(p_values: &[f64]) -> Result<Vec<f64>> {
    if let Some(&value) = p_values.iter().find(|it| !(0.0..=1.0).contains(*it)) {
        let reason = "a p-value is between 0 and 1";
        return Err(Error::Parameter { name: "p", value: value.to_string(), reason });
    }
    let mut order: Vec<usize> = (0..p_values.len()).collect();
    order.sort_by(|&a, &b| p_values[a].total_cmp(&p_values[b]).then(a.cmp(&b)));
    let mut adjusted = vec![0.0; p_values.len()];
    let mut before = 0.0_f64;
    for (rank, &index) in order.iter().enumerate() {
        before = before.max((p_values[index] * (order.len() - rank) as f64).min(1.0));
        adjusted[index] = before;
    }
    Ok(adjusted)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smaller_p_values_are_multiplied_by_more() {
        // R: p.adjust(c(0.01, 0.04, 0.03, 0.005), "holm") is 0.03 0.06 0.06 0.02.
        let adjusted = holm(&[0.01, 0.04, 0.03, 0.005]).unwrap();
        for (ours, theirs) in adjusted.into_iter().zip([0.03, 0.06, 0.06, 0.02]) {
            approx::assert_abs_diff_eq!(ours, theirs, epsilon = 1e-12);
        }
        assert_eq!(holm(&[0.9, 0.8]).unwrap(), [1.0, 1.0]);
        assert_eq!(holm(&[]).unwrap(), [0.0; 0]);
        assert!(holm(&[f64::NAN]).is_err());
    }
}
