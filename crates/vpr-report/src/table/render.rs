//! A table as text, CSV, JSON or Markdown.

use comfy_table::{Table as Grid, TableStyle, presets};
use serde::{Deserialize, Serialize};

use vpr_core::Provenance;

use super::{Cell, Table, Value, csv_cell::CsvCell};

/// How a table is printed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// Aligned columns, for reading in a terminal.
    #[default]
    Table,
    /// One cell per line with all of its fields.
    Csv,
    /// `{"id", "title", "cells": [...]}`.
    Json,
    /// A pipe table, for documents.
    Markdown,
}

pub(super) fn render(table: &Table, format: Format) -> String {
    match format {
        Format::Table => {
            let (grid, notes) = pivot(table);
            format!("{}: {}\n{}\n{notes}", table.id, table.title, grid.render(presets::NOTHING))
        }
        Format::Markdown => {
            let (grid, notes) = pivot(table);
            format!("{}\n\n{notes}", grid.render(presets::ASCII_MARKDOWN))
        }
        Format::Csv => csv(table.cells.iter()),
        Format::Json => {
            let json = serde_json::to_string_pretty(table).expect("labels are strings");
            json + "\n"
        }
    }
}

/// Cells as CSV with a header, one per line.
pub(super) fn csv<'a>(cells: impl Iterator<Item = &'a Cell>) -> String {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for cell in cells {
        writer.serialize(CsvCell::from(cell)).expect("writing to memory");
    }
    String::from_utf8(writer.into_inner().expect("writing to memory")).expect("labels are UTF-8")
}

/// A number as people read it: whole, or four decimals, or two if large.
pub(super) fn number(value: f64) -> String {
    let magnitude = value.abs();
    if value.fract() == 0.0 && magnitude < 1e9 {
        format!("{value}")
    } else if magnitude >= 100.0 {
        format!("{value:.2}")
    } else if magnitude >= 1e-3 {
        format!("{value:.4}")
    } else {
        format!("{value:.2e}")
    }
}

fn text(value: &Value) -> String {
    match value {
        Value::Number(value) => number(*value),
        Value::Text(text) => text.clone(),
    }
}

/// Header and lines of the pivoted table.
struct Pivot {
    header: Vec<String>,
    lines: Vec<Vec<String>>,
}

impl Pivot {
    fn render(&self, style: TableStyle) -> String {
        let mut grid = Grid::new();
        grid.load_style(style).set_header(&self.header).add_rows(&self.lines);
        let lines = grid.lines().map(|line| line.trim_end().to_owned());
        lines.collect::<Vec<_>>().join("\n")
    }
}

/// One line per row, definition and origin; a line with the thesis' values above them.
fn pivot(table: &Table) -> (Pivot, String) {
    let columns = in_order(table.cells.iter().map(|cell| cell.column.as_str()));
    let has_definitions = table.cells.iter().any(|cell| cell.definition.is_some());
    let mut notes: Vec<&str> = Vec::new();
    let mut lines = Vec::new();
    for row in in_order(table.cells.iter().map(|cell| cell.row.as_str())) {
        let cells: Vec<&Cell> = table.cells.iter().filter(|cell| cell.row == row).collect();
        if cells.iter().any(|cell| cell.thesis.is_some()) {
            let thesis = |column: &&str| {
                let cell =
                    cells.iter().find(|cell| cell.column == *column && cell.thesis.is_some());
                cell.and_then(|cell| cell.thesis.as_ref()).map_or_else(String::new, text)
            };
            lines.push(line(row, "thesis", None, has_definitions, columns.iter().map(thesis)));
        }
        let groups =
            in_order(cells.iter().map(|cell| (cell.provenance, cell.definition.as_deref())));
        for (provenance, definition) in groups {
            let entry = |column: &&str| {
                let cell = cells.iter().find(|cell| {
                    cell.column == *column
                        && (cell.provenance, cell.definition.as_deref()) == (provenance, definition)
                });
                cell.map_or_else(String::new, |cell| entry(table, cell, &mut notes))
            };
            let origin = provenance.to_string();
            lines.push(line(row, &origin, definition, has_definitions, columns.iter().map(entry)));
        }
    }
    let labels = ["", "origin"].into_iter().chain(has_definitions.then_some("definition"));
    let header = labels.chain(columns).map(str::to_owned).collect();
    let notes: Vec<String> =
        (1..).zip(&notes).map(|(number, note)| format!("[{number}] {note}\n")).collect();
    (Pivot { header, lines }, notes.concat())
}

