//! What a table says, in all of its formats.

use std::collections::BTreeMap;

use super::*;

#[test]
fn truncation_and_rounding_differ_at_the_last_digit() {
    assert!(Rounding::Truncated.agrees(0.818_457, 0.81, 2));
    assert!(!Rounding::Rounded.agrees(0.818_457, 0.81, 2));
    assert!(Rounding::Rounded.agrees(0.818_457, 0.82, 2));
    assert!(Rounding::Truncated.agrees(0.7, 0.70, 2));
    assert!(!Rounding::Truncated.agrees(0.8219, 0.83, 2));
}

#[test]
fn only_the_same_quantity_is_judged() {
    let mut table = Table::new("table-0", "");
    table.rounding = Some((Rounding::Rounded, 1));
    let mut cell = Cell::new("row", "column", 0.5, Provenance::Published, 1);
    cell.thesis = Some(Value::Number(0.5));
    assert_eq!(table.agrees(&cell), Some(true));
    assert_eq!(table.agrees(&cell.clone().defined("corrected")), None);
    cell.provenance = Provenance::Generated;
    assert_eq!(table.agrees(&cell), None);
}

#[test]
fn json_has_exactly_the_documented_keys() {
    let mut table = Table::new("table-0", "Title");
    table.push(Cell::absent("row", "column", "no data"));
    let json: serde_json::Value = serde_json::from_str(&table.render(Format::Json)).unwrap();
    assert_eq!(
        json,
        serde_json::json!({"id": "table-0", "title": "Title", "cells": [{
            "row": "row", "column": "column", "value": null, "thesis": null,
            "definition": null, "provenance": "absent", "n": 0, "interval": null,
            "note": "no data"}]})
    );
}

/// Tables that print whole, in parts of their columns, and row by row.
fn tables() -> [Table; 3] {
    let table = |n_columns: usize, row: &str| {
        let mut table = Table::new("table-0", "t");
        table.rounding = Some((Rounding::Rounded, 2));
        for line in 0..3 {
            for index in 0..n_columns {
                let value = 0.4 + 0.047 * index as f64 - 0.1 * f64::from(line);
                let cell = |definition| {
                    let row = format!("{row} {line}");
                    let cell =
                        Cell::new(row, format!("tech {index}"), value, Provenance::Measured, 9);
                    let mut cell = cell.defined(definition);
                    cell.thesis = Some(Value::Number((value * 100.0).floor() / 100.0));
                    if index % 3 == 0 { cell.noted(format!("note {index}")) } else { cell }
                };
                table.push(cell("published").within(value - 0.03, value + 0.03, "bootstrap"));
                table.push(cell("corrected").within(value - 0.06, value + 0.02, "bootstrap"));
            }
        }
        table.push(Cell::absent(format!("{row} 0"), "a word", "no data"));
        table.push(Cell::new(format!("{row} 1"), "a word", "falls", Provenance::Measured, 9));
        table
    };
    [table(2, "street"), table(16, "s"), table(16, "7-Scenes RedKitchen / a long encoder's name")]
}

/// The printed entries of a Markdown text by row, line label and column.
fn entries(markdown: &str) -> BTreeMap<(String, String, String), String> {
    let cells = |line: &str| -> Vec<String> {
        line.trim_matches('|').split('|').map(|it| it.trim().to_owned()).collect()
    };
    let bare = |text: &str| text.split(" [").next().unwrap_or_default().to_owned();
    let (mut heading, mut header, mut entries) = (None, Vec::new(), BTreeMap::new());
    for line in markdown.lines() {
        if let Some(row) = line.strip_prefix("### ") {
            heading = Some(row.to_owned());
        }
        if !line.starts_with('|') {
            header.clear();
        } else if header.is_empty() {
            header = cells(line);
        } else if !line.starts_with("|-") {
            let cells = cells(line);
            // A row of its own may be turned: its lines are then columns.
            let is_turned = heading.is_some() && header[1..].iter().any(|it| it == "thesis");
            let n_labels = if heading.is_some() { 1 } else { 3 };
            for (head, cell) in
                header.iter().zip(&cells).skip(n_labels).filter(|it| !it.1.is_empty())
            {
                let (row, label) = match &heading {
                    Some(row) => (row.clone(), cells[0].clone()),
                    None => (cells[0].clone(), [&*cells[1], &*cells[2]].join(", ")),
                };
                let (label, head) =
                    if is_turned { (head.clone(), label) } else { (label, head.clone()) };
                let label = label.trim_end_matches(", ").to_owned();
                assert!(
                    entries.insert((row, label, bare(&head)), bare(cell)).is_none(),
                    "twice: {line}"
                );
            }
        }
    }
    entries
}

