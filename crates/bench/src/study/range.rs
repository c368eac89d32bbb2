//! AUC-PR over the accepted range of frames: figure 3.17.

use vpr_core::{
    GroundTruth, Result,
    figure::{Curve, Figure, Panel},
    table::Table,
};

use super::{
    Context,
    subject::{Subject, push_both, subjects},
};
use crate::evaluate::Positives;

pub(super) fn run(
    table: &mut Table,
    datasets: &[String],
    tolerances: &[usize],
    context: Context<'_>,
) -> Result<Option<Figure>> {
    let mut figure = Figure::default();
    for subject in subjects(table, datasets, context)? {
        let mut points = Vec::new();
        for &tolerance in tolerances {
            let (n_queries, n_references) =
                (subject.similarities.n_queries(), subject.similarities.n_references());
            let truth = GroundTruth::within_frames(n_queries, n_references, tolerance);
            let subject = Subject {
                row: format!("{} ±{tolerance}", subject.row),
                column: subject.column,
                provenance: subject.provenance,
                similarities: subject.similarities.clone(),
                best: subject.best.clone(),
                truth,
                note: subject.note.clone(),
            };
            let evaluation = subject.evaluation()?;
            push_both(table, &subject, &subject.row, subject.column, |it| {
                evaluation.auc_pr(evaluation.positives(it))
            })?;
            if let Ok(published) = evaluation.auc_pr(Positives::Published) {
                points.push((tolerance as f64, published));
            }
        }
        let name = format!("{}{}", subject.column, super::origin_mark(subject.provenance));
        super::panel_of(&mut figure, &subject.row, panel).curves.push(Curve { name, points });
    }
    Ok(Some(figure))
}

fn panel() -> Panel {
    Panel {
        x_label: "accepted range, ± frames".into(),
        y_label: "AUC-PR (published)".into(),
        ..Panel::default()
    }
}
