//! AUC-PR of techniques on datasets: table 3.5.

use vpr_core::{Definition, Error, Provenance, Result, metrics::effective};
use vpr_report::{figure::Figure, table::Table};
use vpr_study::{Runner, Subject};

use super::{Context, best, in_every_clone};

pub(super) fn run(
    table: &mut Table,
    datasets: &[String],
    context: Context<'_>,
) -> Result<Option<Figure>> {
    let subjects = context.sources.subjects(table, datasets)?;
    for subject in &subjects {
        let evaluation = subject.evaluation()?;
        for definition in [Definition::Published, Definition::Corrected] {
            let value = evaluation.auc_pr(definition);
            let cell = subject.value_cell(&subject.row, subject.column, definition, value)?;
            let cell = match evaluation.auc_pr_interval(definition) {
                Ok(interval) => cell.within(interval.low, interval.high, effective::METHOD),
                Err(Error::Undefined { .. }) => cell,
                Err(err) => return Err(err),
            };
            table.push(cell);
        }
    }
    let runners = context.sources.runners()?;
    for group in subjects.chunk_by(|a, b| a.row == b.row && a.provenance == b.provenance) {
        // A generated row is the same with all weights and without: only who is in every clone contends.
        let contends = |it: &&Subject| {
            let is = |runner: &Runner| runner.column == it.column && in_every_clone(runner);
            it.provenance != Provenance::Generated || runners.iter().any(is)
        };
        let group: Vec<Subject> = group.iter().filter(contends).cloned().collect();
        if let Some(Subject { row, .. }) = group.first() {
            best::mark_auc_pr(table, row, &group, context.seed)?;
        }
    }
    Ok(None)
}
