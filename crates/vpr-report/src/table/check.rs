//! Comparing a table with its committed page and with expected numbers.

use std::fmt;

use vpr_core::Provenance;

use super::{Cell, Interval, Table, Value};
use crate::experiment::Expectation;

/// How far a value may be from the committed page: what a different processor may round.
const PAGE_TOLERANCE: f64 = 1e-6;

/// One difference between what was computed and what should have been.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding(String);

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl Finding {
    /// A difference that is not about one cell.
    #[must_use]
    pub fn new(text: impl Into<String>) -> Self {
        Self(text.into())
    }

    fn about(cell: &Cell, what: impl fmt::Display) -> Self {
        let Cell { row, column, provenance, .. } = cell;
        let definition = cell.definition.as_deref().map_or(String::new(), |it| format!(", {it}"));
        Self(format!("{row} / {column} ({provenance}{definition}): {what}"))
    }
}

/// What a comparison gave.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Checked {
    /// All differences.
    pub findings: Vec<Finding>,
    /// How many cells and expectations were compared.
    pub n_compared: usize,
    /// Cells of the page that were not computed, because their data is not at hand.
    pub n_not_at_hand: usize,
}

/// Compares a table with the committed page and with the expected numbers.
///
/// Every computed cell must stand on the page with the same value, number of items, interval,
/// thesis value and note, best or not; timings are left alone. Every `generated` cell of the page must have been
/// computed, since it needs no data, but those whose row or column names one of `without`, methods
/// whose weights are not at hand; others may be missing where something is absent. Every
/// expectation must be about a cell that was computed or stands on the page.
#[must_use]
pub fn check(
    table: &Table,
    committed: &[Cell],
    expectations: &[Expectation],
    without: &[&str],
) -> Checked {
    let lacks_weights = |cell: &Cell| {
        without.iter().any(|name| cell.row.contains(name) || cell.column.contains(name))
    };
    let computed: Vec<&Cell> = table.cells.iter().filter(|cell| is_checked(cell)).collect();
    let mut checked = Checked::default();
    for cell in &computed {
        if cell.value.is_none() && lacks_weights(cell) {
            checked.n_not_at_hand += 1;
            continue;
        }
        checked.n_compared += 1;
        match committed.iter().find(|it| it.key() == cell.key()) {
            Some(page) => checked.findings.extend(differences(cell, page)),
            None => checked.findings.push(Finding::about(cell, "is not on the committed page")),
        }
    }
    let is_something_absent = table.cells.iter().any(|cell| cell.provenance == Provenance::Absent);
    for cell in committed.iter().filter(|cell| is_checked(cell)) {
        if computed.iter().any(|it| it.key() == cell.key()) {
            continue;
        }
        let needs_data = cell.provenance != Provenance::Generated && is_something_absent;
        if needs_data || lacks_weights(cell) {
            checked.n_not_at_hand += 1;
        } else {
            checked.findings.push(Finding::about(cell, "is on the page and was not computed"));
        }
    }
    for expectation in expectations {
        expected(&mut checked, expectation, &computed, committed);
    }
    checked
}

/// Whether a cell has a value, or says why it has none although the data is at hand, and is the
/// same in every run.
fn is_checked(cell: &Cell) -> bool {
    cell.provenance != Provenance::Absent && !cell.volatile
}

fn expected(
    checked: &mut Checked,
    expectation: &Expectation,
    computed: &[&Cell],
    committed: &[Cell],
) {
    let definition = expectation.definition.as_deref();
    for (row, column, value) in expectation.grid.entries() {
        let key = (row, column, definition, expectation.provenance);
        if let Some(cell) = computed.iter().find(|cell| cell.key() == key) {
            checked.n_compared += 1;
            if !agree(cell.value.as_ref(), Some(value), expectation.tolerance) {
                let (expected, actual) = (text(Some(value)), text(cell.value.as_ref()));
                let what = format!("expected {expected}, computed {actual}");
                checked.findings.push(Finding::about(cell, what));
            }
        } else if !committed.iter().any(|cell| cell.key() == key) {
            let what = Cell::new(row, column, 0.0, expectation.provenance, 0);
            let what = definition.map_or(what.clone(), |definition| what.defined(definition));
            let why = "expected, but neither computed nor on the page";
            checked.findings.push(Finding::about(&what, why));
        }
    }
}

/// Where a computed cell and that of the page differ.
fn differences(cell: &Cell, page: &Cell) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut differ = |what: &str, is_same: bool, page: String, computed: String| {
        if !is_same {
            let text = format!("{what}: the committed page says {page}, computed {computed}");
            findings.push(Finding::about(cell, text.trim_start_matches("value: ")));
        }
    };
    let values = (page.value.as_ref(), cell.value.as_ref());
    let is_same = agree(values.1, values.0, PAGE_TOLERANCE);
    differ("value", is_same, text(values.0), text(values.1));
    differ("n", page.n == cell.n, page.n.to_string(), cell.n.to_string());
    let intervals = (page.interval.as_ref(), cell.interval.as_ref());
    let is_same = match intervals {
        (Some(page), Some(cell)) => {
            near(page.low, cell.low) && near(page.high, cell.high) && page.method == cell.method
        }
        (page, cell) => page == cell,
    };
    differ("interval", is_same, ends(intervals.0), ends(intervals.1));
    let is_same = page.thesis == cell.thesis;
    differ("thesis", is_same, text(page.thesis.as_ref()), text(cell.thesis.as_ref()));
    let note = |cell: &Cell| format!("`{}`", cell.note.as_deref().unwrap_or_default());
    differ("note", page.note == cell.note, note(page), note(cell));
    let is_best = |cell: &Cell| if cell.best { "yes" } else { "no" }.to_owned();
    differ("best of its row", page.best == cell.best, is_best(page), is_best(cell));
    findings
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() <= PAGE_TOLERANCE
}

