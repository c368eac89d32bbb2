//! Whether predicted variances rise with a nuisance.

use vpr_core::{Provenance, metrics::spearman};
use vpr_report::{
    figure::{Curve, Figure, Panel, Scale},
    table::{Cell, Table},
};
use vpr_study::Dial;

use super::Context;
use crate::{Result, net::Learned};

/// Row of the rank correlation.
const RHO: &str = "Spearman's rho over images";

pub(super) fn run(
    table: &mut Table,
    dial: &Dial,
    learned: &[Learned],
    context: Context<'_>,
) -> Result<Figure> {
    let worlds = dial.worlds()?;
    let mut figure = Figure::default();
    for &learned in learned {
        // Every image of every level: which level, and its variance.
        let (mut levels, mut variances, mut points) = (Vec::new(), Vec::new(), Vec::new());
        for (level, (&value, world)) in dial.values.iter().zip(&worlds).enumerate() {
            let row = format!("{} {value}", dial.name);
            let encoders = [learned.key().to_owned()];
            let opened = context.corpora.open(world, &encoders)?;
            let Some(corpus) = opened.corpora.first() else {
                table.push(Cell::absent(row, learned.name(), opened.missing.join("; ")));
                continue;
            };
            let found = corpus.variance(learned)?;
            let mean = found.iter().sum::<f64>() / found.len() as f64;
            table.push(Cell::new(row, learned.name(), mean, corpus.provenance, found.len()));
            points.push((value, mean));
            levels.extend(found.iter().map(|_| level as f64));
            variances.extend(found);
        }
        if points.is_empty() {
            continue;
        }
        let n = levels.len();
        let note = format!("n = {n} images, {} levels", points.len());
        table.push(match spearman(&levels, &variances) {
            Some(rho) => Cell::new(RHO, learned.name(), rho, Provenance::Generated, n).noted(note),
            None => Cell::absent(RHO, learned.name(), "all variances or levels are equal"),
        });
        figure.panels.push(Panel {
            title: learned.name().to_owned(),
            x_label: dial.name.clone(),
            y_label: "mean variance".into(),
            x_scale: if dial.values.iter().all(|it| *it > 0.0) {
                Scale::Log
            } else {
                Scale::Linear
            },
            curves: vec![Curve::new(learned.name(), points)],
            ..Panel::default()
        });
    }
    Ok(figure)
}
