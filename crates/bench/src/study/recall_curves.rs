//! RecallRate@N: figure 3.11.

use vpr_core::Result;
use vpr_report::{
    figure::{Curve, Figure, Panel},
    table::Table,
};

use vpr_study::MAX_RANK;

use super::Context;

pub(super) fn run(
    table: &mut Table,
    datasets: &[String],
    context: Context<'_>,
) -> Result<Option<Figure>> {
    let mut figure = Figure::default();
    for subject in context.sources.subjects(table, datasets)? {
        let mut points = Vec::new();
        for n in 1..=MAX_RANK {
            let recall = subject.recall_at(n)?;
            table.push(subject.cell(&subject.label(), &format!("R@{n}"), recall));
            points.push((n as f64, recall));
        }
        let name = format!("{}{}", subject.column, super::origin_mark(subject.provenance));
        super::panel_of(&mut figure, &subject.row, panel).curves.push(Curve { name, points });
    }
    Ok(Some(figure))
}

fn panel() -> Panel {
    Panel { x_label: "N".into(), y_label: "RecallRate@N".into(), ..Panel::default() }
}
