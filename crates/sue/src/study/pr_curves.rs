//! Precision–recall curves: figures 5.1, 5.8 and 5.10.

use vpr_core::{Definition, Error as CoreError, metrics};
use vpr_report::{
    figure::{Curve, Figure, Panel},
    table::Table,
};

use super::{
    Context,
    subject::{Labelled, Scored, Subject, open},
};
use crate::{EstimatorChoice, Result};
use vpr_core::Evaluation;

/// Recalls at which the curves are sampled.
const RECALLS: [f64; 5] = [0.2, 0.4, 0.6, 0.8, 1.0];
/// Recall below which precision rests on so few matches that it jumps.
const SETTLED: f64 = 0.02;

pub(super) fn run(
    table: &mut Table,
    subjects: &[Subject],
    estimators: &[EstimatorChoice],
    context: Context<'_>,
) -> Result<Figure> {
    let mut figure = Figure::default();
    for (opened, verify) in open(table, subjects, "AUC-PR", context)? {
        let mut scored = opened.score(estimators)?;
        for method in verify {
            scored.push(opened.verify(method, context)?);
        }
        let mut panel = Panel {
            title: opened.row.clone(),
            x_label: "recall".into(),
            y_label: "precision".into(),
            settled_from: Some(SETTLED),
            ..Panel::default()
        };
        for it in &scored {
            let row = format!("{}: {}", opened.row, it.name);
            opened.push_auc(table, (&row, "AUC-PR"), it, None)?;
            if let Some(points) = curve(&opened, it)? {
                sample(table, &opened, &row, &points);
                panel.curves.push(Curve::new(it.name, points));
            }
        }
        figure.panels.push(panel);
    }
    Ok(figure)
}

/// `(recall, precision)` of the published definition, recall ascending.
fn curve(opened: &Labelled, scored: &Scored) -> Result<Option<Vec<(f64, f64)>>> {
    let Ok(uncertainty) = &scored.uncertainty else { return Ok(None) };
    let judged = &opened.corpus.judged;
    let evaluation = Evaluation::new(uncertainty, judged)?;
    let positives = judged.positives(Definition::Published);
    match metrics::precision_recall_curve(evaluation.confidence(), judged.correct(), positives) {
        Ok(curve) => Ok(Some(curve.recall.into_iter().zip(curve.precision).rev().collect())),
        Err(CoreError::Undefined { .. }) => Ok(None),
        Err(err) => Err(err.into()),
    }
}

/// Precision where recall first reaches each of [`RECALLS`].
fn sample(table: &mut Table, opened: &Labelled, row: &str, points: &[(f64, f64)]) {
    for recall in RECALLS {
        if let Some((_, precision)) = points.iter().find(|point| point.0 >= recall - 1e-12) {
            let cell = opened.cell(row, &format!("P at R={recall}"), *precision);
            table.push(cell.defined(Definition::Published));
        }
    }
}
