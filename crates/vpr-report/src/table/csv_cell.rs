//! A cell as one line of CSV: every field a column.

use serde::{Deserialize, Serialize};
use vpr_core::Provenance;

use super::{Cell, Interval, Value};

/// What stands in the column `best` where a cell is.
const BEST: &str = "yes";

/// The columns, in order.
#[derive(Serialize, Deserialize)]
pub(super) struct CsvCell {
    row: String,
    column: String,
    value: Option<Value>,
    thesis: Option<Value>,
    definition: Option<String>,
    provenance: Provenance,
    n: usize,
    low: Option<f64>,
    high: Option<f64>,
    interval: Option<String>,
    note: Option<String>,
    /// A column of tables that have a best, `yes` or nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    best: Option<String>,
}

impl CsvCell {
    /// A line; with the column of what is best, if the table has it.
    pub(super) fn new(cell: &Cell, has_best: bool) -> Self {
        let interval = cell.interval.as_ref();
        Self {
            row: cell.row.clone(),
            column: cell.column.clone(),
            value: cell.value.clone(),
            thesis: cell.thesis.clone(),
            definition: cell.definition.clone(),
            provenance: cell.provenance,
            n: cell.n,
            low: interval.map(|it| it.low),
            high: interval.map(|it| it.high),
            interval: interval.map(|it| it.method.clone()),
            note: cell.note.clone(),
            best: has_best.then(|| if cell.best { BEST } else { "" }.to_owned()),
        }
    }
}

impl TryFrom<CsvCell> for Cell {
    type Error = &'static str;

    fn try_from(line: CsvCell) -> Result<Self, Self::Error> {
        let best = match line.best.as_deref() {
            None | Some("") => false,
            Some(BEST) => true,
            Some(_) => return Err("`best` is `yes` or empty"),
        };
        let interval = match (line.low, line.high, line.interval) {
            (Some(low), Some(high), Some(method)) => Some(Interval { low, high, method }),
            (None, None, None) => None,
            _ => return Err("`low`, `high` and `interval` are given together or not at all"),
        };
        Ok(Self {
            value: line.value,
            thesis: line.thesis,
            definition: line.definition,
            interval,
            note: line.note,
            best,
            ..Self::new(line.row, line.column, 0.0, line.provenance, line.n)
        })
    }
}
