//! Whether predicted variances rise with a nuisance.

use vpr_core::{
    figure::{Curve, Figure, Panel},
    table::{Cell, Provenance, Table},
};

use super::Context;
use crate::{Result, corpus, net::Learned};

/// Row of the rank correlation.
const RHO: &str = "Spearman's rho over images";

/// One number of a recipe, turned.
#[derive(Clone, Copy)]
pub(super) struct Dial<'a> {
    pub(super) world: &'a str,
    pub(super) name: &'a str,
    pub(super) key: &'a str,
    /// From least to most of the nuisance.
    pub(super) values: &'a [f64],
}

impl Dial<'_> {
    /// The world at one value.
    fn at(&self, value: f64) -> String {
        let joint = if self.world.contains('?') { '&' } else { '?' };
        format!("{}{joint}{}={value:?}", self.world, self.key)
    }
}

pub(super) fn run(
    table: &mut Table,
    dial: Dial<'_>,
    learned: &[Learned],
    context: Context<'_>,
) -> Result<Figure> {
    let mut figure = Figure::default();
    for &learned in learned {
        // Every image of every level: which level, and its variance.
        let (mut levels, mut variances, mut points) = (Vec::new(), Vec::new(), Vec::new());
        for (level, &value) in dial.values.iter().enumerate() {
            let row = format!("{} {value}", dial.name);
            let encoders = [learned.key().to_owned()];
            let opened = corpus::open(&dial.at(value), &encoders, &context.sources)?;
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
            x_label: dial.name.to_owned(),
            y_label: "mean variance".into(),
            curves: vec![Curve { name: learned.name().to_owned(), points }],
            ..Panel::default()
        });
    }
    Ok(figure)
}

/// Spearman's rank correlation, equal values sharing the mean of their ranks; `None` if one side
/// has no order.
fn spearman(x: &[f64], y: &[f64]) -> Option<f64> {
    let (x, y) = (ranks(x), ranks(y));
    let middle = (x.len() as f64 - 1.0) / 2.0;
    let product = |a: &[f64], b: &[f64]| -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - middle) * (b - middle)).sum()
    };
    let scale = (product(&x, &x) * product(&y, &y)).sqrt();
    (scale > 0.0).then(|| product(&x, &y) / scale)
}

/// The rank of every value from zero.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let rank = |value: &f64| {
        let below = sorted.partition_point(|it| it < value);
        let upto = sorted.partition_point(|it| it <= value);
        (below + upto - 1) as f64 / 2.0
    };
    values.iter().map(rank).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_decide_and_ties_share() {
        let x = [0.0, 0.0, 1.0, 2.0];
        assert_eq!(spearman(&x, &[1.0, 1.0, 8.0, 9.0]), Some(1.0));
        assert_eq!(spearman(&x, &[9.0, 9.0, 8.0, 1.0]), Some(-1.0));
        // scipy.stats.spearmanr([0, 0, 1, 2], [3, 1, 2, 4]).
        let rho = spearman(&x, &[3.0, 1.0, 2.0, 4.0]).unwrap();
        assert!((rho - 0.632_455_532).abs() < 1e-9, "{rho}");
        assert_eq!(spearman(&x, &[5.0; 4]), None);
    }

    #[test]
    fn a_dial_names_the_world_it_turns() {
        let dial = Dial { world: "world/street?seed=3", name: "", key: "places", values: &[] };
        assert_eq!(dial.at(9.0), "world/street?seed=3&places=9.0");
    }
}
