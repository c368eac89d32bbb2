//! A Gaussian process over poses: several anchors at once, and how sure it is. Beyond the thesis, whose
//! H sees one anchor and whose plane knows no turn.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use vpr_core::{Error as CoreError, Pose};

use super::{Regressor, Request, Told, combine};
use crate::{Error, Result, Selection, rotation_error, translation_error};

/// How alike descriptors are expected to be: `exp(−d²/2ℓ² − θ²/2φ²)` for cameras d metres and θ
/// degrees apart.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GaussianParams {
    /// ℓ, metres.
    pub metres: f64,
    /// φ, degrees.
    pub degrees: f64,
    /// Variance of what descriptors of one pose differ by, over that of all descriptors.
    pub noise: f64,
    /// Number of anchors, nearest first; where there are fewer, all.
    pub n_anchors: usize,
}

impl Default for GaussianParams {
    fn default() -> Self {
        Self { metres: 0.3, degrees: 20.0, noise: 0.05, n_anchors: 16 }
    }
}

/// Regression by a Gaussian process around the mean of the anchors. The weights of the anchors sum
/// to 1; far from all of them every anchor counts alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaussianProcess(GaussianParams);

const NAME: &str = "Gaussian process";

impl GaussianProcess {
    /// A process with these parameters.
    ///
    /// # Errors
    ///
    /// [`CoreError::Parameter`] for one that is not positive.
    pub fn new(params: GaussianParams) -> Result<Self> {
        let numbers =
            [("metres", params.metres), ("degrees", params.degrees), ("noise", params.noise)];
        if let Some((name, value)) =
            numbers.into_iter().find(|it| !(it.1 > 0.0 && it.1.is_finite()))
        {
            let (value, reason) = (value.to_string(), "must be positive");
            return Err(CoreError::Parameter { name, value, reason }.into());
        }
        if params.n_anchors == 0 {
            let (name, value, reason) = ("n_anchors", "0".to_owned(), "must be at least 1");
            return Err(CoreError::Parameter { name, value, reason }.into());
        }
        Ok(Self(params))
    }

    fn likeness(&self, a: &Pose, b: &Pose) -> f64 {
        let square = |value: f64| value * value;
        let far = square(translation_error(a, b) / self.0.metres);
        let turned = square(rotation_error(a, b) / self.0.degrees);
        (-0.5 * (far + turned)).exp()
    }

    /// The weight of every anchor, and the variance that is left of a descriptor's.
    fn solved(&self, request: &Request<'_>) -> Result<(Vec<f64>, f64)> {
        let (anchors, target) = (&request.anchors, request.target);
        let n = anchors.len();
        if n == 0 {
            return Err(Error::TooFewAnchors { target, method: NAME, needed: 1, found: 0 });
        }
        let all = DMatrix::from_fn(n, n, |row, column| {
            let noise = if row == column { self.0.noise } else { 0.0 };
            self.likeness(anchors[row].pose, anchors[column].pose) + noise
        });
        let here = DVector::from_fn(n, |row, _| self.likeness(anchors[row].pose, &request.pose));
        // The noise makes it positive definite, whatever the poses.
        let cholesky = all.cholesky().ok_or(Error::Singular { target })?;
        let weights = cholesky.solve(&here);
        let variance = (1.0 - here.dot(&weights)).max(0.0);
        let rest = (1.0 - weights.sum()) / n as f64;
        Ok((weights.iter().map(|it| it + rest).collect(), variance))
    }

    /// The predicted variance of every target's descriptor, as a share of that of all descriptors: 0
    /// on an anchor without noise, 1 far from all of them.
    ///
    /// # Errors
    ///
    /// [`Error::TooFewAnchors`] for a target without an anchor.
    pub fn variances(&self, requests: &[Request<'_>]) -> Result<Vec<f64>> {
        requests.iter().map(|request| Ok(self.solved(request)?.1)).collect()
    }
}

impl Regressor for GaussianProcess {
    fn name(&self) -> &'static str {
        NAME
    }

    fn selection(&self) -> Selection {
        Selection::UpTo(self.0.n_anchors)
    }

