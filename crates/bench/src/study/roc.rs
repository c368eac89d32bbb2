//! ROC curves and their areas, where some queries are new places: figure 3.13 and table 3.7.

use vpr_core::{Definition, Error, Result, metrics};
use vpr_report::{
    figure::{Curve, Figure, Panel},
    table::Table,
};

use vpr_study::Subject;

use super::Context;

/// False-positive rates at which the curves are sampled.
const RATES: [f64; 5] = [0.05, 0.1, 0.2, 0.4, 0.6];

pub(super) fn run(
    table: &mut Table,
    datasets: &[String],
    curves: bool,
    context: Context<'_>,
) -> Result<Option<Figure>> {
    let mut figure = Figure::default();
    for subject in context.sources.subjects(table, datasets)? {
        let area =
            |definition| metrics::auc_roc(confidence(&subject), &positive(&subject, definition)?);
        subject.push_both(table, &subject.row, subject.column, area)?;
        if !curves {
            continue;
        }
        let definition = Definition::Corrected;
        let curve = match metrics::roc_curve(confidence(&subject), &positive(&subject, definition)?)
        {
            Ok(curve) => curve,
            Err(Error::Undefined { .. }) => continue,
            Err(err) => return Err(err),
        };
        let points: Vec<(f64, f64)> = curve.fpr.into_iter().zip(curve.tpr).collect();
        for rate in RATES {
            let column = format!("TPR at FPR={rate}");
            let reached = Ok(highest(&points, rate));
            table.push(subject.value_cell(&subject.label(), &column, definition, reached)?);
        }
        let curve = Curve::new(subject.column, points).of(subject.provenance);
        super::panel_of(&mut figure, &subject.row, panel).curves.push(curve);
    }
    Ok(curves.then_some(figure))
}

fn confidence(subject: &Subject) -> &[f64] {
    &subject.best().confidence
}

fn positive(subject: &Subject, definition: Definition) -> Result<Vec<bool>> {
    metrics::roc_positives(definition, &subject.best().reference, &subject.truth)
}

/// The highest true-positive rate at a false-positive rate of at most `rate`.
fn highest(points: &[(f64, f64)], rate: f64) -> f64 {
    let within = points.iter().filter(|(fpr, _)| *fpr <= rate + 1e-12);
    within.map(|&(_, tpr)| tpr).fold(0.0, f64::max)
}

fn panel() -> Panel {
    Panel {
        x_label: "false-positive rate".into(),
        y_label: "true-positive rate".into(),
        ..Panel::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_is_read_off_below_not_beyond_it() {
        let points = [(0.0, 0.0), (0.1, 0.4), (0.2, 0.7), (1.0, 1.0)];
        assert!((highest(&points, 0.15) - 0.4).abs() < 1e-12);
        assert!((highest(&points, 0.2) - 0.7).abs() < 1e-12);
    }
}
