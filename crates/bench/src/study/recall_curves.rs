//! RecallRate@N: figure 3.11.

use vpr_core::{
    Result,
    figure::{Curve, Figure, Panel},
    table::Table,
};

use super::{Context, subject::subjects};
use crate::evaluate::MAX_RANK;

pub(super) fn run(
    table: &mut Table,
    datasets: &[String],
    context: Context<'_>,
) -> Result<Option<Figure>> {
    let mut figure = Figure::default();
    for subject in subjects(table, datasets, context)? {
        let evaluation = subject.evaluation()?;
        let mut points = Vec::new();
        for n in 1..=MAX_RANK {
            let recall = evaluation.recall_at(n)?;
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
