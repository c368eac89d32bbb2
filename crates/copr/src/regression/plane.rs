//! A plane through anchors, one per dimension of the descriptor; thesis §6.2.2.

use nalgebra::{DMatrix, Matrix4, RowVector4, Vector3};
use serde::{Deserialize, Serialize};
use vpr_core::{Definition, Error as CoreError};

use super::{Regressor, Request, Told, combine};
use crate::{Error, Result, Selection};

/// What becomes of a target that its anchors say nothing about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Outside {
    /// An error that names it
    #[default]
    Refuse,
    /// It is regressed as the nearest point that the anchors span, and counted
    Flat,
}

/// How a plane is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PlaneParams {
    /// [`Definition::Published`] inverts `XᵀX` over `[x y z 1]` of the anchors before, at and after
    /// its own along the sequence (C-5); [`Definition::Corrected`] takes the nearest in space and a
    /// singular value decomposition around their mean.
    pub definition: Definition,
    /// Number of anchors, 4 in the thesis: the fewest that determine a plane over space.
    pub n_anchors: usize,
    /// A direction in which the anchors extend less than this share of their greatest extent counts
    /// as none; only [`Definition::Corrected`] looks at it.
    pub tolerance: f64,
    /// What becomes of targets outside of what the anchors span.
    pub outside: Outside,
}

impl Default for PlaneParams {
    fn default() -> Self {
        Self {
            definition: Definition::Corrected,
            n_anchors: 4,
            tolerance: 1e-6,
            outside: Outside::Refuse,
        }
    }
}

/// Least squares of every value of a descriptor as a linear function of position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneFit(PlaneParams);

const NAME: &str = "plane fit";

impl PlaneFit {
    /// A plane fit with these parameters.
    ///
    /// # Errors
    ///
    /// [`CoreError::Parameter`] for fewer than one anchor (four if published) or a tolerance that is
    /// not between 0 and 1.
    pub fn new(params: PlaneParams) -> Result<Self> {
        let refuse =
            |name, value: String, reason| Err(CoreError::Parameter { name, value, reason }.into());
        let fewest = if params.definition == Definition::Published { 4 } else { 1 };
        if params.n_anchors < fewest {
            let reason = "a plane over space needs four anchors as published, else at least one";
            return refuse("n_anchors", params.n_anchors.to_string(), reason);
        }
        if !(params.tolerance > 0.0 && params.tolerance < 1.0) {
            let reason = "must be between 0 and 1";
            return refuse("tolerance", params.tolerance.to_string(), reason);
        }
        Ok(Self(params))
    }

    /// As released: C-5 and all.
    #[must_use]
    pub fn published() -> Self {
        Self(PlaneParams { definition: Definition::Published, ..PlaneParams::default() })
    }

    /// As the thesis says.
    #[must_use]
    pub fn corrected() -> Self {
        Self(PlaneParams::default())
    }

    /// The weight of every anchor; they sum to 1.
    fn weights(&self, request: &Request<'_>) -> Result<(Vec<f64>, Told)> {
        let (target, found) = (request.target, request.anchors.len());
        if found < self.0.n_anchors {
            let needed = self.0.n_anchors;
            return Err(Error::TooFewAnchors { target, method: NAME, needed, found });
        }
        match self.0.definition {
            Definition::Published => Ok((released(request)?, Told::default())),
            Definition::Corrected => self.by_decomposition(request),
        }
    }

    fn by_decomposition(&self, request: &Request<'_>) -> Result<(Vec<f64>, Told)> {
        let (target, n) = (request.target, request.anchors.len());
        let positions: Vec<Vector3<f64>> =
            request.anchors.iter().map(|it| it.pose.translation.vector).collect();
        let at = request.pose.translation.vector;
        let mean = positions.iter().sum::<Vector3<f64>>() / n as f64;
        // As many rows as columns at least, so that there are three directions; those of zeros
        // have no extent.
        let centred = DMatrix::from_fn(n.max(3), 3, |row, column| {
            positions.get(row).map_or(0.0, |it| it[column] - mean[column])
        });
        let svd = centred.svd(true, true);
        let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
            // Both were asked for.
            return Err(Error::Singular { target });
        };
        let greatest = svd.singular_values.max();
        let size = positions.iter().map(Vector3::norm).fold(at.norm(), f64::max);
        // What rounding of coordinates leaves of anchors at one place.
        let nothing = 1e-12 * size.max(1.0);
        let offset = at - mean;
        let (mut inside, mut weights, mut rank) = (Vector3::zeros(), vec![1.0 / n as f64; n], 0);
        for (axis, &value) in svd.singular_values.iter().enumerate() {
            if value <= nothing || value <= self.0.tolerance * greatest {
                continue;
            }
            rank += 1;
            let direction = Vector3::from_fn(|column, _| v_t[(axis, column)]);
            let along = offset.dot(&direction);
            inside += along * direction;
            for (row, weight) in weights.iter_mut().enumerate() {
                *weight += along / value * u[(row, axis)];
            }
        }
        let outside_m = (offset - inside).norm();
        let is_inside = outside_m <= 1e-9 * size.max(1.0) + self.0.tolerance * greatest;
        match self.0.outside {
            _ if is_inside => Ok((weights, Told::default())),
            Outside::Flat => Ok((weights, Told::flat(target))),
            Outside::Refuse => Err(Error::Undetermined { target, rank, outside_m }),
        }
    }
}

