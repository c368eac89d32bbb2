//! Variance predicted by the encoder.

use super::{Category, UncertaintyEstimator, check_length};
use crate::{Result, Variances};

/// `s = ‖σ²‖₁ / dim`, the mean variance over the dimensions of the query's descriptor: the released
/// script's form of the thesis' `s = ‖σ²‖₁` (§5.2.3, data-driven), the same order for one encoder.
///
/// For BTL (Warburg et al. 2021), whose one variance stands for all dimensions, and STUN (Cai et al.
/// 2022), which has one per dimension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variance {
    name: &'static str,
}

impl Variance {
    /// The variance of an encoder trained with the Bayesian triplet loss.
    pub const BTL: Self = Self { name: "BTL" };
    /// The variance of a self-taught student.
    pub const STUN: Self = Self { name: "STUN" };

    /// The variance of another encoder, called `name` in tables.
    #[must_use]
    pub fn named(name: &'static str) -> Self {
        Self { name }
    }
}

impl UncertaintyEstimator for Variance {
    type Evidence<'a> = Variances<'a>;

    const CATEGORY: Category = Category::DataDriven;

    fn name(&self) -> &'static str {
        self.name
    }

    fn estimate_into(&self, evidence: &Variances<'_>, out: &mut [f64]) -> Result<()> {
        check_length(evidence, out)?;
        for (variances, out) in evidence.values().outer_iter().zip(out) {
            let sum: f64 = variances.iter().copied().map(f64::from).sum();
            *out = sum / variances.len() as f64;
        }
        Ok(())
    }
}
