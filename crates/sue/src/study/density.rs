//! SUE compensated for the density of the map: table 5.5.

use vpr_report::table::{Cell, Table};

use super::{
    Context,
    subject::{Labelled, Scored, Subject, open},
};
use crate::{
    Density, DensityCompensatedSue, Error, EstimatorChoice, Places, Result, Sue,
    UncertaintyEstimator,
};

pub(super) fn run(
    table: &mut Table,
    subjects: &[Subject],
    nth: &[usize],
    context: Context<'_>,
) -> Result<()> {
    for (opened, _) in open(table, subjects, "none", context)? {
        push_all(table, &opened, &opened.row, nth)?;
    }
    Ok(())
}

/// One row: without compensation, and with each neighbour; distinct positions, then plain.
pub(super) fn push_all(
    table: &mut Table,
    opened: &Labelled,
    row: &str,
    nth: &[usize],
) -> Result<()> {
    let plain = &opened.score(&[EstimatorChoice::Sue])?[0];
    opened.push_auc(table, (row, "none"), plain, None)?;
    for (density, suffix) in [(Density::Distinct, ""), (Density::Plain, ", eq. 5.12 as written")] {
        for &nth in nth {
            let column = format!("k={nth}{suffix}");
            match compensated(opened, nth, density) {
                Ok(uncertainty) => {
                    let scored = Scored { name: "", uncertainty: Ok(uncertainty), own: None };
                    opened.push_auc(table, (row, &column), &scored, None)?;
                }
                Err(err @ (Error::NoDensity { .. } | Error::Core(_))) => {
                    let cell = opened.cell(row, &column, 0.0).noted(err.to_string());
                    table.push(Cell { value: None, ..cell }.defined("published"));
                }
                Err(err) => return Err(err),
            }
        }
    }
    Ok(())
}

fn compensated(opened: &Labelled, nth: usize, density: Density) -> Result<Vec<f64>> {
    let corpus = &opened.corpus;
    let sue = DensityCompensatedSue::new(Sue::corrected(), &corpus.poses, nth, density)?;
    sue.estimate(&Places::from_poses(&corpus.retrieval, &corpus.poses)?)
}
