//! AUC-PR of techniques on datasets: table 3.5.

use vpr_core::{Definition, Error, Result, metrics::effective};
use vpr_report::{figure::Figure, table::Table};

use super::Context;

pub(super) fn run(
    table: &mut Table,
    datasets: &[String],
    context: Context<'_>,
) -> Result<Option<Figure>> {
    for subject in context.sources.subjects(table, datasets)? {
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
    Ok(None)
}