/// The rows of HTML tables as lines between bars, as Markdown has them.
fn bars(html: &str) -> String {
    let rows = html.lines().filter_map(|line| {
        let row = line.split_once("<tr>")?.1.split_once("</tr>")?.0;
        let row = row.replace(" scope=\"col\"", "").replace("</th>", "").replace("</td>", "");
        let cells = row.replace("<th>", "| ").replace("<td>", "| ");
        let plain = cells.replace("&#39;", "'").replace("&quot;", "\"").replace("&lt;", "<");
        Some(plain.replace("&gt;", ">").replace("&amp;", "&") + "|\n")
    });
    rows.collect()
}

/// Whether a printed entry is this value, to the digits that it prints.
fn reads_like(printed: &str, value: Option<&Value>) -> bool {
    match value {
        None => matches!(printed, "absent" | "–"),
        Some(Value::Text(text)) => printed == text,
        Some(Value::Number(value)) => {
            let number = printed.trim_matches('*').split(' ').next().unwrap_or_default();
            let decimals = number.split_once('.').map_or(0, |it| it.1.len());
            let unit = 10_f64.powi(-i32::try_from(decimals).unwrap());
            number.parse::<f64>().is_ok_and(|it| (it - value).abs() <= 0.5 * unit * (1.0 + 1e-9))
        }
    }
}

#[test]
fn all_formats_say_the_same_cell_by_cell() {
    for table in tables() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table-0.csv");
        std::fs::write(&path, table.render(Format::Csv)).unwrap();
        assert_eq!(read_csv(&path).unwrap(), table.cells);
        let json: serde_json::Value = serde_json::from_str(&table.render(Format::Json)).unwrap();
        assert_eq!(json["cells"], serde_json::to_value(&table.cells).unwrap());
        let html = bars(&table.render(Format::Html));
        assert_eq!(
            entries(&html),
            entries(&table.render_within(Format::Markdown, 1000)),
            "HTML and Markdown"
        );
        let mut printed = entries(&table.render(Format::Markdown));
        for cell in &table.cells {
            let key = |label: String| (cell.row.clone(), label, cell.column.clone());
            let definition = cell.definition.as_ref().map_or(String::new(), |it| format!(", {it}"));
            let label = format!("{}{definition}", cell.provenance);
            let entry =
                printed.remove(&key(label)).unwrap_or_else(|| panic!("{cell:?}: not printed"));
            assert!(reads_like(&entry, cell.value.as_ref()), "{entry}: {cell:?}");
            // Both definitions share the line of the thesis.
            if let (Some(thesis), Some("corrected")) = (&cell.thesis, cell.definition.as_deref()) {
                let entry = printed.remove(&key("thesis".to_owned())).unwrap();
                assert!(reads_like(&entry, Some(thesis)), "{entry}: {cell:?}");
            }
        }
        assert!(printed.is_empty(), "printed, but no cell: {printed:?}");
    }
}

#[test]
fn no_line_is_wider_than_the_page() {
    for (table, n_headings) in tables().iter().zip([0, 0, 3]) {
        for format in [Format::Table, Format::Markdown] {
            let text = table.render(format);
            let longest = text.lines().map(|line| line.chars().count()).max();
            assert!(longest <= Some(WIDTH), "{longest:?}:\n{text}");
        }
        assert_eq!(table.render(Format::Markdown).matches("### ").count(), n_headings);
        assert!(!table.render_within(Format::Markdown, 1000).contains("### "));
    }
}
