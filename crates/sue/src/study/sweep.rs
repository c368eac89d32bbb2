//! AUC-PR over K and λ: figure 5.7.

use vpr_core::{Definition, Error as CoreError, Evaluation};
use vpr_report::{
    figure::{Curve, Figure, Panel, Scale},
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
    let (mut over_k, mut over_lambda) = (Vec::new(), Vec::new());
    let base = EstimatorSettings::default();
    for (opened, _) in open(table, subjects, "K=10", context)? {
        let with_k = |k: usize| SueParams { k, ..base.sue };
        let at_k = k.iter().map(|&k| (k as f64, format!("K={k}"), with_k(k)));
        let points = curve(table, &opened, at_k)?;
        draw(&mut over_k, ("K", "λ = 350", Scale::Linear), &opened, points);
        let with_lambda = |lambda: f64| SueParams { lambda, ..base.sue };
        let at_lambda = lambda.iter().map(|&it| (it, format!("λ={it}"), with_lambda(it)));
        let points = curve(table, &opened, at_lambda)?;
        draw(&mut over_lambda, ("λ", "K = 10", Scale::Log), &opened, points);
    }
    Ok(Figure { panels: [over_k, over_lambda].concat() })
}

/// Adds a curve to the panel of its dataset; datasets under one encoder only share a panel.
fn draw(
    panels: &mut Vec<Panel>,
    (x_label, fixed, x_scale): (&str, &str, Scale),
    opened: &Labelled,
    points: Vec<(f64, f64)>,
) {
    let row = opened.row.as_str();
    let (dataset, name) = row.split_once(" / ").unwrap_or(("generated counterparts", row));
    let title = format!("{dataset}, {fixed}");
    let index = panels.iter().position(|panel| panel.title == title).unwrap_or_else(|| {
        let (x_label, y_label) = (x_label.to_owned(), "AUC-PR".to_owned());
        panels.push(Panel { title, x_label, y_label, x_scale, ..Panel::default() });
        panels.len() - 1
    });
    let origin = opened.corpus.provenance;
    panels[index].curves.push(Curve::new(name, points).of(origin));
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
