//! Grids of targets.

use vpr_core::{Definition, Error as CoreError, Poses, knn::PositionIndex};

use super::{MOST_TARGETS, Target, check_count};
use crate::{Anchors, Result};

/// A rectangle of offsets around an anchor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    span_m: [f64; 2],
    step_m: f64,
    definition: Definition,
}

impl Grid {
    /// A grid that spans `span_m` metres in world x and y, `step_m` metres apart.
    ///
    /// [`Definition::Published`] is `numpy.arange(-span / 2, span / 2, step)` rounded to five
    /// decimals: it begins at the lower end and leaves the upper one out, so it lies askew and may
    /// miss the anchor (C-7). [`Definition::Corrected`] goes from the anchor both ways as far as the
    /// span allows.
    ///
    /// # Errors
    ///
    /// [`CoreError::Parameter`] for a span that is negative or a step that is not positive.
    pub fn new(span_m: [f64; 2], step_m: f64, definition: Definition) -> Result<Self> {
        let refuse = |name, value: f64, reason| {
            Err(CoreError::Parameter { name, value: value.to_string(), reason }.into())
        };
        if let Some(&span) = span_m.iter().find(|span| !(span.is_finite() && **span >= 0.0)) {
            return refuse("span", span, "must be finite and not negative");
        }
        if !(step_m.is_finite() && step_m > 0.0) {
            return refuse("grid", step_m, "the distance between targets must be positive");
        }
        Ok(Self { span_m, step_m, definition })
    }

    /// Offsets in x and in y, metres.
    pub(super) fn offsets(&self) -> Result<[Vec<f64>; 2]> {
        let n = self.span_m.map(|span| count(span / self.step_m));
        check_count(u128::from(n[0]).max(u128::from(n[1])))?;
        let axis = |span: f64| match self.definition {
            Definition::Published => arange(-span / 2.0, span / 2.0, self.step_m),
            Definition::Corrected => symmetric(span, self.step_m),
        };
        Ok(self.span_m.map(axis))
    }
}

/// As `numpy.arange` computes it, then rounded to five decimals.
fn arange(start: f64, end: f64, step: f64) -> Vec<f64> {
    // NumPy takes the step from its first two values.
    let delta = (start + step) - start;
    (0..count((end - start) / step))
        .map(|at| ((start + at as f64 * delta) * 1e5).round_ties_even() / 1e5)
        .collect()
}

fn symmetric(span: f64, step: f64) -> Vec<f64> {
    // A span of 1 m is twenty steps of 5 cm, whatever binary fractions make of it.
    let n = count((span / 2.0 / step + 1e-9).floor());
    let side = |at: u64| at as f64 * step;
    (1..=n).rev().map(|at| -side(at)).chain((0..=n).map(side)).collect()
}

/// A number of steps, rounded up; beyond any use where it would not be one.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bounded")]
fn count(steps: f64) -> u64 {
    steps.ceil().clamp(0.0, 1e15) as u64
}

/// The points of one grid over all anchors, see [`super::Targets::global`].
pub(super) fn global(anchors: &Anchors, step: f64, reach: f64) -> Result<Vec<Target>> {
    for (name, value) in [("grid", step), ("reach", reach)] {
        if !(value.is_finite() && value > 0.0) {
            let (value, reason) = (value.to_string(), "must be positive");
            return Err(CoreError::Parameter { name, value, reason }.into());
        }
    }
    let planar = |axis: usize| anchors.poses().iter().map(move |it| it.translation.vector[axis]);
    let range = |axis: usize| {
        let low = planar(axis).fold(f64::INFINITY, f64::min) - reach;
        let high = planar(axis).fold(f64::NEG_INFINITY, f64::max) + reach;
        ((low / step - 1e-9).ceil(), (high / step + 1e-9).floor())
    };
    let (x, y) = (range(0), range(1));
    let n = |(low, high): (f64, f64)| u128::from(count(high - low + 1.0));
    check_count(n(x) * n(y))?;
    let flat: Vec<_> = planar(0).zip(planar(1)).map(|(x, y)| [x, y].into()).collect();
    let index = PositionIndex::new(&Poses::Planar(flat))?;
    let mut targets = Vec::new();
    for column in 0..n(x) {
        for row in 0..n(y) {
            let at = [(x.0 + column as f64) * step, (y.0 + row as f64) * step];
            let home = index.nearest([at[0], at[1], 0.0].into(), 1)?[0];
            let mut pose = anchors.poses()[home];
            let away = (pose.translation.x - at[0]).hypot(pose.translation.y - at[1]);
            if away <= reach * (1.0 + 1e-9) {
                (pose.translation.x, pose.translation.y) = (at[0], at[1]);
                targets.push(Target { pose, home });
            }
        }
    }
    debug_assert!(targets.len() <= MOST_TARGETS);
    Ok(targets)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arange_is_numpys() {
        // numpy.round(numpy.arange(-0.5, 0.5, 0.05), 5)
        let offsets = arange(-0.5, 0.5, 0.05);
        assert_eq!(offsets.len(), 20);
        assert_eq!((offsets[0], offsets[10], offsets[19]), (-0.5, 0.0, 0.45));
        // arange gives as many values as ceil says, also where a float is a hair too large:
        // 0.15 - -0.15 = 0.3 and 0.3 / 0.05 = 5.999…
        assert_eq!(arange(-0.15, 0.15, 0.05), [-0.15, -0.1, -0.05, 0.0, 0.05, 0.1]);
        assert_eq!(arange(-1.15, 1.15, 0.05).len(), 46);
        assert!(arange(-0.0, 0.0, 0.05).is_empty());
    }

    #[test]
    fn the_corrected_grid_has_both_ends_and_the_anchor() {
        let offsets = symmetric(1.0, 0.05);
        assert_eq!(offsets.len(), 21);
        assert_eq!(offsets[10], 0.0);
        approx::assert_abs_diff_eq!(offsets[20], 0.5, epsilon = 1e-12);
        assert_eq!(offsets[0], -offsets[20]);
        assert_eq!(symmetric(0.3, 0.1).len(), 3);
        assert_eq!(symmetric(0.0, 0.1), [0.0]);
    }

    #[test]
    fn impossible_grids_are_refused_by_name() {
        let wrong =
            |span, step| Grid::new(span, step, Definition::Corrected).unwrap_err().to_string();
        assert!(wrong([-1.0, 1.0], 0.1).contains("`span` = -1"));
        assert!(wrong([1.0, f64::INFINITY], 0.1).contains("`span` = inf"));
        assert!(wrong([1.0, 1.0], 0.0).contains("`grid` = 0"));
        assert!(wrong([1.0, 1.0], f64::NAN).contains("`grid` = NaN"));
        let long = Grid::new([1e300, 1.0], 1e-3, Definition::Published).unwrap();
        assert!(long.offsets().is_err());
    }
}
