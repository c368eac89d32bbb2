//! RecallRate@N: figure 3.11.

use vpr_core::{
    Result,
    metrics::bootstrap::{Z_95, wilson_interval},
};
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
        let (mut points, mut band) = (Vec::new(), Vec::new());
        for n in 1..=MAX_RANK {
            let recall = subject.recall_at(n)?;
            table.push(subject.cell(&subject.label(), &format!("R@{n}"), recall));
            points.push((n as f64, recall));
            band.push(interval(recall, subject.judged.len())?);
        }
        let curve = Curve::new(subject.column, points).of(subject.provenance).within(band);
        super::panel_of(&mut figure, &subject.row, panel).curves.push(curve);
    }
    Ok(Some(figure))
}

/// Wilson's interval of a share of `n` queries.
fn interval(share: f64, n: usize) -> Result<(f64, f64)> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
    let n_hits = (share * n as f64).round() as usize;
    let interval = wilson_interval(n_hits.min(n), n, Z_95)?;
    Ok((interval.low, interval.high))
}

fn panel() -> Panel {
    Panel { x_label: "N".into(), y_label: "RecallRate@N".into(), ..Panel::default() }
}
