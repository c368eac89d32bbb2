//! Distances between consecutive true positives along a traverse: figure 3.14.

use vpr_core::{Definition, Result, metrics};
use vpr_report::{
    figure::{Curve, Figure, Panel},
    table::Table,
};

use vpr_study::Subject;

use super::Context;

/// Distances listed one by one; longer ones are counted together.
const LISTED: usize = 8;

pub(super) fn run(
    table: &mut Table,
    datasets: &[String],
    context: Context<'_>,
) -> Result<Option<Figure>> {
    let mut figure = Figure::default();
    for subject in context.sources.subjects(table, datasets)? {
        for definition in [Definition::Published, Definition::Corrected] {
            let counts = metrics::true_positive_spacing(definition, subject.judged.correct())?;
            list(table, &subject, definition, &counts);
            if definition == Definition::Corrected {
                let points =
                    counts.iter().enumerate().skip(1).map(|(gap, &n)| (gap as f64, n as f64));
                let curve = Curve::new(subject.column, points.collect()).of(subject.provenance);
                super::panel_of(&mut figure, &subject.row, panel).curves.push(curve);
            }
        }
    }
    Ok(Some(figure))
}

fn panel() -> Panel {
    Panel {
        x_label: "distance to the true positive before, frames".into(),
        y_label: "true positives".into(),
        ..Panel::default()
    }
}

/// How often each distance occurs; `counts[distance]`.
fn list(table: &mut Table, subject: &Subject, definition: Definition, counts: &[usize]) {
    let row = subject.label();
    let count = |gap: usize| counts.get(gap).copied().unwrap_or(0) as f64;
    for gap in 1..=LISTED {
        table.push(subject.cell(&row, &gap.to_string(), count(gap)).defined(definition));
    }
    let beyond: f64 = (LISTED + 1..counts.len()).map(count).sum();
    let longest = counts.iter().rposition(|&n| n > 0).unwrap_or(0) as f64;
    table.push(subject.cell(&row, &format!("over {LISTED}"), beyond).defined(definition));
    table.push(subject.cell(&row, "longest", longest).defined(definition));
}
