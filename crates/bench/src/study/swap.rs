//! Queries and references exchanged: figure 3.15.

use std::sync::Arc;

use vpr_core::{Definition, Error, Result};
use vpr_report::{
    figure::{Curve, Figure, Panel},
    table::Table,
};

use vpr_study::{Direction, Subject, Technique};

use super::Context;

pub(super) fn run(
    table: &mut Table,
    datasets: &[String],
    context: Context<'_>,
) -> Result<Option<Figure>> {
    let mut figure = Figure::default();
    for (suffix, x, subjects) in [
        ("", 0.0, context.sources.subjects(table, datasets)?),
        (", swapped", 1.0, swapped(table, datasets, context)?),
    ] {
        for subject in subjects {
            let evaluation = subject.evaluation()?;
            let row = format!("{}{suffix}", subject.row);
            subject.push_both(table, &row, subject.column, |it| evaluation.auc_pr(it))?;
            match evaluation.auc_pr(Definition::Published) {
                Ok(published) => draw(&mut figure, &subject, x, published),
                Err(Error::Undefined { .. }) => {}
                Err(err) => return Err(err),
            }
        }
    }
    Ok(Some(figure))
}

/// The same subjects with the roles of queries and references exchanged.
fn swapped(table: &mut Table, datasets: &[String], context: Context<'_>) -> Result<Vec<Subject>> {
    let mut subjects = Vec::new();
    for id in datasets {
        let before = subjects.len();
        for subject in context.sources.stored_subjects(id)? {
            let is_symmetric = subject.column != Technique::CoHog.name();
            let note = (!is_symmetric).then(|| {
                "the stored scores weight regions of the query; exchanged they still do".to_owned()
            });
            let scores = Arc::new(subject.scores.swapped(None));
            let truth = Arc::new(subject.truth.swapped());
            let (row, column, provenance) = (&subject.row, subject.column, subject.provenance);
            subjects.push(Subject::new(row, column, provenance, scores, truth)?.noted(note));
        }
        subjects.extend(context.sources.computed_subjects(id, Direction::Swapped)?);
        if subjects.len() == before {
            let row = format!("{}, swapped", context.sources.entry(id)?.name);
            context.sources.push_absent(table, id, &row)?;
        }
    }
    Ok(subjects)
}

/// One line per technique from the one direction to the other.
fn draw(figure: &mut Figure, subject: &Subject, x: f64, auc: f64) {
    let is_same = |curve: &&mut Curve| {
        curve.name == subject.column && curve.origin == Some(subject.provenance)
    };
    let panel = super::panel_of(figure, &subject.row, || Panel {
        x_ticks: vec![(0.0, "as released".into()), (1.0, "exchanged".into())],
        x_label: "queries and references".into(),
        y_label: "AUC-PR (published)".into(),
        ..Panel::default()
    });
    if let Some(curve) = panel.curves.iter_mut().find(is_same) {
        curve.points.push((x, auc));
        return;
    }
    let curve = Curve::new(subject.column, vec![(x, auc)]).of(subject.provenance);
    panel.curves.push(curve);
}
