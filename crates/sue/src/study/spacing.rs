//! Distances to the nearest neighbour in space: figure 5.9.

use vpr_core::Poses;
use vpr_report::{
    figure::{Curve, Figure, Panel},
    table::{Cell, Table},
};

use super::{
    Context,
    subject::{Subject, open},
};
use crate::{Density, DensityCompensatedSue, Error, Result, Sue};

/// Bars of a histogram.
const BARS: usize = 20;
/// Quantiles that are printed.
const QUANTILES: [(&str, f64); 5] =
    [("min", 0.0), ("25 %", 0.25), ("median", 0.5), ("75 %", 0.75), ("max", 1.0)];

pub(super) fn run(table: &mut Table, subjects: &[Subject], context: Context<'_>) -> Result<Figure> {
    let mut figure = Figure::default();
    for (opened, _) in open(table, subjects, "median", context)? {
        let corpus = &opened.corpus;
        let sides = [("queries", corpus.query_poses.as_ref()), ("references", Some(&corpus.poses))];
        for (side, poses) in sides {
            let row = format!("{}, {side}", opened.row);
            let Some(poses) = poses else {
                table.push(Cell::absent(
                    &row,
                    "median",
                    "the positions of the queries are not known",
                ));
                continue;
            };
            let spacing = match spacing(poses) {
                Ok(spacing) => spacing,
                Err(err @ Error::Core(_)) => {
                    table.push(Cell::absent(&row, "median", err.to_string()));
                    continue;
                }
                Err(err) => return Err(err),
            };
            for (column, share) in QUANTILES {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "an index"
                )]
                let rank = (share * (spacing.len() - 1) as f64).round() as usize;
                let provenance = corpus.provenance;
                table.push(Cell::new(&row, column, spacing[rank], provenance, spacing.len()));
            }
            figure.panels.push(Panel {
                title: row,
                x_label: "distance to the nearest neighbour, m".into(),
                y_label: "share".into(),
                curves: vec![Curve::new("", histogram(&spacing))],
                ..Panel::default()
            });
        }
    }
    Ok(figure)
}

/// `z` of every position, ascending.
fn spacing(poses: &Poses) -> Result<Vec<f64>> {
    let density = DensityCompensatedSue::new(Sue::corrected(), poses, 1, Density::Distinct)?;
    let mut spacing: Vec<f64> = density.spacing().collect();
    spacing.sort_unstable_by(f64::total_cmp);
    Ok(spacing)
}

/// Outline of a histogram of ascending values.
fn histogram(values: &[f64]) -> Vec<(f64, f64)> {
    let (low, high) = (values[0], values[values.len() - 1]);
    let width = if high > low { (high - low) / BARS as f64 } else { 1.0 };
    let mut points = vec![(low, 0.0)];
    for bar in 0..BARS {
        let (left, right) = (low + bar as f64 * width, low + (bar + 1) as f64 * width);
        let upto = |limit: f64| values.partition_point(|&it| it < limit);
        let end = if bar + 1 == BARS { values.len() } else { upto(right) };
        let share = (end - upto(left)) as f64 / values.len() as f64;
        points.extend([(left, share), (right, share)]);
    }
    points.push((high, 0.0));
    points
}
