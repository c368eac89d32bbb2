//! Decaying against uniform weights: table 5.4.

use vpr_report::table::Table;

use super::{
    Context,
    subject::{Subject, open},
};
use crate::{EstimatorChoice, Result};

pub(super) fn run(table: &mut Table, subjects: &[Subject], context: Context<'_>) -> Result<()> {
    let choices = [EstimatorChoice::Uniform, EstimatorChoice::Sue];
    for (opened, _) in open(table, subjects, "SUE", context)? {
        for scored in opened.score(&choices)? {
            let place = (opened.row.as_str(), scored.name);
            opened.push_auc(table, place, &scored, None)?;
        }
    }
    Ok(())
}
