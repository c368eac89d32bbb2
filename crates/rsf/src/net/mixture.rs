//! Networks between the one that fine-tuning began with and the one that it came to.

use vpr_core::Error as CoreError;
use vpr_nets::{
    model::Tunable,
    weights::{Tensor, Weights},
};

use crate::Result;

/// Shares of the way that are tried besides all of it (Wortsman et al., CVPR 2022, of fine-tuned
/// models that are to keep what they knew).
pub(super) const SHARES: [f32; 3] = [0.25, 0.5, 0.75];

/// The network at this share of the way between two networks like `network`. What both agree in stays
/// bit for bit.
///
/// # Errors
///
/// [`CoreError::Mismatch`] if a parameter of one is not in the other, or has another number of values.
pub(super) fn mixed<N: Tunable>(
    mut network: N,
    start: &Weights,
    end: &Weights,
    share: f32,
) -> Result<N> {
    let between = |(key, end): (&str, &Tensor)| {
        let start = start.get(key).map_or(&[][..], |it| &it.data);
        let (expected, actual) = (end.data.len(), start.len());
        if expected != actual {
            let what = "values of a parameter";
            return Err(CoreError::Mismatch { what, expected, actual }.into());
        }
        Ok(start.iter().zip(&end.data).map(|(a, b)| a + share * (b - a)).collect())
    };
    let values: Vec<Vec<f32>> = end.iter().map(between).collect::<Result<_>>()?;
    let mut values = values.into_iter();
    let weights = end.clone().mapped(|key, tensor| {
        let data = values.next()?;
        Some((key, Tensor { shape: tensor.shape, data }))
    });
    weights.apply(&mut network)?;
    Ok(network)
}
