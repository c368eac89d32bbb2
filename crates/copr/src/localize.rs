//! From retrievals to poses, and how wrong they are; thesis §6.3.1.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use rayon::prelude::*;
use vpr_core::{
    Error as CoreError, Pose, Poses,
    knn::PositionIndex,
    metrics::{
        bootstrap::{
            Interval, Resampling, Z_95, paired_bootstrap, percentile_bootstrap, pick,
            wilson_interval,
        },
        median,
    },
};

use crate::Result;

/// How far and how turned a pose may be to count, metres and degrees.
pub const WITHIN: [(f64, f64); 3] = [(0.25, 2.0), (0.5, 5.0), (5.0, 10.0)];

/// Errors of localization, one per query.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseErrors {
    /// Distances in space, metres.
    pub translation_m: Vec<f64>,
    /// Angles between orientations, 2·acos |q₁·q₂|, degrees.
    pub rotation_deg: Vec<f64>,
}

/// What the errors of all queries amount to, each with a 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accuracy {
    /// Median translation error (MTE), metres; bootstrap over queries.
    pub mte_m: Interval,
    /// Median rotation error (MRE), degrees; bootstrap over queries.
    pub mre_deg: Interval,
    /// Shares of queries within [`WITHIN`]; Wilson.
    pub within: [Interval; 3],
}

impl PoseErrors {
    /// Errors of taking each query to be where its best reference is.
    ///
    /// # Errors
    ///
    /// [`CoreError::Mismatch`] if there is not a reference for every query,
    /// [`CoreError::OutOfRange`] if one does not exist, [`CoreError::PoseKind`] if a side has no
    /// orientations.
    pub fn of_retrieval(best: &[usize], references: &Poses, queries: &Poses) -> Result<Self> {
        let (references, truth) = (references.six_dof()?, queries);
        let queries = queries.six_dof()?;
        if best.len() != queries.len() {
            let what = "best references, one per query";
            let (expected, actual) = (queries.len(), best.len());
            return Err(CoreError::Mismatch { what, expected, actual }.into());
        }
        let len = references.len();
        if let Some(&index) = best.iter().find(|&&index| index >= len) {
            return Err(CoreError::OutOfRange { what: "reference", index, len }.into());
        }
        let found: Vec<Pose> = best.iter().map(|&index| references[index]).collect();
        Self::of_poses(&found, truth)
    }

    /// Errors of taking each query to be at a pose.
    ///
    /// # Errors
    ///
    /// [`CoreError::Mismatch`] if there is not a pose for every query, [`CoreError::PoseKind`] if queries
    /// have no orientations.
    pub fn of_poses(found: &[Pose], queries: &Poses) -> Result<Self> {
        let queries = queries.six_dof()?;
        if found.len() != queries.len() {
            let what = "poses, one per query";
            let (expected, actual) = (queries.len(), found.len());
            return Err(CoreError::Mismatch { what, expected, actual }.into());
        }
        let pairs = || found.iter().zip(queries);
        let translation_m = pairs().map(|(a, b)| translation_error(a, b)).collect();
        let rotation_deg = pairs().map(|(a, b)| rotation_error(a, b)).collect();
        Ok(Self { translation_m, rotation_deg })
    }

    /// Number of queries.
    #[must_use]
    pub fn len(&self) -> usize {
        self.translation_m.len()
    }

    /// Whether there is no query.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.translation_m.is_empty()
    }

    /// Medians and shares with their intervals.
    ///
    /// # Errors
    ///
    /// [`CoreError::Empty`] without queries, those of [`vpr_core::metrics::bootstrap`].
    pub fn accuracy(&self, resampling: &Resampling) -> Result<Accuracy> {
        let of = |values: &[f64]| {
            percentile_bootstrap(self.len(), resampling, |queries| median(&pick(values, queries)))
        };
        let within =
            |(metres, degrees)| wilson_interval(self.hits(metres, degrees), self.len(), Z_95);
        Ok(Accuracy {
            mte_m: of(&self.translation_m)?,
            mre_deg: of(&self.rotation_deg)?,
            within: [within(WITHIN[0])?, within(WITHIN[1])?, within(WITHIN[2])?],
        })
    }

    /// How much lower (negative) or higher the median translation error is than that of `other` on
    /// the same queries, in metres, with a paired bootstrap interval.
    ///
    /// # Errors
    ///
    /// [`CoreError::Mismatch`] if they are not of as many queries; those of [`paired_bootstrap`].
    pub fn mte_against(&self, other: &Self, resampling: &Resampling) -> Result<Interval> {
        difference(&self.translation_m, &other.translation_m, resampling)
    }

    /// The same of the median rotation error, in degrees.
    ///
    /// # Errors
    ///
    /// Those of [`Self::mte_against`].
    pub fn mre_against(&self, other: &Self, resampling: &Resampling) -> Result<Interval> {
        difference(&self.rotation_deg, &other.rotation_deg, resampling)
    }

    /// Queries that are at most this far off and this much turned.
    fn hits(&self, metres: f64, degrees: f64) -> usize {
        let both = self.translation_m.iter().zip(&self.rotation_deg);
        both.filter(|(far, turned)| **far <= metres && **turned <= degrees).count()
    }
}

