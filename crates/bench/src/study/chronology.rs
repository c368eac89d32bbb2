//! Precision at 100 % recall in the order in which techniques were published: figure 3.2.

use serde::Deserialize;
use vpr_core::{
    Result,
    metrics::bootstrap::{Z_95, wilson_interval},
};
use vpr_report::{
    figure::{Curve, Figure, Panel},
    table::Table,
};
use vpr_study::Technique;

use super::Context;

/// When a technique was published.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Published {
    /// The technique.
    pub technique: Technique,
    /// The year of the paper.
    pub year: u16,
}

/// Techniques that a curve needs.
const LEAST: usize = 3;

/// At 100 % recall every match is accepted: precision is then recall@1.
pub(super) fn run(
    table: &mut Table,
    datasets: &[String],
    order: &[Published],
    context: Context<'_>,
) -> Result<Option<Figure>> {
    let mut figure = Figure::default();
    let subjects = context.sources.subjects(table, datasets)?;
    for (place, Published { technique, year }) in order.iter().enumerate() {
        let of_it = subjects.iter().filter(|it| it.column == technique.name());
        for subject in of_it {
            let (n, recall) = (subject.judged.len(), subject.recall_at(1)?);
            let n_right = subject.judged.correct().iter().filter(|&&it| it).count();
            let interval = wilson_interval(n_right, n, Z_95)?;
            let column = format!("{} ({year})", technique.name());
            let cell = subject.cell(&subject.row, &column, recall);
            table.push(cell.within(interval.low, interval.high, "Wilson"));
            let panel = super::panel_of(&mut figure, &subject.row, || panel(order));
            let curve = panel.curves.iter().position(|it| it.origin == Some(subject.provenance));
            let curve = curve.unwrap_or_else(|| {
                panel.curves.push(Curve::new("", Vec::new()).of(subject.provenance));
                panel.curves.len() - 1
            });
            panel.curves[curve].points.push((place as f64, recall));
            panel.curves[curve].band.push((interval.low, interval.high));
        }
    }
    // A line through two techniques is no trend.
    for panel in &mut figure.panels {
        panel.curves.retain(|it| it.points.len() >= LEAST);
    }
    figure.panels.retain(|it| !it.curves.is_empty());
    Ok(Some(figure))
}

/// The horizontal axis has a place per technique; a year stands at the first of its techniques.
fn panel(order: &[Published]) -> Panel {
    let mut ticks: Vec<(f64, String)> = Vec::new();
    for (place, it) in order.iter().enumerate() {
        let year = it.year.to_string();
        if ticks.last().is_none_or(|last| last.1 != year) {
            ticks.push((place as f64, year));
        }
    }
    Panel {
        x_label: "techniques by year, as in the table".into(),
        y_label: "P@100R".into(),
        x_ticks: ticks,
        ..Panel::default()
    }
}
