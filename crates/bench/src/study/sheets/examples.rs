//! A query of every dataset and what every technique finds for it, and how many queries are matched
//! by all techniques, and by at least one: figure 3.12.

use vpr_core::{
    Result,
    metrics::bootstrap::{Z_95, wilson_interval},
};
use vpr_data::Dataset;
use vpr_report::table::{Cell, Table};
use vpr_study::{ContactSheet, Direction, Runner, Tile};

use super::{super::in_every_clone, Context, may_be_shown, opened};

pub(super) fn run(
    table: &mut Table,
    sheet: &mut ContactSheet,
    datasets: &[String],
    context: Context<'_>,
) -> Result<()> {
    let runners: Vec<&Runner> =
        context.sources.runners()?.iter().filter(|it| in_every_clone(it)).collect();
    let mut columns = Vec::new();
    for id in datasets {
        let Some(dataset) = opened(table, id, "at least one technique", context)? else { continue };
        let query = dataset.truth.len() / 2;
        let remark = dataset.name.trim_end_matches(" (generated)").to_owned();
        let mut column = vec![Tile::query(&dataset.queries, query, remark)];
        let mut all = Vec::new();
        for &runner in &runners {
            let scores = context.sources.scores(runner, &dataset, Direction::AsReleased)?;
            let best = &scores.best().reference;
            let right = dataset.truth.judge(best)?;
            push(table, &dataset, runner.column, &right)?;
            let remark = runner.column.to_owned();
            column.push(Tile::reference(&dataset.references, best[query], right[query], remark));
            all.push(right);
        }
        let by = |enough: fn(usize, usize) -> bool| -> Vec<bool> {
            let count = |query: usize| all.iter().filter(|right| right[query]).count();
            (0..dataset.truth.len()).map(|query| enough(count(query), all.len())).collect()
        };
        push(table, &dataset, "at least one technique", &by(|n, _| n > 0))?;
        push(table, &dataset, "all techniques", &by(|n, all| n == all))?;
        if may_be_shown(&dataset) {
            columns.push(column);
        }
    }
    if !columns.is_empty() {
        sheet.add_columns("the middle query, and what each technique finds", columns);
    }
    Ok(())
}

/// The share of queries that are matched.
fn push(table: &mut Table, dataset: &Dataset, column: &str, right: &[bool]) -> Result<()> {
    let share = wilson_interval(right.iter().filter(|it| **it).count(), right.len(), Z_95)?;
    let (provenance, n) = (dataset.provenance, right.len());
    let cell = Cell::new(&dataset.name, column, share.estimate, provenance, n);
    table.push(cell.within(share.low, share.high, "Wilson"));
    Ok(())
}
