//! AUC-PR over K and λ: figure 5.7.

use vpr_core::{Definition, Error as CoreError, Evaluation};
use vpr_report::{
    figure::{Curve, Figure, Panel},
    table::{Cell, Table},
};

use super::{
    Context,
    subject::{Labelled, Subject, open},
};
use crate::{EstimatorChoice, EstimatorSettings, Result, SueParams};

pub(super) fn run(
    table: &mut Table,
    subjects: &[Subject],
    k: &[usize],
    lambda: &[f64],
    context: Context<'_>,
) -> Result<Figure> {
    let panel = |x_label: &str, title: &str| Panel {
        title: title.to_owned(),
        x_label: x_label.to_owned(),
        y_label: "AUC-PR".to_owned(),
        ..Panel::default()
    };
    let mut over_k = panel("K", "λ = 350");
    let mut over_lambda = panel("log₁₀ λ", "K = 10");
    let base = EstimatorSettings::default();
    for (opened, _) in open(table, subjects, "K=10", context)? {
        let with_k = |k: usize| SueParams { k, ..base.sue };
        let at_k = k.iter().map(|&k| (k as f64, format!("K={k}"), with_k(k)));
        let points = curve(table, &opened, at_k)?;
        over_k.curves.push(Curve { name: opened.row.clone(), points });
        let with_lambda = |lambda: f64| SueParams { lambda, ..base.sue };
        let at_lambda = lambda.iter().map(|&it| (it.log10(), format!("λ={it}"), with_lambda(it)));
        let points = curve(table, &opened, at_lambda)?;
        over_lambda.curves.push(Curve { name: opened.row.clone(), points });
    }
    Ok(Figure { panels: vec![over_k, over_lambda] })
}

/// One cell and one point per setting.
fn curve(
    table: &mut Table,
    opened: &Labelled,
    settings: impl Iterator<Item = (f64, String, SueParams)>,
) -> Result<Vec<(f64, f64)>> {
    let mut points = Vec::new();
    for (x, column, sue) in settings {
        let settings = EstimatorSettings { sue, ..EstimatorSettings::default() };
        let scored = opened.score_one(EstimatorChoice::Sue, &settings)?;
        let cell = opened.cell(&opened.row, &column, 0.0).defined(Definition::Published);
        let uncertainty = match scored.uncertainty {
            Ok(uncertainty) => uncertainty,
            Err(why) => {
                table.push(Cell { value: None, ..cell.noted(why) });
                continue;
            }
        };
        let evaluation = Evaluation::new(&uncertainty, &opened.corpus.judged)?;
        match evaluation.auc_pr(Definition::Published) {
            Ok(value) => {
                table.push(Cell { value: Some(value.into()), ..cell });
                points.push((x, value));
            }
            Err(CoreError::Undefined { .. }) => {
                table.push(Cell { value: None, ..cell.noted("no best match is correct") });
            }
            Err(err) => return Err(err.into()),
        }
    }
    Ok(points)
}
