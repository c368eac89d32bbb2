//! Which technique is best on each dataset, and whom it cannot be told from.

use vpr_core::{
    Provenance, Result,
    metrics::{McNemar, bootstrap::Resampling},
};
use vpr_report::table::{Cell, Table, Value};
use vpr_study::{Runner, Subject};

use super::{Context, in_every_clone};
use crate::comparison::{Comparison, Found, Metric, Protocol};

const METRICS: [(Metric, &str); 2] = [(Metric::RecallAt(1), "R@1"), (Metric::AucPr, "AUC-PR")];

pub(super) fn run(table: &mut Table, datasets: &[String], context: Context<'_>) -> Result<()> {
    let mut absent = Table::new("winners", "datasets that are not at hand");
    let subjects = context.sources.subjects(&mut absent, datasets)?;
    // Once for a dataset, not for each of its techniques.
    for cells in absent.cells.chunk_by(|a, b| a.row == b.row) {
        let why = cells[0].note.as_deref().unwrap_or_default();
        table.push(Cell::absent(&cells[0].row, "best, R@1", why));
    }
    let runners = context.sources.runners()?;
    let takes_part = |it: &Subject| {
        let is = |runner: &Runner| runner.column == it.column && in_every_clone(runner);
        it.provenance != Provenance::Generated || runners.iter().any(is)
    };
    let subjects: Vec<Subject> = subjects.into_iter().filter(takes_part).collect();
    for group in subjects.chunk_by(|a, b| a.row == b.row && a.provenance == b.provenance) {
        if group.len() > 1 {
            rank(table, group, context.seed)?;
        }
    }
    Ok(())
}

fn rank(table: &mut Table, group: &[Subject], seed: u64) -> Result<()> {
    let protocol = Protocol {
        metrics: METRICS.iter().map(|it| it.0).collect(),
        test: McNemar::MidP,
        level: 0.05,
        power: 0.8,
        resampling: Resampling { seed, ..Resampling::default() },
    };
    let rankings: Result<Vec<_>> =
        group.iter().map(|it| it.scores.similarities().ranked(1)).collect();
    let rankings = rankings?;
    let found: Vec<Found<'_>> = group
        .iter()
        .zip(&rankings)
        .map(|(it, ranking)| Found { ranking, confidence: &it.best().confidence })
        .collect();
    let Subject { row, provenance, truth, .. } = &group[0];
    let comparison = Comparison::new(&found, truth, protocol)?;
    for (metric, name) in METRICS {
        let best = comparison.best(metric)?;
        let cell = |column: &str, value: Value| {
            Cell::new(row, format!("{column}, {name}"), value, *provenance, truth.len())
        };
        table.push(cell("best", group[best.method].column.into()));
        let others: Vec<&str> = best.not_told_apart.iter().map(|&it| group[it].column).collect();
        let count = cell("not told apart from it", (others.len() as f64).into());
        table.push(if others.is_empty() { count } else { count.noted(others.join(", ")) });
    }
    Ok(())
}
