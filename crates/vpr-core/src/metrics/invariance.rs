//! How well the scores of a varied place stay above those of another place.

use super::area::{auc, check_finite};
use crate::{Definition, Error, Result};

/// Area between the curves, ABC of thesis §3.3.8: `matched` are the scores of one place under growing
/// variation, `mismatched` those of another place at the same positions `0, 1, …, n − 1`.
///
/// - [`Definition::Corrected`]: the integral of `matched − mismatched` over the positions, by
///   trapezoids; negative where the wrong place scores higher. At most `n − 1`.
/// - [`Definition::Published`] (`compute_area_between_the_curves`): the area shapely gives for the
///   polygon through the first curve and then through the second *forward* as well, although the
///   comment there says reversed. The outline crosses itself, so this is the absolute value of a
///   signed shoelace sum in which parts cancel. With `S` the trapezoidal integral, `m` and `w` the two
///   curves and `Δ = n − 1`, it is `|S(m) + S(w) − Δ·(m[n−1] + w[0]) / 2 − Δ·(w[n−1] + m[0]) / 2|`.
///
/// # Errors
///
/// [`Error::Mismatch`] if the lengths differ, [`Error::NotFinite`] if a score is not finite,
/// [`Error::Undefined`] with fewer than two positions.
pub fn area_between_curves(
    definition: Definition,
    matched: &[f64],
    mismatched: &[f64],
) -> Result<f64> {
    if matched.len() != mismatched.len() {
        let what = "scores of the other place, one per position";
        return Err(Error::Mismatch { what, expected: matched.len(), actual: mismatched.len() });
    }
    if matched.len() < 2 {
        let reason = "needs at least two positions";
        return Err(Error::Undefined { metric: "the area between the curves", reason });
    }
    check_finite("scores of the same place", matched)?;
    check_finite("scores of the other place", mismatched)?;
    let positions: Vec<f64> = (0..matched.len()).map(|position| position as f64).collect();
    match definition {
        Definition::Published => {
            let outline: Vec<(f64, f64)> = [matched, mismatched]
                .iter()
                .flat_map(|curve| positions.iter().copied().zip(curve.iter().copied()))
                .collect();
            Ok(signed_area(&outline).abs())
        }
        Definition::Corrected => {
            let gap: Vec<f64> = matched.iter().zip(mismatched).map(|(m, w)| m - w).collect();
            auc(&positions, &gap)
        }
    }
}

/// Area of the closed polygon through these points, positive if they run anticlockwise (shoelace).
fn signed_area(outline: &[(f64, f64)]) -> f64 {
    let next = outline.iter().cycle().skip(1);
    let twice: f64 = outline.iter().zip(next).map(|(a, b)| a.0 * b.1 - b.0 * a.1).sum();
    twice / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corrected_is_the_integral_of_the_difference() {
        let area = |m: &[f64], w: &[f64]| area_between_curves(Definition::Corrected, m, w).unwrap();
        assert_eq!(area(&[1.0; 5], &[0.0; 5]), 4.0);
        assert_eq!(area(&[0.0; 5], &[1.0; 5]), -4.0);
        assert_eq!(area(&[1.0, 0.5, 0.0], &[0.0, 0.5, 0.5]), 0.25);
    }

    #[test]
    fn published_follows_the_crossing_outline() {
        let published =
            |m: &[f64], w: &[f64]| area_between_curves(Definition::Published, m, w).unwrap();
        // A perfect technique: the two halves of the bow tie cancel.
        assert_eq!(published(&[1.0; 5], &[0.0; 5]), 0.0);
        let (m, w) = ([1.0, 0.2, 0.7, 0.1], [0.3, 0.4, 0.0, 0.2]);
        let integral = |y: &[f64]| auc(&[0.0, 1.0, 2.0, 3.0], y).unwrap();
        let chords = 1.5 * (m[3] + w[0]) + 1.5 * (w[3] + m[0]);
        let expected = (integral(&m) + integral(&w) - chords).abs();
        approx::assert_abs_diff_eq!(published(&m, &w), expected, epsilon = 1e-14);
    }

    #[test]
    fn curves_must_be_comparable() {
        for definition in [Definition::Published, Definition::Corrected] {
            let short = area_between_curves(definition, &[1.0, 0.5], &[0.0]);
            assert!(matches!(short, Err(Error::Mismatch { expected: 2, actual: 1, .. })));
            let point = area_between_curves(definition, &[1.0], &[0.0]);
            assert!(matches!(point, Err(Error::Undefined { .. })));
            let nan = area_between_curves(definition, &[1.0, f64::NAN], &[0.0; 2]);
            assert!(matches!(nan, Err(Error::NotFinite { row: 1, .. })));
        }
    }
}
