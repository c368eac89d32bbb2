//! Area under a curve by trapezoids.

use crate::{Error, Result};

/// Area under the curve through the points `(x[i], y[i])`: `Σ (x[i+1] − x[i])·(y[i] + y[i+1]) / 2`.
///
/// Agrees with scikit-learn's `auc`: `x` may ascend or descend, the area of a positive `y` is
/// positive either way.
///
/// # Errors
///
/// [`Error::Mismatch`] if the lengths differ, [`Error::Undefined`] with fewer than two points,
/// [`Error::NotFinite`] if a coordinate is not finite, [`Error::Parameter`] if `x` is not monotonic.
pub fn auc(x: &[f64], y: &[f64]) -> Result<f64> {
    if x.len() != y.len() {
        let what = "y coordinates, one per x";
        return Err(Error::Mismatch { what, expected: x.len(), actual: y.len() });
    }
    if x.len() < 2 {
        let reason = "needs at least two points";
        return Err(Error::Undefined { metric: "area under a curve", reason });
    }
    check_finite("x coordinates", x)?;
    check_finite("y coordinates", y)?;
    let ascending = x.windows(2).all(|pair| pair[0] <= pair[1]);
    if !ascending && let Some(at) = x.windows(2).position(|pair| pair[0] < pair[1]) {
        let reason = "must only ascend or only descend";
        return Err(Error::Parameter {
            name: "x",
            value: format!("{} at {}", x[at + 1], at + 1),
            reason,
        });
    }
    let area = trapezoids(x, y);
    Ok(if ascending { area } else { -area })
}

/// The signed trapezoidal integral of `y` over `x`.
fn trapezoids(x: &[f64], y: &[f64]) -> f64 {
    x.windows(2).zip(y.windows(2)).map(|(x, y)| (x[1] - x[0]) * (y[0] + y[1]) / 2.0).sum()
}

/// Refuses the first value that is NaN or infinite.
pub(super) fn check_finite(what: &'static str, values: &[f64]) -> Result<()> {
    match values.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(row) => Err(Error::NotFinite { what, row, column: 0, value: values[row] }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn direction_does_not_change_the_sign() {
        assert_eq!(auc(&[0.0, 1.0, 3.0], &[1.0, 1.0, 3.0]).unwrap(), 5.0);
        assert_eq!(auc(&[3.0, 1.0, 0.0], &[3.0, 1.0, 1.0]).unwrap(), 5.0);
        assert_eq!(auc(&[1.0, 1.0], &[0.0, 5.0]).unwrap(), 0.0);
    }

    #[test]
    fn wrong_curves_are_refused() {
        assert!(matches!(auc(&[0.0], &[1.0]), Err(Error::Undefined { .. })));
        assert!(matches!(auc(&[], &[]), Err(Error::Undefined { .. })));
        assert!(matches!(auc(&[0.0, 1.0], &[1.0]), Err(Error::Mismatch { .. })));
        assert!(matches!(auc(&[0.0, 2.0, 1.0], &[1.0; 3]), Err(Error::Parameter { .. })));
        assert!(matches!(auc(&[0.0, f64::NAN], &[1.0; 2]), Err(Error::NotFinite { row: 1, .. })));
    }
}
