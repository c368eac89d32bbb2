//! Queries and references exchanged: figure 3.15.

use vpr_core::{
    Result,
    figure::{Curve, Figure, Panel},
    table::{Cell, Table},
};

use super::{
    Context,
    subject::{Subject, computed, push_both, stored, subjects},
};
use crate::{evaluate::Positives, technique::Technique};

pub(super) fn run(
    table: &mut Table,
    datasets: &[String],
    context: Context<'_>,
) -> Result<Option<Figure>> {
    let mut figure = Figure::default();
    for (suffix, x, subjects) in [
        ("", 0.0, subjects(table, datasets, context)?),
        (", swapped", 1.0, swapped(table, datasets, context)?),
    ] {
        for subject in subjects {
            let evaluation = subject.evaluation()?;
            let row = format!("{}{suffix}", subject.row);
            push_both(table, &subject, &row, subject.column, |it| {
                evaluation.auc_pr(evaluation.positives(it))
            })?;
            if let Ok(published) = evaluation.auc_pr(Positives::Published) {
                draw(&mut figure, &subject, x, published);
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
        for subject in stored(id, context)? {
            let similarities = subject.similarities.swapped();
            let is_symmetric = subject.column != Technique::CoHog.name();
            subjects.push(Subject {
                best: similarities.best(),
                similarities,
                truth: subject.truth.swapped(),
                note: (!is_symmetric).then(|| {
                    "the stored scores weight regions of the query; exchanged they still do"
                        .to_owned()
                }),
                ..subject
            });
        }
        subjects.extend(computed(id, true, context)?);
        if subjects.len() == before {
            let row = format!("{}, swapped", context.data.entry(id)?.name);
            let why = context.data.why_absent(id, "stored matches or images")?;
            for technique in Technique::ALL {
                table.push(Cell::absent(&row, technique.name(), &why));
            }
        }
    }
    Ok(subjects)
}

/// One line per technique from the one direction to the other.
fn draw(figure: &mut Figure, subject: &Subject, x: f64, auc: f64) {
    let name = format!("{}{}", subject.column, super::origin_mark(subject.provenance));
    let panel = super::panel_of(figure, &subject.row, || Panel {
        x_label: "0: as released, 1: queries and references exchanged".into(),
        y_label: "AUC-PR (published)".into(),
        ..Panel::default()
    });
    match panel.curves.iter_mut().find(|curve| curve.name == name) {
        Some(curve) => curve.points.push((x, auc)),
        None => panel.curves.push(Curve { name, points: vec![(x, auc)] }),
    }
}
