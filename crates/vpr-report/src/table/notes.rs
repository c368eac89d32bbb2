//! Footnotes: numbered once, said where they differ from cell to cell.

use super::{Cell, Table};

/// Notes that differ only in their numbers become one if there are more than this.
const ALIKE: usize = 3;

/// The footnotes of a table and who has them.
pub(super) struct Notes {
    /// In order of first appearance.
    texts: Vec<String>,
    /// Of the whole table, of columns, of single cells.
    everywhere: Option<String>,
    columns: Vec<(String, usize)>,
}

impl Notes {
    /// The notes of all cells that tell theirs.
    pub(super) fn of(table: &Table) -> Self {
        let told: Vec<&Cell> = table.cells.iter().filter(|cell| tells(cell).is_some()).collect();
        let mut texts: Vec<String> = Vec::new();
        for cell in &told {
            let note = cell.note.as_deref().unwrap_or_default();
            if !texts.iter().any(|it| it == note) {
                texts.push(note.to_owned());
            }
        }
        let mut notes = Self { texts: folded(texts), everywhere: None, columns: Vec::new() };
        // With values only: absent cells say why, each for itself.
        let valued: Vec<&Cell> = table.cells.iter().filter(|it| it.value.is_some()).collect();
        if let [text] = notes.texts.as_slice()
            && told.len() == table.cells.len()
            && told.len() > 1
        {
            notes.everywhere = Some(text.clone());
            return notes;
        }
        let mut columns: Vec<&str> = Vec::new();
        for cell in &valued {
            if !columns.contains(&&*cell.column) {
                columns.push(&cell.column);
            }
        }
        for column in columns {
            let of: Vec<Option<usize>> =
                valued.iter().filter(|it| it.column == column).map(|it| notes.find(it)).collect();
            if let (Some(Some(first)), true) = (of.first(), of.len() > 1)
                && of.iter().all(|it| *it == Some(*first))
            {
                notes.columns.push((column.to_owned(), *first));
            }
        }
        notes
    }

    fn find(&self, cell: &Cell) -> Option<usize> {
        let note = tells(cell)?;
        let pattern = pattern(note);
        self.texts.iter().position(|it| it == note || *it == pattern)
    }

    /// What stands behind a cell.
    pub(super) fn mark(&self, cell: &Cell) -> String {
        if self.everywhere.is_some() {
            return String::new();
        }
        let of_column = self.columns.iter().find(|it| it.0 == cell.column).map(|it| it.1);
        match self.find(cell) {
            Some(index) if of_column != Some(index) || cell.value.is_none() => reference(index),
            _ => String::new(),
        }
    }

    /// What stands behind the name of a column.
    pub(super) fn mark_of_column(&self, column: &str) -> String {
        let index = self.columns.iter().find(|it| it.0 == column).map(|it| it.1);
        index.map_or_else(String::new, reference)
    }

    /// The notes, one a line.
    pub(super) fn text(&self) -> String {
        if let Some(note) = &self.everywhere {
            return format!("All: {note}\n");
        }
        let lines = (1..).zip(&self.texts).map(|(number, note)| format!("[{number}] {note}\n"));
        lines.collect::<Vec<_>>().concat()
    }
}

fn tells(cell: &Cell) -> Option<&str> {
    cell.note.as_deref().filter(|_| !cell.quiet)
}

fn reference(index: usize) -> String {
    format!(" [{}]", index + 1)
}

/// A note without its numbers.
fn pattern(note: &str) -> String {
    let mut pattern = String::new();
    let mut rest = note;
    while let Some(start) = rest.find(|it: char| it.is_ascii_digit()) {
        let (before, number) = rest.split_at(start);
        let end = number.find(|it: char| !it.is_ascii_digit() && it != '.').unwrap_or(number.len());
        let after = &number[end..];
        // A point that ends a sentence is no part of a number.
        let point = if number[..end].ends_with('.') { "." } else { "" };
        pattern.push_str(before);
        pattern.push('…');
        pattern.push_str(point);
        rest = after;
    }
    pattern + rest + " (numbers: see the CSV)"
}

/// Many notes that differ only in their numbers as one.
fn folded(texts: Vec<String>) -> Vec<String> {
    let patterns: Vec<String> = texts.iter().map(|it| pattern(it)).collect();
    let mut folded: Vec<String> = Vec::new();
    for (text, own) in texts.into_iter().zip(&patterns) {
        let is_many = patterns.iter().filter(|it| *it == own).count() > ALIKE;
        let text = if is_many { own.clone() } else { text };
        if !folded.contains(&text) {
            folded.push(text);
        }
    }
    folded
}

#[cfg(test)]
mod tests {
    use vpr_core::Provenance;

    use super::*;

    fn cell(row: &str, column: &str, note: &str) -> Cell {
        let cell = Cell::new(row, column, 0.5, Provenance::Measured, 9);
        if note.is_empty() { cell } else { cell.noted(note) }
    }

    fn notes(cells: &[Cell]) -> Notes {
        let mut table = Table::new("table-0", "t");
        cells.iter().cloned().for_each(|cell| table.push(cell));
        Notes::of(&table)
    }

    #[test]
    fn what_all_cells_share_is_said_once() {
        let cells = [cell("a", "x", "median"), cell("b", "x", "median")];
        let notes = notes(&cells);
        assert_eq!(notes.text(), "All: median\n");
        assert_eq!(notes.mark(&cells[0]), "");
    }

    #[test]
    fn what_a_column_shares_stands_at_its_head() {
        let cells = [
            cell("a", "x", "median"),
            cell("b", "x", "median"),
            cell("a", "y", "few"),
            cell("b", "y", ""),
        ];
        let notes = notes(&cells);
        assert_eq!(notes.text(), "[1] median\n[2] few\n");
        assert_eq!(
            (notes.mark_of_column("x"), notes.mark(&cells[0])),
            (" [1]".into(), String::new())
        );
        assert_eq!(
            (notes.mark_of_column("y"), notes.mark(&cells[2])),
            (String::new(), " [2]".into())
        );
    }

    #[test]
    fn many_notes_that_differ_in_numbers_become_one() {
        let cell = |row: usize| cell(&row.to_string(), "x", &format!("base rate 0.{row}2; own"));
        let mut cells: Vec<Cell> = (0..4).map(cell).collect();
        cells.push(Cell::new("0", "y", 0.5, Provenance::Measured, 9));
        let notes = notes(&cells);
        assert_eq!(notes.text(), "[1] base rate …; own (numbers: see the CSV)\n");
        assert_eq!(notes.mark_of_column("x"), " [1]");
        assert_eq!(notes_of_three(), 3);
    }

    fn notes_of_three() -> usize {
        let cells: Vec<Cell> =
            (0..3).map(|row| cell(&row.to_string(), "x", &format!("base rate 0.{row}"))).collect();
        notes(&cells).text().lines().count()
    }
}