fn line(
    row: &str,
    origin: &str,
    definition: Option<&str>,
    has_definitions: bool,
    entries: impl Iterator<Item = String>,
) -> Vec<String> {
    let mut line = vec![row.to_owned(), origin.to_owned()];
    if has_definitions {
        line.push(definition.unwrap_or_default().to_owned());
    }
    line.extend(entries);
    line
}

/// Value, agreement mark and footnote number of one cell.
fn entry<'a>(table: &Table, cell: &'a Cell, notes: &mut Vec<&'a str>) -> String {
    let value = match (&cell.value, cell.provenance) {
        (Some(value), _) => text(value),
        (None, Provenance::Absent) => "absent".to_owned(),
        (None, _) => String::new(),
    };
    let mark = match table.agrees(cell) {
        Some(true) => " ✓",
        Some(false) => " ✗",
        None => "",
    };
    let note = cell.note.as_deref().filter(|_| !cell.quiet).map_or_else(String::new, |note| {
        let known = notes.iter().position(|it| *it == note);
        let index = known.unwrap_or_else(|| {
            notes.push(note);
            notes.len() - 1
        });
        format!(" [{}]", index + 1)
    });
    format!("{value}{mark}{note}")
}

/// The distinct items, in order of first appearance.
fn in_order<T: PartialEq>(items: impl Iterator<Item = T>) -> Vec<T> {
    let mut distinct = Vec::new();
    for item in items {
        if !distinct.contains(&item) {
            distinct.push(item);
        }
    }
    distinct
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::Rounding;

    fn table() -> Table {
        let mut table = Table::new("table-0", "AUC-PR");
        table.rounding = Some((Rounding::Truncated, 2));
        for (column, value, thesis) in [("HOG", 0.697_064, 0.68), ("CALC", 0.787_557, 0.78)] {
            let mut cell = Cell::new("Corridor", column, value, Provenance::Published, 111);
            cell.thesis = Some(Value::Number(thesis));
            table.push(cell.defined("published"));
        }
        table.push(Cell::absent("Nordland", "HOG", "Nordland: not at hand"));
        table.push(Cell::absent("Nordland", "CALC", "Nordland: not at hand"));
        table
    }

    #[test]
    fn text_shows_ours_the_thesis_and_the_origin() {
        let lines = [
            "table-0: AUC-PR",
            "           origin     definition  HOG         CALC",
            " Corridor  thesis                 0.6800      0.7800",
            " Corridor  published  published   0.6971 ✗    0.7876 ✓",
            " Nordland  absent                 absent [1]  absent [1]",
            "[1] Nordland: not at hand",
        ];
        assert_eq!(
            table().render(Format::Table).lines().map(str::trim_end).collect::<Vec<_>>(),
            lines
        );
    }

    #[test]
    fn intervals_are_columns_and_no_footnotes() {
        let mut table = Table::new("table-0", "t");
        for (column, low) in [("HOG", 0.4), ("CALC", 0.45)] {
            let cell = Cell::new("Corridor", column, 0.5, Provenance::Measured, 9);
            table.push(cell.noted("within chance").within(low, 0.6, "bootstrap"));
        }
        let text = table.render(Format::Table);
        assert!(text.ends_with("[1] within chance\n"), "{text}");
        assert!(table.render(Format::Csv).contains(",0.45,0.6,bootstrap,within chance\n"));
    }

    #[test]
    fn csv_has_one_cell_a_line() {
        let lines = [
            "row,column,value,thesis,definition,provenance,n,low,high,interval,note",
            "Corridor,HOG,0.697064,0.68,published,published,111,,,,",
            "Corridor,CALC,0.787557,0.78,published,published,111,,,,",
            "Nordland,HOG,,,,absent,0,,,,Nordland: not at hand",
            "Nordland,CALC,,,,absent,0,,,,Nordland: not at hand",
        ];
        assert_eq!(
            table().render(Format::Csv).lines().map(str::trim_end).collect::<Vec<_>>(),
            lines
        );
    }

    #[test]
    fn numbers_read_well() {
        let printed = [0.0, 0.5, 111.0, 35_721.0, 138.384, 2.4e-6].map(number);
        assert_eq!(printed, ["0", "0.5000", "111", "35721", "138.38", "2.40e-6"]);
    }
}
