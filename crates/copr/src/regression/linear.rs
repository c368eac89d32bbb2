//! Linear interpolation between two anchors, thesis eq. 6.1 to 6.3.

use super::{Regressor, Request, Told, combine};
use crate::{Error, Result, Selection};

/// `(1 − α₁)·f₁ + (1 − α₂)·f₂` with `αᵢ = βᵢ / (β₁ + β₂)`, βᵢ the distance to anchor i.
///
/// Two anchors at the target count equally, the limit of β₁ = β₂ → 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinearInterpolation;

const NAME: &str = "linear interpolation";

impl Regressor for LinearInterpolation {
    fn name(&self) -> &'static str {
        NAME
    }

    fn selection(&self) -> Selection {
        Selection::Neighbours
    }

    fn regress(&self, requests: &[Request<'_>], out: &mut [f32]) -> Result<Told> {
        combine(requests, out, |request| Ok((weights(request)?, Told::default())))
    }
}

fn weights(request: &Request<'_>) -> Result<Vec<f64>> {
    let at = request.pose.translation.vector;
    let betas = request.anchors.iter().map(|it| (at - it.pose.translation.vector).norm());
    let betas: Vec<f64> = betas.collect();
    let [first, second] = betas[..] else {
        let (target, found) = (request.target, betas.len());
        return Err(Error::TooFewAnchors { target, method: NAME, needed: 2, found });
    };
    let sum = first + second;
    Ok(if sum == 0.0 { vec![0.5, 0.5] } else { vec![1.0 - first / sum, 1.0 - second / sum] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::regression::tests::{at, one};

    #[test]
    fn a_quarter_of_the_way_is_three_quarters_of_the_first() {
        let anchors = [(at(0.0, 0.0, 0.0), vec![1.0, 0.0]), (at(4.0, 0.0, 0.0), vec![0.0, 2.0])];
        let regress = |pose| one(&LinearInterpolation, pose, &anchors).unwrap().0;
        assert_eq!(regress(at(1.0, 0.0, 0.0)), [0.75, 0.5]);
        assert_eq!(regress(at(0.0, 0.0, 0.0)), [1.0, 0.0], "on an anchor");
        // 3-4-5: five metres to both.
        assert_eq!(regress(at(2.0, 1.0, 0.0)), [0.5, 1.0], "beside the line");
    }

    #[test]
    fn coincident_anchors_count_equally_and_one_is_not_enough() {
        let both = [(at(1.0, 0.0, 0.0), vec![1.0]), (at(1.0, 0.0, 0.0), vec![3.0])];
        for pose in [at(1.0, 0.0, 0.0), at(5.0, 0.0, 0.0)] {
            assert_eq!(one(&LinearInterpolation, pose, &both).unwrap().0, [2.0]);
        }
        let err = one(&LinearInterpolation, at(0.0, 0.0, 0.0), &both[..1]).unwrap_err();
        assert!(
            matches!(err, Error::TooFewAnchors { target: 7, needed: 2, found: 1, .. }),
            "{err}"
        );
    }
}
