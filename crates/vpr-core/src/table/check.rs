//! Comparing a table with its committed page and with expected numbers.

use std::fmt;

use super::{Cell, Provenance, Table, Value};
use crate::experiment::Expectation;

/// How far a value may be from the committed page: what a different processor may round.
const PAGE_TOLERANCE: f64 = 1e-6;

/// One difference between what was computed and what should have been.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    row: String,
    column: String,
    definition: Option<String>,
    provenance: Provenance,
    against: &'static str,
    expected: String,
    actual: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { row, column, provenance, against, expected, actual, .. } = self;
        let definition = self.definition.as_deref().map_or(String::new(), |it| format!(", {it}"));
        write!(
            f,
            "{row} / {column} ({provenance}{definition}): {against} {expected}, computed {actual}"
        )
    }
}

/// Compares the cells that could be computed with the committed page (none if it does not exist
/// yet) and with the expected numbers; gives the differences and how many cells were compared.
///
/// Cells of the page whose data is not at hand now are left alone, and so are timings.
#[must_use]
pub fn check(
    table: &Table,
    committed: Option<&[Cell]>,
    expectations: &[Expectation],
) -> (Vec<Finding>, usize) {
    let computed: Vec<&Cell> =
        table.cells.iter().filter(|cell| cell.value.is_some() && !cell.volatile).collect();
    let mut findings = Vec::new();
    let mut n_compared = 0;
    if let Some(committed) = committed {
        for cell in &computed {
            n_compared += 1;
            match committed.iter().find(|it| it.key() == cell.key()).map(|it| it.value.as_ref()) {
                Some(Some(value)) if agree(cell.value.as_ref(), value, PAGE_TOLERANCE) => {}
                Some(value) => findings.push(finding(cell, "the committed page says", value)),
                None => findings.push(finding(cell, "the committed page has", None)),
            }
        }
    }
    for expectation in expectations {
        for (row, column, value) in expectation.grid.entries() {
            let same = computed.iter().find(|cell| {
                cell.key()
                    == (row, column, expectation.definition.as_deref(), expectation.provenance)
            });
            if let Some(cell) = same {
                n_compared += 1;
                if !agree(cell.value.as_ref(), value, expectation.tolerance) {
                    findings.push(finding(cell, "expected", Some(value)));
                }
            }
        }
    }
    (findings, n_compared)
}

fn agree(actual: Option<&Value>, expected: &Value, tolerance: f64) -> bool {
    match (actual, expected) {
        (Some(Value::Number(actual)), Value::Number(expected)) => {
            (actual - expected).abs() <= tolerance
        }
        (Some(actual), expected) => actual == expected,
        (None, _) => false,
    }
}

fn finding(cell: &Cell, against: &'static str, expected: Option<&Value>) -> Finding {
    let text = |value: Option<&Value>| match value {
        Some(Value::Number(value)) => value.to_string(),
        Some(Value::Text(text)) => text.clone(),
        None => "nothing".to_owned(),
    };
    Finding {
        row: cell.row.clone(),
        column: cell.column.clone(),
        definition: cell.definition.clone(),
        provenance: cell.provenance,
        against,
        expected: text(expected),
        actual: text(cell.value.as_ref()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::Grid;

    fn table(value: f64) -> Table {
        let mut table = Table::new("table-0", "t");
        table.push(Cell::new("Corridor", "HOG", value, Provenance::Published, 111));
        table
    }

    fn expectation(value: f64) -> Expectation {
        Expectation {
            definition: None,
            provenance: Provenance::Published,
            tolerance: 1e-6,
            grid: Grid::single("Corridor", "HOG", value),
        }
    }

    #[test]
    fn the_same_number_passes_and_is_counted() {
        let table = table(0.5);
        assert_eq!(check(&table, Some(&table.cells), &[expectation(0.5)]), (vec![], 2));
    }

    #[test]
    fn a_number_that_moved_is_found_on_both_sides() {
        let (findings, _) = check(&table(0.5001), Some(&table(0.5).cells), &[expectation(0.5)]);
        let texts: Vec<String> = findings.iter().map(Finding::to_string).collect();
        assert_eq!(
            texts,
            [
                "Corridor / HOG (published): the committed page says 0.5, computed 0.5001",
                "Corridor / HOG (published): expected 0.5, computed 0.5001",
            ]
        );
    }

    #[test]
    fn a_cell_missing_from_the_page_is_found() {
        assert_eq!(check(&table(0.5), Some(&[]), &[]).0.len(), 1);
    }

    #[test]
    fn data_not_at_hand_is_left_alone() {
        let empty = Table::new("table-0", "t");
        assert_eq!(check(&empty, Some(&table(0.5).cells), &[expectation(0.7)]), (vec![], 0));
    }
}
