//! Several anchors for a strategy that looks at one.

use vpr_core::{Error as CoreError, Pose};

use super::{Regressor, Request, Told};
use crate::{Result, Selection};

/// Regresses from each of the nearest anchors alone and adds the guesses up, weighted by
/// `1 / (d + near_m)` for an anchor `d` metres away. Not in the thesis, whose H sees one anchor.
pub struct Blended {
    of: Box<dyn Regressor>,
    anchors: usize,
    near_m: f64,
}

impl Blended {
    /// A blend of guesses from up to so many anchors; `near_m` is the distance below which anchors
    /// count about alike, metres.
    ///
    /// # Errors
    ///
    /// [`CoreError::Parameter`] for a regressor that looks at several anchors already, for no anchor and
    /// for a distance that is not positive.
    pub fn new(of: Box<dyn Regressor>, anchors: usize, near_m: f64) -> Result<Self> {
        let refuse = |name, value: String, reason| -> Result<Self> {
            Err(CoreError::Parameter { name, value, reason }.into())
        };
        if of.selection() != Selection::Own {
            return refuse("of", of.name().to_owned(), "looks at several anchors already");
        }
        if anchors == 0 {
            return refuse("anchors", "0".to_owned(), "must be at least 1");
        }
        if !(near_m.is_finite() && near_m > 0.0) {
            return refuse("near_m", near_m.to_string(), "must be positive");
        }
        Ok(Self { of, anchors, near_m })
    }
}

impl Regressor for Blended {
    fn name(&self) -> &'static str {
        "blend of several anchors"
    }

    fn selection(&self) -> Selection {
        Selection::UpTo(self.anchors)
    }

    fn regress(&self, requests: &[Request<'_>], out: &mut [f32]) -> Result<Told> {
        let dim = (out.len() / requests.len().max(1)).max(1);
        let alone = requests.iter().flat_map(|request| {
            let one = |anchor| Request { anchors: vec![anchor], ..request.clone() };
            request.anchors.iter().copied().map(one)
        });
        let alone: Vec<Request<'_>> = alone.collect();
        let mut guesses = vec![0.0; alone.len() * dim];
        let told = self.of.regress(&alone, &mut guesses)?;
        let mut guesses = guesses.chunks_exact(dim);
        for (request, out) in requests.iter().zip(out.chunks_exact_mut(dim)) {
            let weights: Vec<f64> = request
                .anchors
                .iter()
                .map(|it| 1.0 / (away(&request.pose, it.pose) + self.near_m))
                .collect();
            let total: f64 = weights.iter().sum();
            let mut sums = vec![0.0; dim];
            for weight in weights {
                let guess = guesses.next().unwrap_or_default();
                let terms = sums.iter_mut().zip(guess);
                terms.for_each(|(sum, value)| *sum += weight / total * f64::from(*value));
            }
            out.iter_mut().zip(sums).for_each(|(out, sum)| *out = super::narrow(sum));
        }
        Ok(told)
    }
}

fn away(a: &Pose, b: &Pose) -> f64 {
    (a.translation.vector - b.translation.vector).norm()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        Control, Controlled, LinearInterpolation,
        regression::tests::{at, one},
    };

    fn copied() -> Box<dyn Regressor> {
        Box::new(Controlled {
            control: Control::Copied,
            of: Box::new(LinearInterpolation),
            seed: 0,
        })
    }

    #[test]
    fn guesses_are_weighted_by_how_near_their_anchors_are() {
        let anchors = [(at(0.0, 0.0, 0.0), vec![1.0, 0.0]), (at(0.3, 0.0, 0.0), vec![0.0, 4.0])];
        let blend = Blended::new(copied(), 4, 0.1).unwrap();
        // Weights 1 / (.1 + .1) and 1 / (.2 + .1): 5 and 10/3 of 25/3.
        let (row, told) = one(&blend, at(0.1, 0.0, 0.0), &anchors).unwrap();
        approx::assert_abs_diff_eq!(row[0], 0.6, epsilon = 1e-6);
        approx::assert_abs_diff_eq!(row[1], 1.6, epsilon = 1e-6);
        assert_eq!(told, Told::default());
        // Of one anchor the blend is its guess.
        assert_eq!(one(&blend, at(0.1, 0.0, 0.0), &anchors[..1]).unwrap().0, [1.0, 0.0]);
        assert_eq!(blend.selection(), Selection::UpTo(4));
    }

    #[test]
    fn what_cannot_be_blended_is_refused() {
        let several: Box<dyn Regressor> = Box::new(LinearInterpolation);
        let text = Blended::new(several, 4, 0.1).err().unwrap().to_string();
        assert!(text.contains("several anchors already"), "{text}");
        assert!(Blended::new(copied(), 0, 0.1).is_err());
        assert!(Blended::new(copied(), 4, 0.0).is_err());
        assert!(Blended::new(copied(), 4, f64::NAN).is_err());
    }
}
