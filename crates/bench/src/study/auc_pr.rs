//! AUC-PR of techniques on datasets: table 3.5.

use vpr_core::{Definition, Error, Result, figure::Figure, table::Table};

use super::{
    Context,
    subject::{subjects, value_cell},
};

pub(super) fn run(
    table: &mut Table,
    datasets: &[String],
    context: Context<'_>,
) -> Result<Option<Figure>> {
    for subject in subjects(table, datasets, context)? {
        let evaluation = subject.evaluation()?;
        for definition in [Definition::Published, Definition::Corrected] {
            let value = evaluation.auc_pr(evaluation.positives(definition));
            let cell = value_cell(&subject, &subject.row, subject.column, definition, value)?;
            let cell = match evaluation.auc_pr_interval(definition, context.seed) {
                Ok(interval) => cell.within(interval.low, interval.high, "bootstrap over queries"),
                Err(Error::Undefined { .. }) => cell,
                Err(err) => return Err(err),
            };
            table.push(cell);
        }
    }
    Ok(None)
}