/// `[x y z 1]·(XᵀX)⁻¹·Xᵀ`.
fn released(request: &Request<'_>) -> Result<Vec<f64>> {
    let row = |position: Vector3<f64>| RowVector4::new(position.x, position.y, position.z, 1.0);
    let rows: Vec<RowVector4<f64>> =
        request.anchors.iter().map(|it| row(it.pose.translation.vector)).collect();
    let gram: Matrix4<f64> = rows.iter().map(|it| it.transpose() * it).sum();
    let target = request.target;
    // The released code asks for a determinant that is not exactly 0.
    if gram.determinant() == 0.0 {
        return Err(Error::Singular { target });
    }
    let inverse = gram.try_inverse().ok_or(Error::Singular { target })?;
    let at = row(request.pose.translation.vector) * inverse;
    Ok(rows.iter().map(|it| (at * it.transpose())[0]).collect())
}

impl Regressor for PlaneFit {
    fn name(&self) -> &'static str {
        NAME
    }

    fn selection(&self) -> Selection {
        match self.0.definition {
            Definition::Published => Selection::AlongSequence(self.0.n_anchors),
            Definition::Corrected => Selection::Nearest(self.0.n_anchors),
        }
    }

    fn regress(&self, requests: &[Request<'_>], out: &mut [f32]) -> Result<Told> {
        combine(requests, out, |request| self.weights(request))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Translation3};
    use proptest::prelude::*;
    use vpr_core::Pose;

    use super::*;
    use crate::regression::tests::{at, one};

    /// A descriptor that is a linear function of position.
    fn linear(pose: &Pose) -> Vec<f32> {
        let p = pose.translation.vector;
        [1.0 + 2.0 * p.x - p.y + 0.5 * p.z, -3.0 + p.y, 4.0 * p.z]
            .map(super::super::narrow)
            .to_vec()
    }

    fn described(poses: &[Pose]) -> Vec<(Pose, Vec<f32>)> {
        poses.iter().map(|pose| (*pose, linear(pose))).collect()
    }

    fn corner() -> Vec<Pose> {
        vec![at(0.0, 0.0, 0.0), at(1.0, 0.0, 0.0), at(0.0, 1.0, 0.0), at(0.0, 0.0, 1.0)]
    }

    fn flat() -> PlaneFit {
        PlaneFit::new(PlaneParams { outside: Outside::Flat, ..PlaneParams::default() }).unwrap()
    }

    #[test]
    fn both_definitions_extrapolate_a_linear_field() {
        let target = at(2.0, -1.0, 3.0);
        for plane in [PlaneFit::published(), PlaneFit::corrected()] {
            let (found, told) = one(&plane, target, &described(&corner())).unwrap();
            for (found, expected) in found.iter().zip(linear(&target)) {
                approx::assert_abs_diff_eq!(*found, expected, epsilon = 1e-5);
            }
            assert_eq!(told, Told::default());
        }
    }

    #[test]
    fn on_an_anchor_four_anchors_give_its_own_descriptor() {
        let anchors = described(&corner());
        let (found, _) = one(&PlaneFit::corrected(), at(0.0, 1.0, 0.0), &anchors).unwrap();
        for (found, expected) in found.iter().zip(&anchors[2].1) {
            approx::assert_abs_diff_eq!(found, expected, epsilon = 1e-6);
        }
    }

    #[test]
    fn collinear_anchors_determine_their_line_and_nothing_beside_it() {
        let line: Vec<Pose> = (0..4).map(|x| at(f64::from(x), 1.0, 0.0)).collect();
        let anchors = described(&line);
        let (found, told) = one(&PlaneFit::corrected(), at(1.5, 1.0, 0.0), &anchors).unwrap();
        approx::assert_abs_diff_eq!(found[0], 3.0, epsilon = 1e-6);
        assert_eq!(told.n_flat, 0);
        let beside = at(1.5, 3.0, 0.0);
        let err = one(&PlaneFit::corrected(), beside, &anchors).unwrap_err().to_string();
        assert!(err.contains("target 7") && err.contains("span 1 of 3"), "{err}");
        assert!(err.contains("2 m outside"), "{err}");
        let (found, told) = one(&flat(), beside, &anchors).unwrap();
        approx::assert_abs_diff_eq!(found[0], 3.0, epsilon = 1e-6);
        assert_eq!(told, Told { n_flat: 1, first_flat: Some(7) });
        let err = one(&PlaneFit::published(), beside, &anchors).unwrap_err();
        assert!(matches!(err, Error::Singular { target: 7 }), "{err}");
    }

    #[test]
    fn coincident_anchors_determine_one_point() {
        let here = at(0.1, 0.2, 0.3);
        let mut anchors = described(&[here; 4]);
        anchors[0].1[0] += 4.0;
        let (found, _) = one(&PlaneFit::corrected(), here, &anchors).unwrap();
        approx::assert_abs_diff_eq!(found[0], linear(&here)[0] + 1.0, epsilon = 1e-6);
        let err = one(&PlaneFit::corrected(), at(0.1, 0.2, 1.3), &anchors).unwrap_err();
        assert!(matches!(err, Error::Undetermined { rank: 0, .. }), "{err}");
        assert!(one(&PlaneFit::published(), here, &anchors).is_err());
    }

    #[test]
    fn too_few_anchors_and_impossible_parameters_are_named() {
        let err = one(&PlaneFit::corrected(), at(0.0, 0.0, 0.0), &described(&corner()[..3]));
        assert!(matches!(err, Err(Error::TooFewAnchors { needed: 4, found: 3, .. })));
        let published = PlaneParams { n_anchors: 3, ..PlaneFit::published().0 };
        assert!(PlaneFit::new(published).is_err());
        assert!(PlaneFit::new(PlaneParams { n_anchors: 0, ..PlaneParams::default() }).is_err());
        assert!(PlaneFit::new(PlaneParams { tolerance: 0.0, ..PlaneParams::default() }).is_err());
    }

    proptest! {
        /// A world that is turned, shifted and mirrored gives the same descriptors.
        #[test]
        fn the_world_may_be_moved(
            points in prop::collection::vec((-5.0_f64..5.0, -5.0_f64..5.0, -5.0_f64..5.0), 5),
            turn in (-3.0_f64..3.0, -3.0_f64..3.0, -3.0_f64..3.0),
            shift in (-50.0_f64..50.0, -50.0_f64..50.0), mirror in any::<bool>(),
        ) {
            let pose = |&(x, y, z): &(f64, f64, f64)| at(x, y, z);
            let poses: Vec<Pose> = points.iter().map(pose).collect();
            let values: Vec<Vec<f32>> =
                (0_u8..4).map(|row| vec![f32::from(row).sin(), f32::from(row).cos()]).collect();
            let moved = |pose: &Pose| {
                let mut p = pose.translation.vector;
                p.x = if mirror { -p.x } else { p.x };
                let by = Isometry3::new([shift.0, shift.1, 1.0].into(), [turn.0, turn.1, turn.2].into());
                let p = by * nalgebra::Point3::from(p);
                Isometry3::from_parts(Translation3::from(p.coords), pose.rotation)
            };
            let anchors: Vec<_> = poses[..4].iter().copied().zip(values.iter().cloned()).collect();
            let there: Vec<_> = anchors.iter().map(|(pose, row)| (moved(pose), row.clone())).collect();
            let weights = |target: Pose, anchors: &[(Pose, Vec<f32>)]| one(&flat(), target, anchors).unwrap().0;
            let (here, there) = (weights(poses[4], &anchors), weights(moved(&poses[4]), &there));
            // Thin tetrahedra extrapolate far: the comparison is relative.
            for (a, b) in here.iter().zip(&there) {
                prop_assert!((a - b).abs() <= 1e-3 * (1.0 + a.abs()), "{a} {b}");
            }
        }
    }
}
