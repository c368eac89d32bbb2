//! Precision–recall curves and what is read off them: figure 3.10.

use vpr_core::{
    Definition, Error, Evaluation, Result,
    metrics::{self, Positives},
};
use vpr_report::{
    figure::{Curve, Figure, Panel},
    table::Table,
};

use vpr_study::Subject;

use super::Context;

/// Recalls at which the curves are sampled.
const RECALLS: [f64; 5] = [0.2, 0.4, 0.6, 0.8, 1.0];
/// Recall below which precision rests on so few matches that it jumps.
const SETTLED: f64 = 0.02;

pub(super) fn run(
    table: &mut Table,
    datasets: &[String],
    context: Context<'_>,
) -> Result<Option<Figure>> {
    let mut figure = Figure::default();
    for subject in context.sources.subjects(table, datasets)? {
        let evaluation = subject.evaluation()?;
        summarize(table, &subject, &evaluation)?;
        match curve(&evaluation) {
            Ok(points) => {
                sample(table, &subject, &points);
                let curve = Curve::new(subject.column, points).of(subject.provenance);
                super::panel_of(&mut figure, &subject.row, panel).curves.push(curve);
            }
            Err(Error::Undefined { .. }) => {}
            Err(err) => return Err(err),
        }
    }
    Ok(Some(figure))
}

fn panel() -> Panel {
    Panel {
        x_label: "recall".into(),
        y_label: "precision".into(),
        settled_from: Some(SETTLED),
        ..Panel::default()
    }
}

/// `(recall, precision)` of the published definition, recall ascending.
fn curve(evaluation: &Evaluation<'_>) -> Result<Vec<(f64, f64)>> {
    let curve = metrics::precision_recall_curve(
        evaluation.confidence(),
        evaluation.judged().correct(),
        Positives::Published,
    )?;
    Ok(curve.recall.into_iter().zip(curve.precision).rev().collect())
}

/// The numbers VPR-Bench summarises a curve by, each under both definitions.
fn summarize(table: &mut Table, subject: &Subject, evaluation: &Evaluation<'_>) -> Result<()> {
    let row = subject.label();
    let (confidence, correct) = (evaluation.confidence(), evaluation.judged().correct());
    let positives = |definition| evaluation.judged().positives(definition);
    subject.push_both(table, &row, "AUC-PR", |it| evaluation.auc_pr(it))?;
    subject.push_both(table, &row, "average precision", |it| evaluation.average_precision(it))?;
    subject.push_both(table, &row, "EP", |it| {
        metrics::extended_precision(confidence, correct, positives(it))
    })?;
    subject.push_both(table, &row, "AUC-ROC", |it| {
        let positive = metrics::roc_positives(it, &subject.best().reference, &subject.truth)?;
        metrics::auc_roc(confidence, &positive)
    })?;
    subject.push_both(table, &row, "P@100%R", |it| {
        metrics::precision_at_full_recall(it, confidence, correct)
    })?;
    subject.push_both(table, &row, "R@100%P", |it| {
        metrics::recall_at_precision(1.0, confidence, correct, positives(it))
    })?;
    subject.push_both(table, &row, "R@95%P", |it| {
        metrics::recall_at_precision(0.95, confidence, correct, positives(it))
    })?;
    subject
        .push_both(table, &row, "F1 max", |it| metrics::f1_max(confidence, correct, positives(it)))
}

/// Precision where recall first reaches each of [`RECALLS`].
fn sample(table: &mut Table, subject: &Subject, points: &[(f64, f64)]) {
    for recall in RECALLS {
        let reached = points.iter().find(|point| point.0 >= recall - 1e-12);
        if let Some((_, precision)) = reached {
            let cell = subject.cell(&subject.label(), &format!("P at R={recall}"), *precision);
            table.push(cell.defined(Definition::Published));
        }
    }
}
