//! A query and a correct reference of every dataset: figure 3.3.

use vpr_core::Result;
use vpr_report::table::{Cell, Table};
use vpr_study::{ContactSheet, Tile};

use super::{Context, may_be_shown, opened};

/// Columns of a sheet.
const ACROSS: usize = 6;

pub(super) fn run(
    table: &mut Table,
    sheet: &mut ContactSheet,
    datasets: &[String],
    context: Context<'_>,
) -> Result<()> {
    let mut columns = Vec::new();
    for id in datasets {
        let Some(dataset) = opened(table, id, "queries", context)? else { continue };
        let truth = &dataset.truth;
        for (column, n) in [
            ("queries", dataset.queries.len()),
            ("references", dataset.references.len()),
            ("queries with a correct reference", truth.n_known()),
        ] {
            let (provenance, all) = (dataset.provenance, truth.len());
            table.push(Cell::new(&dataset.name, column, n as f64, provenance, all));
        }
        // From the middle on, the first query that has a correct reference.
        let half = truth.len() / 2;
        let known = (half..truth.len()).chain(0..half).find(|&it| !truth.is_new_place(it));
        let Some(query) = known.filter(|_| may_be_shown(&dataset)) else { continue };
        let correct = (0..truth.n_references()).find(|&it| truth.is_correct(query, it));
        let Some(reference) = correct else { continue };
        let name = dataset.name.trim_end_matches(" (generated)").to_owned();
        columns.push(vec![
            Tile::query(&dataset.queries, query, name),
            Tile::reference(&dataset.references, reference, true, String::new()),
        ]);
    }
    for columns in columns.chunks(ACROSS) {
        sheet.add_columns("", columns.to_vec());
    }
    Ok(())
}