/// Difference of the medians of two lists over the same queries.
fn difference(ours: &[f64], theirs: &[f64], resampling: &Resampling) -> Result<Interval> {
    if ours.len() != theirs.len() {
        let what = "queries of two localizations";
        let (expected, actual) = (ours.len(), theirs.len());
        return Err(CoreError::Mismatch { what, expected, actual }.into());
    }
    let of = |errors: &[f64], queries: &[usize]| median(&pick(errors, queries));
    Ok(paired_bootstrap(ours.len(), resampling, |it| of(ours, it), |it| of(theirs, it))?)
}

/// Distance between two cameras, metres.
#[must_use]
pub fn translation_error(a: &Pose, b: &Pose) -> f64 {
    (a.translation.vector - b.translation.vector).norm()
}

/// Angle between two orientations, 2·acos |q₁·q₂|, degrees, 0 to 180.
#[must_use]
pub fn rotation_error(a: &Pose, b: &Pose) -> f64 {
    // The arcus cosine of a number near 1 has half the digits: sine and cosine of half the angle
    // both have all.
    let between: UnitQuaternion<f64> = a.rotation.inverse() * b.rotation;
    2.0 * between.imag().norm().atan2(between.w.abs()).to_degrees()
}

/// The reference nearest to every query in space, ties by lower index: what a retrieval could at
/// best give.
///
/// # Errors
///
/// [`CoreError::Empty`] without references, [`CoreError::NotFinite`] if a pose is not finite.
pub fn oracle(queries: &Poses, references: &Poses) -> Result<Vec<usize>> {
    queries.check_finite()?;
    let index = PositionIndex::new(references)?;
    let nearest = |query: usize| {
        let found = index.nearest(queries.position(query), 1)?;
        Ok(*found.first().ok_or(CoreError::Empty("references"))?)
    };
    let found: Vec<Result<usize>> = (0..queries.len()).into_par_iter().map(nearest).collect();
    found.into_iter().collect()
}

/// The pose of `target` as `anchor`'s camera sees it: what a relative pose is.
#[must_use]
pub fn target_from_anchor(anchor: &Pose, target: &Pose) -> Isometry3<f64> {
    anchor.inv_mul(target)
}

/// The offset of `target` from `anchor` in the world's axes, metres.
#[must_use]
pub fn world_offset(anchor: &Pose, target: &Pose) -> Vector3<f64> {
    target.translation.vector - anchor.translation.vector
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    fn turned(x: f64, angle: f64) -> Pose {
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), angle);
        Isometry3::from_parts([x, 0.0, 0.0].into(), rotation)
    }

    #[test]
    fn errors_are_metres_and_degrees_whatever_the_sign_of_a_quaternion() {
        let a = turned(0.0, 0.0);
        let mut b = turned(3.0, FRAC_PI_2);
        b.translation.vector.z = 4.0;
        assert_eq!(translation_error(&a, &b), 5.0);
        approx::assert_abs_diff_eq!(rotation_error(&a, &b), 90.0, epsilon = 1e-12);
        b.rotation = UnitQuaternion::new_unchecked(-b.rotation.into_inner());
        approx::assert_abs_diff_eq!(rotation_error(&a, &b), 90.0, epsilon = 1e-12);
        approx::assert_abs_diff_eq!(
            rotation_error(&a, &turned(0.0, 1e-9)),
            1e-9_f64.to_degrees(),
            epsilon = 1e-14
        );
        let err =
            PoseErrors::of_retrieval(&[2], &Poses::SixDof(vec![a, b]), &Poses::SixDof(vec![a]));
        assert!(err.unwrap_err().to_string().contains("reference 2: only 2 exist"));
    }

    #[test]
    fn medians_and_shares() {
        let references = Poses::SixDof([0.0, 0.1, 0.4, 9.0].map(|x| turned(x, 0.0)).to_vec());
        let queries = Poses::SixDof(vec![turned(0.0, 0.0); 4]);
        let errors = PoseErrors::of_retrieval(&[0, 1, 2, 3], &references, &queries).unwrap();
        let accuracy = errors.accuracy(&Resampling::default()).unwrap();
        assert_eq!(accuracy.mte_m.estimate, 0.25);
        assert_eq!(accuracy.mre_deg.estimate, 0.0);
        assert_eq!(accuracy.within.map(|it| it.estimate), [0.5, 0.75, 0.75]);
        assert!(accuracy.mte_m.low <= 0.05 && accuracy.mte_m.high >= 4.7);
        let same = errors.mte_against(&errors, &Resampling::default()).unwrap();
        assert_eq!((same.low, same.high), (0.0, 0.0));
    }

    #[test]
    fn the_oracle_is_the_nearest_in_space_not_in_the_plane() {
        let mut above = turned(0.0, 0.0);
        above.translation.vector.z = 3.0;
        let references = Poses::SixDof(vec![above, turned(2.0, 1.0), turned(2.0, 0.0)]);
        let queries = Poses::SixDof(vec![turned(0.0, 0.0)]);
        assert_eq!(oracle(&queries, &references).unwrap(), [1], "a tie goes to the lower index");
        assert!(oracle(&queries, &Poses::SixDof(Vec::new())).is_err());
        assert!(oracle(&Poses::SixDof(vec![turned(f64::NAN, 0.0)]), &references).is_err());
    }
}
