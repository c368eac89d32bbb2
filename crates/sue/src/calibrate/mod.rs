//! Thresholds with a guarantee that holds for any distribution of queries.
//!
//! Both ways need held-out queries that are exchangeable with those to come: the same map, encoder,
//! estimator and kind of query. A change of season or camera voids the guarantee.

mod false_acceptance;
mod precision;

pub use false_acceptance::{FalseAcceptance, calibrate_false_acceptance};
pub use precision::{Calibrated, PrecisionGoal, Scope, calibrate_precision};

use vpr_core::Error;

use crate::Result;

/// Refuses what is not a share strictly between 0 and 1.
fn check_share(name: &'static str, value: f64) -> Result<()> {
    if value > 0.0 && value < 1.0 {
        return Ok(());
    }
    let reason = "must be above 0 and below 1";
    Err(Error::Parameter { name, value: value.to_string(), reason }.into())
}

/// Refuses uncertainties that are not finite, or not one per judgement, or none.
fn check_queries(uncertainty: &[f64], correct: &[bool]) -> Result<()> {
    let (expected, actual) = (correct.len(), uncertainty.len());
    if expected != actual {
        let what = "uncertainties, one per judgement";
        return Err(Error::Mismatch { what, expected, actual }.into());
    }
    if correct.is_empty() {
        return Err(Error::Empty("calibration queries").into());
    }
    match uncertainty.iter().position(|it| !it.is_finite()) {
        None => Ok(()),
        Some(row) => {
            let value = uncertainty[row];
            Err(Error::NotFinite { what: "uncertainties", row, column: 0, value }.into())
        }
    }
}
