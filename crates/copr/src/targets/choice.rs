//! Which of many targets are worth a row.

use vpr_core::{Error as CoreError, Map};

use super::{Placement, Target, Targets};
use crate::{Anchors, Options, Regressor, Result, Selection, regressed};

impl<'a> Targets<'a> {
    /// These targets, each with the anchor that it is placed from.
    ///
    /// # Errors
    ///
    /// [`CoreError::OutOfRange`] if an anchor does not exist, [`CoreError::NotFinite`] names the first
    /// pose that is not finite.
    pub fn placed(anchors: &'a Anchors, targets: Vec<Target>) -> Result<Self> {
        let len = anchors.len();
        if let Some(index) = targets.iter().map(|it| it.home).find(|&home| home >= len) {
            return Err(CoreError::OutOfRange { what: "anchor", index, len }.into());
        }
        vpr_core::Poses::SixDof(targets.iter().map(|it| it.pose).collect()).check_finite()?;
        Ok(Self { anchors, placement: Placement::Listed(targets) })
    }

    /// The share of them of which there is the least doubt, in their order; of equal doubt those of
    /// lower number. There is a number of doubt for each.
    ///
    /// # Errors
    ///
    /// [`CoreError::Parameter`] for a share that is not from 0 to 1, [`CoreError::Mismatch`] if there are
    /// not as many numbers as targets.
    pub fn least_doubtful(&self, doubts: &[f64], share: f64) -> Result<Self> {
        if !(0.0..=1.0).contains(&share) {
            let (value, reason) = (share.to_string(), "must be from 0 to 1");
            return Err(CoreError::Parameter { name: "share", value, reason }.into());
        }
        if doubts.len() != self.len() {
            let (expected, actual) = (self.len(), doubts.len());
            return Err(CoreError::Mismatch { what: "doubts", expected, actual }.into());
        }
        let mut order: Vec<usize> = (0..doubts.len()).collect();
        order.sort_by(|&a, &b| doubts[a].total_cmp(&doubts[b]).then(a.cmp(&b)));
        order.truncate(rounded(share * doubts.len() as f64));
        order.sort_unstable();
        Self::placed(self.anchors, order.into_iter().map(|target| self.get(target)).collect())
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "not negative")]
fn rounded(n: f64) -> usize {
    n.round() as usize
}

/// How far two anchors are from agreeing on every target: the distance between what is regressed
/// there from its own anchor and from the nearest other one. Infinite if there is only one anchor.
///
/// Behind a wall or beside what neither camera sees, two guesses have no reason to be alike.
///
/// # Errors
///
/// [`CoreError::Parameter`] for a regressor that does not look at one anchor alone; those of
/// [`regressed`].
pub fn disagreement(
    map: &Map,
    targets: &Targets<'_>,
    regressor: &dyn Regressor,
    options: Options,
) -> Result<Vec<f64>> {
    let anchors = targets.anchors();
    if regressor.selection() != Selection::Own {
        let (name, value) = ("regressor", regressor.name().to_owned());
        let reason = "two anchors can only disagree if each is looked at alone";
        return Err(CoreError::Parameter { name, value, reason }.into());
    }
    if anchors.len() < 2 {
        return Ok(vec![f64::INFINITY; targets.len()]);
    }
    let other = |target: Target| {
        let two = anchors.nearest(target.pose.translation.vector.into(), 2)?;
        let home = two.into_iter().find(|&it| it != target.home).unwrap_or(target.home);
        Ok(Target { home, ..target })
    };
    let others = targets.iter().map(other).collect::<Result<Vec<Target>>>()?;
    let others = Targets::placed(anchors, others)?;
    let (ours, _) = regressed(map, targets, regressor, options)?;
    let (theirs, _) = regressed(map, &others, regressor, options)?;
    let (ours, theirs) = (ours.descriptors().view(), theirs.descriptors().view());
    let apart = ours.outer_iter().zip(theirs.outer_iter()).map(|(a, b)| {
        let squares = a.iter().zip(b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2));
        squares.sum::<f64>().sqrt()
    });
    Ok(apart.collect())
}

#[cfg(test)]
mod tests {
    use ndarray::array;
    use vpr_core::{Descriptors, Pose, Poses};

    use super::*;
    use crate::{Control, Controlled, LinearInterpolation};

    #[test]
    fn anchors_disagree_where_their_descriptors_do() {
        let poses: Vec<Pose> = [0.0, 1.0, 2.0].map(|x| Pose::translation(x, 0.0, 0.0)).to_vec();
        let rows = Descriptors::new(array![[0.0, 0.0], [0.0, 0.5], [3.0, 4.5]]).unwrap();
        let map = Map::new(rows, Poses::SixDof(poses.clone())).unwrap();
        let anchors = Anchors::of_rows(&poses, &[vec![0, 1, 2]]).unwrap();
        let at = |x: f64, home| Target { pose: Pose::translation(x, 0.0, 0.0), home };
        let all = vec![at(0.1, 0), at(1.9, 2), at(1.2, 1)];
        let targets = Targets::placed(&anchors, all).unwrap();
        let of = Box::new(LinearInterpolation);
        let copied = Controlled { control: Control::Copied, of, seed: 0 };
        let doubts = disagreement(&map, &targets, &copied, Options::default()).unwrap();
        assert_eq!(doubts, [0.5, 5.0, 5.0]);
        let kept = targets.least_doubtful(&doubts, 0.67).unwrap();
        assert_eq!(kept.iter().map(|it| it.home).collect::<Vec<_>>(), [0, 2]);
        assert!(targets.least_doubtful(&doubts, 0.0).unwrap().is_empty());
        assert!(targets.least_doubtful(&doubts, 1.1).is_err());
        assert!(targets.least_doubtful(&doubts[1..], 0.5).is_err());
        let linear = disagreement(&map, &targets, &LinearInterpolation, Options::default());
        assert!(linear.unwrap_err().to_string().contains("looked at alone"));
        assert!(Targets::placed(&anchors, vec![at(0.0, 3)]).is_err());
        assert!(Targets::placed(&anchors, vec![at(f64::NAN, 0)]).is_err());
        let one = Anchors::of_rows(&poses, &[vec![0]]).unwrap();
        let alone = Targets::placed(&one, vec![at(0.5, 0)]).unwrap();
        let doubts = disagreement(&map, &alone, &copied, Options::default()).unwrap();
        assert_eq!(doubts, [f64::INFINITY]);
    }
}
