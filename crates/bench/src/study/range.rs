//! AUC-PR over the accepted range of frames: figure 3.17.

use vpr_core::{Definition, Error, GroundTruth, Result};
use vpr_report::{
    figure::{Curve, Figure, Panel},
    table::Table,
};

use super::Context;

pub(super) fn run(
    table: &mut Table,
    datasets: &[String],
    tolerances: &[usize],
    context: Context<'_>,
) -> Result<Option<Figure>> {
    let mut figure = Figure::default();
    for subject in context.sources.subjects(table, datasets)? {
        let mut points = Vec::new();
        for &tolerance in tolerances {
            let similarities = subject.scores.similarities();
            let (n_queries, n_references) = (similarities.n_queries(), similarities.n_references());
            let truth = GroundTruth::within_frames(n_queries, n_references, tolerance);
            let subject = subject.under(&format!("{} ±{tolerance}", subject.row), truth)?;
            let evaluation = subject.evaluation()?;
            subject.push_both(table, &subject.row, subject.column, |it| evaluation.auc_pr(it))?;
            match evaluation.auc_pr(Definition::Published) {
                Ok(published) => points.push((tolerance as f64, published)),
                Err(Error::Undefined { .. }) => {}
                Err(err) => return Err(err),
            }
        }
        let curve = Curve::new(subject.column, points).of(subject.provenance);
        super::panel_of(&mut figure, &subject.row, panel).curves.push(curve);
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
