//! Whether rows that are said to be uncertain are wrong.

use vpr_core::{Map, Provenance, metrics::spearman};
use vpr_report::table::{Cell, Table};

use super::Method;
use crate::{
    GaussianParams, GaussianProcess, Options, Regressor, Result, Targets, regressed,
    regression::{Anchor, Request},
};

/// Spearman's ρ between the predicted variance of every regressed row and its squared distance from
/// the descriptor of the image that was left out there.
pub(super) fn push(
    table: &mut Table,
    (label, column, provenance): (&str, &str, Provenance),
    methods: &[Method],
    (all, left_out, targets): (&Map, &[usize], &Targets<'_>),
) -> Result<()> {
    if !methods.contains(&Method::GaussianProcess {}) {
        return Ok(());
    }
    let process = GaussianProcess::new(GaussianParams::default())?;
    let (rows, _) = regressed(all, targets, &process, Options::default())?;
    let errors: Vec<f64> = left_out
        .iter()
        .enumerate()
        .map(|(target, &row)| {
            let (found, truth) = (rows.descriptors().row(target), all.descriptors().row(row));
            found.iter().zip(truth).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum()
        })
        .collect();
    let (poses, anchors) = (all.poses().six_dof()?, targets.anchors());
    let values = all.descriptors().as_slice();
    let dim = all.descriptors().dim();
    let mut variances = Vec::with_capacity(targets.len());
    for (target, it) in targets.iter().enumerate() {
        let place = (target, it.home, &it.pose);
        let chosen = anchors.select(process.selection(), place, process.name())?;
        let of = |anchor: usize| {
            let row = anchors.rows()[anchor];
            Anchor { pose: &poses[row], descriptor: &values[row * dim..][..dim] }
        };
        let anchors = chosen.into_iter().map(of).collect();
        variances.extend(process.variances(&[Request { target, pose: it.pose, anchors }])?);
    }
    let row = format!("Spearman's ρ of predicted variance and squared error of rows / {label}");
    let n = errors.len();
    match spearman(&variances, &errors) {
        Some(rho) => table.push(Cell::new(row, column, rho, provenance, n)),
        None => table.push(Cell::absent(row, column, "all variances or all errors are equal")),
    }
    Ok(())
}