    fn regress(&self, requests: &[Request<'_>], out: &mut [f32]) -> Result<Told> {
        combine(requests, out, |request| Ok((self.solved(request)?.0, Told::default())))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;
    use proptest::prelude::*;

    use super::*;
    use crate::regression::{
        Anchor,
        tests::{at, one},
    };

    fn process(noise: f64) -> GaussianProcess {
        GaussianProcess::new(GaussianParams { noise, ..GaussianParams::default() }).unwrap()
    }

    fn variance(process: &GaussianProcess, pose: Pose, anchors: &[(Pose, Vec<f32>)]) -> f64 {
        let anchors = anchors.iter().map(|(pose, descriptor)| Anchor { pose, descriptor });
        let request = Request { target: 0, pose, anchors: anchors.collect() };
        process.variances(&[request]).unwrap()[0]
    }

    #[test]
    fn it_is_sure_on_an_anchor_and_knows_the_mean_far_away() {
        let anchors = [(at(0.0, 0.0, 0.0), vec![1.0, 0.0]), (at(0.6, 0.0, 0.0), vec![0.0, 2.0])];
        let process = process(1e-9);
        let (here, _) = one(&process, at(0.0, 0.0, 0.0), &anchors).unwrap();
        approx::assert_abs_diff_eq!(here[0], 1.0, epsilon = 1e-5);
        approx::assert_abs_diff_eq!(here[1], 0.0, epsilon = 1e-5);
        assert!(variance(&process, at(0.0, 0.0, 0.0), &anchors) < 1e-6);
        let (far, _) = one(&process, at(50.0, 0.0, 0.0), &anchors).unwrap();
        assert_eq!(far, [0.5, 1.0]);
        assert_eq!(variance(&process, at(50.0, 0.0, 0.0), &anchors), 1.0);
        let turned = Isometry3::new([0.0; 3].into(), [0.0, 1.0, 0.0].into());
        assert!(variance(&process, turned, &anchors) > 0.9, "a turn is a way too");
    }

    #[test]
    fn coincident_anchors_share_their_weight_and_none_is_an_error() {
        let twice = [(at(0.0, 0.0, 0.0), vec![1.0]), (at(0.0, 0.0, 0.0), vec![3.0])];
        let (found, _) = one(&process(0.05), at(0.1, 0.0, 0.0), &twice).unwrap();
        approx::assert_abs_diff_eq!(found[0], 2.0, epsilon = 1e-6);
        let request = Request { target: 4, pose: at(0.0, 0.0, 0.0), anchors: Vec::new() };
        let err = process(0.05).regress(&[request], &mut [0.0]).unwrap_err().to_string();
        assert!(err.contains("target 4") && err.contains("needs 1 anchors"), "{err}");
        for (name, params) in [
            ("metres", GaussianParams { metres: 0.0, ..GaussianParams::default() }),
            ("noise", GaussianParams { noise: f64::NAN, ..GaussianParams::default() }),
            ("n_anchors", GaussianParams { n_anchors: 0, ..GaussianParams::default() }),
        ] {
            assert!(GaussianProcess::new(params).unwrap_err().to_string().contains(name));
        }
    }

    proptest! {
        /// A world that is turned and shifted gives the same descriptors and variances.
        #[test]
        fn the_world_may_be_moved(
            points in prop::collection::vec((-1.0_f64..1.0, -1.0_f64..1.0, -1.0_f64..1.0), 6),
            turn in (-3.0_f64..3.0, -3.0_f64..3.0, -3.0_f64..3.0), shift in -50.0_f64..50.0,
        ) {
            let by = Isometry3::new([shift, 1.0, -shift].into(), [turn.0, turn.1, turn.2].into());
            let pose = |&(x, y, z): &(f64, f64, f64)| Isometry3::new([x, y, z].into(), [z, x, y].into());
            let poses: Vec<Pose> = points.iter().map(pose).collect();
            let values = |row: usize| vec![(row as f32).sin(), (row as f32).cos()];
            let of = |by: &Pose| -> Vec<(Pose, Vec<f32>)> {
                poses[..5].iter().enumerate().map(|(row, pose)| (by * pose, values(row))).collect()
            };
            let process = process(0.05);
            let (here, there) = (of(&Isometry3::identity()), of(&by));
            let (a, _) = one(&process, poses[5], &here).unwrap();
            let (b, _) = one(&process, by * poses[5], &there).unwrap();
            for (a, b) in a.iter().zip(&b) {
                prop_assert!((a - b).abs() < 1e-4, "{a} {b}");
            }
            let (a, b) = (variance(&process, poses[5], &here), variance(&process, by * poses[5], &there));
            prop_assert!((a - b).abs() < 1e-6 && (0.0..=1.0).contains(&a));
        }
    }
}
