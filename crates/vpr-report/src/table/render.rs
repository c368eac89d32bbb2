//! A table as text, CSV, JSON, Markdown or HTML.

use std::fmt::Write as _;

use comfy_table::{Table as Grid, TableStyle, presets};
use serde::{Deserialize, Serialize};

use crate::figure::escape;

use super::{
    Cell, Table,
    arrange::{Block, Pivot},
    csv_cell::CsvCell,
};

/// Letters of a line where nothing else is known, and on pages.
pub const WIDTH: usize = 100;

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
    /// A `<table>`, for pages.
    Html,
}

pub(super) fn render(table: &Table, format: Format, width: usize) -> String {
    match format {
        Format::Table => {
            let pivot = Pivot::new(table, |text| text + " *");
            let blocks = blocks(&pivot.blocks(width), presets::NOTHING, "");
            let notes = wrapped(&notes(&pivot, "*: "), width);
            format!("{}: {}\n{blocks}{notes}", table.id, table.title)
        }
        Format::Markdown => {
            let pivot = Pivot::new(table, |text| format!("**{text}**"));
            let blocks = blocks(&pivot.blocks(width), presets::ASCII_MARKDOWN, "### ");
            let notes = notes(&pivot, "Bold: ").replace("\n[", "\n- [");
            // Notes are items of a list, or they would run together.
            let item = if notes.starts_with('[') { "- " } else { "" };
            format!("{blocks}\n{item}{notes}")
        }
        Format::Html => {
            let pivot = Pivot::new(table, |text| text + " *");
            // A browser scrolls; nothing is cut.
            let grids: String = pivot.blocks(usize::MAX).iter().map(html).collect();
            let mut text = grids;
            for line in notes(&pivot, "*: ").lines().filter(|line| !line.is_empty()) {
                let _ = writeln!(text, "<p>{}</p>", escape(line));
            }
            text
        }
        Format::Csv => csv(table.cells.iter()),
        Format::Json => {
            let json = serde_json::to_string_pretty(table).expect("labels are strings");
            json + "\n"
        }
    }
}

fn html(block: &Block) -> String {
    let cells = |tag: &str, cells: &[String]| -> String {
        cells
            .iter()
            .fold(String::new(), |text, it| text + &format!("<{tag}>{}</{tag}>", escape(it)))
    };
    let label = escape(block.heading.as_deref().unwrap_or("numbers"));
    let mut text = format!(
        "<div class=\"wide\" tabindex=\"0\" role=\"region\" aria-label=\"{label}\"><table>\n"
    );
    if let Some(row) = &block.heading {
        let _ = writeln!(text, "<caption>{}</caption>", escape(row));
    }
    // A corner that says nothing heads nothing.
    let header = cells("th", &block.header).replace("<th></th>", "<td></td>");
    let header = header.replace("<th>", "<th scope=\"col\">");
    let _ = writeln!(text, "<thead><tr>{header}</tr></thead>\n<tbody>");
    for line in &block.lines {
        let _ = writeln!(text, "<tr>{}</tr>", cells("td", line));
    }
    text + "</tbody></table></div>\n"
}

/// Cells as CSV with a header, one per line.
pub(super) fn csv<'a>(cells: impl Iterator<Item = &'a Cell> + Clone) -> String {
    let has_best = cells.clone().any(|cell| cell.best);
    let mut writer = csv::Writer::from_writer(Vec::new());
    for cell in cells {
        writer.serialize(CsvCell::new(cell, has_best)).expect("writing to memory");
    }
    String::from_utf8(writer.into_inner().expect("writing to memory")).expect("labels are UTF-8")
}

fn blocks(blocks: &[Block], style: TableStyle, heading: &str) -> String {
    // In Markdown a bar ends a cell and a line a table.
    let safe = |text: &String| match heading {
        "" => text.clone(),
        _ => text.replace('|', "\\|").replace(['\r', '\n'], " "),
    };
    let mut text = String::new();
    for (index, block) in blocks.iter().enumerate() {
        if index > 0 {
            text.push('\n');
        }
        if let Some(row) = &block.heading {
            let after = if heading.is_empty() { "" } else { "\n" };
            let _ = write!(text, "{heading}{}\n{after}", safe(row));
        }
        let mut grid = Grid::new();
        let lines = block.lines.iter().map(|line| line.iter().map(safe).collect::<Vec<_>>());
        grid.load_style(style);
        grid.set_header(block.header.iter().map(safe).collect::<Vec<_>>()).add_rows(lines);
        for line in grid.lines() {
            text += line.trim_end();
            text.push('\n');
        }
    }
    text
}

/// Lines broken between words, so that none is longer than the page.
fn wrapped(text: &str, width: usize) -> String {
    let mut wrapped = String::new();
    for line in text.lines() {
        let mut length = 0;
        for word in line.split(' ') {
            let n = word.chars().count();
            if length > 0 && length + 1 + n > width {
                wrapped.push_str("\n    ");
                length = 4;
            } else if length > 0 {
                wrapped.push(' ');
                length += 1;
            }
            wrapped.push_str(word);
            length += n;
        }
        wrapped.push('\n');
    }
    wrapped
}

/// What the marks mean.
fn notes(pivot: &Pivot<'_>, best: &str) -> String {
    let best = if pivot.has_best {
        format!(
            "{best}better than every other of its row by a paired test on the same queries, level \
             .05 after Holm's correction for all pairs.\n"
        )
    } else {
        String::new()
    };
    let notes = pivot.notes.text();
    let between = if best.is_empty() || notes.is_empty() { "" } else { "\n" };
    format!("{best}{between}{notes}")
}

#[cfg(test)]
mod tests {
    use vpr_core::Provenance;

    use super::*;
    use crate::table::{Rounding, Value};

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
            " Corridor  thesis                 .6800       .7800",
            " Corridor  published  published   .6971 ✗     .7876 ✓",
            " Nordland  absent                 absent [1]  absent [1]",
            "[1] Nordland: not at hand",
        ];
        assert_eq!(
            table().render(Format::Table).lines().map(str::trim_end).collect::<Vec<_>>(),
            lines
        );
    }

    #[test]
    fn the_best_stands_out_only_where_a_test_said_so() {
        let mut table = Table::new("table-0", "t");
        for row in ["sure", "unsure"] {
            let cell = |column, value| Cell::new(row, column, value, Provenance::Measured, 99);
            table.push(cell("HOG", 0.5).within(0.4, 0.6, "bootstrap"));
            table.push(cell("CALC", 0.75).within(0.7, 0.8, "bootstrap"));
        }
        assert!(!table.render(Format::Markdown).contains("**"), "nobody tested");
        assert!(!table.render(Format::Csv).contains("best"));
        table.cells[1].best = true;
        let text = table.render(Format::Markdown);
        assert!(text.contains("**.750 ± .05**") && text.matches("**").count() == 2, "{text}");
        assert!(text.contains("Bold: better than every other of its row"), "{text}");
        assert!(table.render(Format::Table).contains(".750 ± .05 *"));
        let csv = table.render(Format::Csv);
        assert!(csv.lines().next().unwrap().ends_with(",note,best"), "{csv}");
        assert_eq!(csv.lines().filter(|it| it.ends_with(",yes")).count(), 1, "{csv}");
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
}
