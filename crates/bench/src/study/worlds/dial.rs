//! Nuisance dials: recall@1 as numbers of a recipe rise.

use vpr_core::{Provenance, Result, metrics::bootstrap::Interval};
use vpr_report::{
    figure::{Curve, Figure, Panel},
    table::{Cell, Table},
};

use vpr_study::Dial;

use super::{super::Context, recall, techniques};

pub(super) fn run(
    table: &mut Table,
    figure: &mut Figure,
    dial: &Dial,
    context: Context<'_>,
) -> Result<()> {
    let mut panel = Panel {
        title: dial.name.clone(),
        x_label: dial.name.clone(),
        y_label: "recall@1".into(),
        ..Panel::default()
    };
    let worlds = dial.worlds()?;
    for runner in techniques(context)? {
        let mut intervals = Vec::new();
        for (value, world) in dial.values.iter().zip(&worlds) {
            let row = format!("{} {value}", dial.name);
            intervals.extend(recall(table, &row, world, runner, context)?);
        }
        let points = dial.values.iter().zip(&intervals).map(|(&x, it)| (x, it.estimate)).collect();
        let band = intervals.iter().map(|it| (it.low, it.high)).collect();
        panel.curves.push(Curve::new(runner.column, points).within(band));
        let row = format!("{}: how recall@1 moves", dial.name);
        let text = trend(&dial.values, &intervals);
        let n = intervals.len();
        let note = "judged by 95 % intervals: a rise is a lower end above an earlier upper end";
        let cell = Cell::new(row, runner.column, text.as_str(), Provenance::Generated, n);
        table.push(cell.noted(note));
    }
    figure.panels.push(panel);
    Ok(())
}

/// Whether recall falls, stays or rises, as far as the intervals tell.
fn trend(values: &[f64], intervals: &[Interval]) -> String {
    for (later, high) in intervals.iter().enumerate() {
        if let Some(earlier) = intervals[..later].iter().position(|it| it.high < high.low) {
            return format!("rises from {} to {}", values[earlier], values[later]);
        }
    }
    match (intervals.first(), intervals.last()) {
        (Some(first), Some(last)) if last.high < first.low => "falls".to_owned(),
        _ => "does not move beyond the intervals".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn intervals(ends: &[(f64, f64)]) -> Vec<Interval> {
        let interval = |&(low, high): &(f64, f64)| Interval {
            estimate: 0.5 * (low + high),
            low,
            high,
            n_undefined: 0,
        };
        ends.iter().map(interval).collect()
    }

    #[test]
    fn a_trend_is_only_told_beyond_the_intervals() {
        let values = [0.0, 0.5, 1.0];
        let of = |ends: &[(f64, f64)]| trend(&values, &intervals(ends));
        assert_eq!(of(&[(0.8, 1.0), (0.7, 0.9), (0.1, 0.3)]), "falls");
        assert_eq!(
            of(&[(0.5, 0.7), (0.6, 0.8), (0.45, 0.65)]),
            "does not move beyond the intervals"
        );
        assert_eq!(of(&[(0.5, 0.7), (0.1, 0.2), (0.3, 0.4)]), "rises from 0.5 to 1");
    }
}
