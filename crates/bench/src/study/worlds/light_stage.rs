//! Whether light that splits a scene costs more matching score than light that changes it evenly
//! (thesis, 3.3.8).

use std::path::Path;

use vpr_core::{Result, metrics::spearman};
use vpr_report::{
    figure::{Curve, Figure, Panel, Shape},
    table::{Cell, Table},
};
use vpr_study::Direction;
use vpr_vision::image;

use super::{super::Context, techniques};

/// Blocks per side in which brightness is compared.
const BLOCKS: usize = 8;
/// A light that moves block brightness less than this, in natural logarithms, is the key frame's own.
const OWN_LIGHT: f64 = 0.02;

/// How a light changes brightness against the key frame's, in natural logarithms over blocks.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Change {
    /// Standard deviation: how far parts of the scene move apart.
    split: f64,
    /// Size of the mean: how far the whole scene moves.
    even: f64,
}

pub(super) fn run(
    table: &mut Table,
    figure: &mut Figure,
    id: &str,
    context: Context<'_>,
) -> Result<()> {
    let Some(dataset) = context.images(id)? else { return Ok(()) };
    let key = brightness(&dataset.references[0])?;
    let same = &dataset.queries[..dataset.queries.len() / 2];
    let changes: Vec<Change> =
        same.iter().map(|path| Ok(change(&key, &brightness(path)?))).collect::<Result<_>>()?;
    let others: Vec<usize> = (0..changes.len())
        .filter(|&light| changes[light].split.max(changes[light].even) > OWN_LIGHT)
        .collect();
    let mut panel = Panel {
        title: "light-stage: score over splitting".into(),
        x_label: "splitting of brightness (σ of log)".into(),
        y_label: "score with the key frame".into(),
        ..Panel::default()
    };
    for runner in techniques(context)? {
        let column = runner.column;
        let scores = context.sources.scores(runner, &dataset, Direction::Swapped)?;
        let scores = scores.similarities().view().row(0).to_vec();
        let pairs: Vec<(Change, f64)> =
            others.iter().map(|&light| (changes[light], scores[light])).collect();
        let n = pairs.len();
        let cell = |row: &str, value: f64| Cell::new(row, column, value, dataset.provenance, n);
        let by_split = rank_correlation(&pairs, |change| change.split);
        let by_even = rank_correlation(&pairs, |change| change.even);
        let (little, much) = halves(&pairs);
        table.push(cell("light-stage: rank correlation of score and splitting", by_split));
        table.push(cell("light-stage: rank correlation of score and even change", by_even));
        table.push(cell("light-stage: mean score, half of the lights that splits least", little));
        table.push(cell("light-stage: mean score, half of the lights that splits most", much));
        let holds = by_split < 0.0 && by_split < by_even && much < little;
        let text = if holds { "yes" } else { "no" };
        let row = "light-stage: splitting costs more than even change (thesis 3.3.8)";
        let verdict = Cell::new(row, column, text, dataset.provenance, n);
        table.push(verdict.noted("yes: the correlation with splitting is negative and below that with even change, and the lights that split most score lower"));
        let points = pairs.iter().map(|(change, score)| (change.split, *score)).collect();
        panel.curves.push(Curve::new(column, points).shaped(Shape::Points));
    }
    figure.panels.push(panel);
    Ok(())
}

/// Mean grey level of every block, plus one so that black has a logarithm.
fn brightness(path: &Path) -> Result<Vec<f64>> {
    let gray = image::gray(&image::decode(path)?);
    let (width, height) = (gray.width(), gray.height());
    let mut sums = vec![(0.0, 0.0); BLOCKS * BLOCKS];
    for (index, &level) in gray.as_slice().iter().enumerate() {
        let (row, column) = (index / width, index % width);
        let block = row * BLOCKS / height * BLOCKS + column * BLOCKS / width;
        sums[block].0 += f64::from(level);
        sums[block].1 += 1.0;
    }
    Ok(sums.into_iter().map(|(sum, n): (f64, f64)| sum / n.max(1.0) + 1.0).collect())
}

fn change(key: &[f64], light: &[f64]) -> Change {
    let logs: Vec<f64> = key.iter().zip(light).map(|(key, light)| (light / key).ln()).collect();
    let n = logs.len() as f64;
    let mean = logs.iter().sum::<f64>() / n;
    let variance = logs.iter().map(|log| (log - mean).powi(2)).sum::<f64>() / n;
    Change { split: variance.sqrt(), even: mean.abs() }
}

/// Spearman's rank correlation of the score with a property of the light; NaN-free: 0 where one of
/// them never changes.
fn rank_correlation(pairs: &[(Change, f64)], property: impl Fn(&Change) -> f64) -> f64 {
    let (x, y): (Vec<f64>, Vec<f64>) =
        pairs.iter().map(|(change, score)| (property(change), *score)).unzip();
    spearman(&x, &y).unwrap_or(0.0)
}

/// Mean score of the half of the lights that splits least, and of the other; a middle one counts
/// in neither.
fn halves(pairs: &[(Change, f64)]) -> (f64, f64) {
    let mut sorted = pairs.to_vec();
    sorted.sort_by(|a, b| a.0.split.total_cmp(&b.0.split));
    let half = sorted.len() / 2;
    let mean = |part: &[(Change, f64)]| {
        part.iter().map(|(_, score)| score).sum::<f64>() / part.len().max(1) as f64
    };
    (mean(&sorted[..half]), mean(&sorted[sorted.len() - half..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn even_light_moves_and_split_light_parts() {
        let key = [10.0, 20.0, 40.0, 80.0];
        let doubled = key.map(|level| level * 2.0);
        let even = change(&key, &doubled);
        assert!((even.even - 2_f64.ln()).abs() < 1e-12 && even.split < 1e-12);
        let split = change(&key, &[20.0, 10.0, 80.0, 40.0]);
        assert!(split.even < 1e-12 && (split.split - 2_f64.ln()).abs() < 1e-12);
    }

    #[test]
    fn correlation_follows_ranks_and_halves_follow_splitting() {
        let pair = |split: f64, score: f64| (Change { split, even: 0.0 }, score);
        let pairs = [pair(0.1, 9.0), pair(0.2, 4.0), pair(0.9, 1.0), pair(0.3, 3.0)];
        assert!((rank_correlation(&pairs, |it| it.split) + 1.0).abs() < 1e-12);
        assert_eq!(halves(&pairs), (6.5, 2.0));
    }
}