fn agree(actual: Option<&Value>, expected: Option<&Value>, tolerance: f64) -> bool {
    match (actual, expected) {
        (Some(Value::Number(actual)), Some(Value::Number(expected))) => {
            (actual - expected).abs() <= tolerance
        }
        (actual, expected) => actual == expected,
    }
}

fn text(value: Option<&Value>) -> String {
    match value {
        Some(Value::Number(value)) => value.to_string(),
        Some(Value::Text(text)) => text.clone(),
        None => "nothing".to_owned(),
    }
}

fn ends(interval: Option<&Interval>) -> String {
    interval.map_or("none".to_owned(), |it| format!("{} to {} ({})", it.low, it.high, it.method))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::Grid;

    fn table(value: f64) -> Table {
        let mut table = Table::new("table-0", "t");
        let cell = Cell::new("Corridor", "HOG", value, Provenance::Published, 111);
        table.push(cell.within(value - 0.1, value + 0.1, "Wilson"));
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

    fn texts(checked: &Checked) -> Vec<String> {
        checked.findings.iter().map(Finding::to_string).collect()
    }

    #[test]
    fn the_same_number_passes_and_is_counted() {
        let table = table(0.5);
        let checked = check(&table, &table.cells, &[expectation(0.5)], &[]);
        assert_eq!(checked, Checked { n_compared: 2, ..Checked::default() });
    }

    #[test]
    fn a_number_that_moved_is_found_on_both_sides() {
        let mut page = table(0.5).cells;
        page[0].interval = table(0.5001).cells[0].interval.clone();
        let checked = check(&table(0.5001), &page, &[expectation(0.5)], &[]);
        assert_eq!(
            texts(&checked),
            [
                "Corridor / HOG (published): the committed page says 0.5, computed 0.5001",
                "Corridor / HOG (published): expected 0.5, computed 0.5001",
            ]
        );
    }

    #[test]
    fn another_count_interval_or_note_is_found() {
        let page = table(0.5).cells;
        let mut now = table(0.5);
        now.cells[0].n = 110;
        now.cells[0].interval = None;
        now.cells[0].note = Some("one query left out".to_owned());
        let found = texts(&check(&now, &page, &[], &[])).join("\n");
        for part in ["n: the committed page says 111, computed 110", "(Wilson), computed none"] {
            assert!(found.contains(part), "{found}");
        }
        assert!(found.contains("note: the committed page says ``, computed `one query"), "{found}");
    }

    #[test]
    fn a_cell_missing_from_the_page_is_found() {
        assert_eq!(check(&table(0.5), &[], &[], &[]).findings.len(), 1);
    }

    #[test]
    fn data_not_at_hand_is_left_alone_but_what_needs_none_is_not() {
        let mut now = Table::new("table-0", "t");
        now.push(Cell::absent("Corridor", "HOG", "not at hand"));
        let mut page = table(0.5).cells;
        let checked = check(&now, &page, &[expectation(0.7)], &[]);
        assert_eq!(checked, Checked { n_not_at_hand: 1, ..Checked::default() });
        page.push(Cell::new("street", "HOG", 0.5, Provenance::Generated, 9));
        let found = texts(&check(&now, &page, &[], &[]));
        let expected = "street / HOG (generated): is on the page and was not computed";
        assert_eq!(found, [expected]);
        // Nothing is absent: then nothing explains what is missing.
        let empty = Table::new("table-0", "t");
        assert_eq!(check(&empty, &table(0.5).cells, &[], &[]).findings.len(), 1);
    }

    #[test]
    fn a_method_without_its_weights_is_left_alone_and_no_other() {
        let cell = |row: &str| Cell::new(row, "AUC-PR", 0.5, Provenance::Generated, 9);
        let page = [cell("street: XFeat-RANSAC"), cell("street: SIFT-RANSAC")];
        let mut now = Table::new("table-0", "t");
        now.push(Cell { value: None, ..cell("street: XFeat-RANSAC").noted("not at hand") });
        let found = check(&now, &page, &[], &["XFeat-RANSAC"]);
        assert_eq!(found.n_not_at_hand, 1);
        let expected =
            "street: SIFT-RANSAC / AUC-PR (generated): is on the page and was not computed";
        assert_eq!(texts(&found), [expected]);
        assert_eq!(check(&Table::new("table-0", "t"), &page, &[], &["XFeat-RANSAC"]), found);
        // With its weights at hand, nothing explains why it has no value.
        assert_eq!(check(&now, &page, &[], &[]).findings.len(), 3);
    }

    #[test]
    fn an_expectation_that_no_cell_meets_is_found() {
        let mut mistyped = expectation(0.5);
        mistyped.grid = Grid::single("Coridor", "HOG", 0.5);
        let table = table(0.5);
        let found = texts(&check(&table, &table.cells, &[mistyped], &[]));
        assert_eq!(
            found,
            ["Coridor / HOG (published): expected, but neither computed nor on the page"]
        );
    }
}
