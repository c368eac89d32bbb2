//! Regressed rows that should not help: what a gain is compared with.

use rand::{RngExt, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::{Anchor, Regressor, Request, Told};
use crate::{Result, Selection};

/// What takes the place of a regressed descriptor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Control {
    /// Random directions of unit length; as released they were 13 times as long as a descriptor,
    /// so that none was ever retrieved (C-4).
    Random,
    /// Each target gets the descriptor that another should have, one of those that are worked off with
    /// it: which one depends on the size of a batch.
    Shuffled,
    /// The descriptor of the anchor itself, whatever the pose.
    Copied,
}

/// A regressor whose descriptors are replaced by a control of the same number, poses and anchors.
pub struct Controlled {
    /// What takes their place.
    pub control: Control,
    /// What [`Control::Shuffled`] shuffles.
    pub of: Box<dyn Regressor>,
    /// Decides what is random.
    pub seed: u64,
}

impl Regressor for Controlled {
    fn name(&self) -> &'static str {
        match self.control {
            Control::Random => "random",
            Control::Shuffled => "shuffled",
            Control::Copied => "copied anchor",
        }
    }

    fn selection(&self) -> Selection {
        match self.control {
            Control::Shuffled => self.of.selection(),
            Control::Random | Control::Copied => Selection::Own,
        }
    }

    fn regress(&self, requests: &[Request<'_>], out: &mut [f32]) -> Result<Told> {
        let dim = (out.len() / requests.len().max(1)).max(1);
        match self.control {
            Control::Random => {
                for (request, out) in requests.iter().zip(out.chunks_mut(dim)) {
                    random(out, self.seed, request.target);
                }
            }
            Control::Copied => {
                for (request, out) in requests.iter().zip(out.chunks_mut(dim)) {
                    if let Some(Anchor { descriptor, .. }) = request.anchors.first() {
                        out.copy_from_slice(descriptor);
                    }
                }
            }
            Control::Shuffled => {
                let told = self.of.regress(requests, out)?;
                shuffle(out, dim, self.seed ^ requests.first().map_or(0, |it| it.target as u64));
                return Ok(told);
            }
        }
        Ok(Told::default())
    }
}

/// A direction of unit length: twelve uniform numbers add to a nearly normal one.
fn random(out: &mut [f32], seed: u64, target: usize) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(target as u64);
    let mut normal = || (0..12).map(|_| random.random::<f64>() - 0.5).sum::<f64>();
    let values: Vec<f64> = out.iter().map(|_| normal()).collect();
    let norm = values.iter().map(|value| value * value).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
    for (out, value) in out.iter_mut().zip(values) {
        *out = super::narrow(value / norm);
    }
}

/// Rows in another order.
fn shuffle(rows: &mut [f32], dim: usize, seed: u64) {
    let mut order: Vec<usize> = (0..rows.len() / dim).collect();
    order.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
    let before = rows.to_vec();
    for (row, from) in rows.chunks_mut(dim).zip(order) {
        row.copy_from_slice(&before[from * dim..][..dim]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        LinearInterpolation,
        regression::tests::{at, one},
    };

    #[test]
    fn random_rows_have_unit_length_and_depend_on_seed_and_target() {
        let anchors = [(at(0.0, 0.0, 0.0), vec![5.0; 64])];
        let row = |seed| {
            let control =
                Controlled { control: Control::Random, of: Box::new(LinearInterpolation), seed };
            one(&control, at(1.0, 0.0, 0.0), &anchors).unwrap().0
        };
        let norm = row(1).iter().map(|value| value * value).sum::<f32>().sqrt();
        approx::assert_abs_diff_eq!(norm, 1.0, epsilon = 1e-5);
        assert_eq!(row(1), row(1));
        assert_ne!(row(1), row(2));
        let mean = row(3).iter().sum::<f32>() / 64.0;
        assert!(mean.abs() < 0.06, "{mean}");
    }

    #[test]
    fn shuffled_rows_are_the_same_rows() {
        let mut rows: Vec<f32> = (0_u8..20).map(f32::from).collect();
        let before = rows.clone();
        shuffle(&mut rows, 2, 3);
        assert_ne!(rows, before);
        let mut pairs: Vec<_> = rows.chunks(2).map(<[f32]>::to_vec).collect();
        pairs.sort_by(|a, b| a[0].total_cmp(&b[0]));
        assert_eq!(pairs.concat(), before);
    }

    #[test]
    fn a_copy_is_the_anchor() {
        let anchors = [(at(0.0, 0.0, 0.0), vec![5.0, 6.0])];
        let control =
            Controlled { control: Control::Copied, of: Box::new(LinearInterpolation), seed: 0 };
        assert_eq!(one(&control, at(3.0, 0.0, 0.0), &anchors).unwrap().0, [5.0, 6.0]);
    }
}
