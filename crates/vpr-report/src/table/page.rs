//! The committed page of a table: Markdown for people, CSV for the check.

use std::path::Path;

use super::{Cell, Format, Table, csv_cell::CsvCell, render};
use crate::figure::escape;
use vpr_core::{Error, Result};

/// Lines of numbers beyond which a figure's are folded.
const LONG: usize = 60;

/// The drawings that a page shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Drawings<'a> {
    /// Whether there is a figure, `<id>.svg`.
    pub figure: bool,
    /// What the colours of a contact sheet mean, `<id>.png`, if there is one.
    pub sheet: Option<&'a str>,
}

/// The Markdown page of a table: title, source, numbers, notes. Timings are left out, and so are
/// dates and machine names, so that the same data gives the same page.
#[must_use]
pub fn markdown_page(table: &Table, source: &str, drawings: Drawings<'_>) -> String {
    let stable = without_timings(table);
    let figure = drawings.figure.then(|| format!("![{0}]({0}.svg)\n\n", table.id));
    let sheet = drawings.sheet.map(|legend| format!("![{0}]({0}.png)\n\n{legend}\n\n", table.id));
    let picture: String = figure.into_iter().chain(sheet).collect();
    let body = stable.render(Format::Markdown);
    // The numbers behind a figure are for those who look for them.
    let body = if drawings.figure && body.lines().count() > LONG {
        format!("<details>\n<summary>The numbers</summary>\n\n{body}\n</details>\n")
    } else {
        body
    };
    let verdict = match stable.agreement() {
        (_, 0) => String::new(),
        (n_agree, n) => format!("Against the thesis: {n_agree} of {n} numbers read the same.\n\n"),
    };
    format!(
        "# {id}: {title}\n\nSource: {source}. Written by `cargo xtask reproduce {id} --write`; do not edit.\n\n\
         Origins: `published`, computed from the author's published files; `measured`, from real images; \
         `generated`, from generated images; `absent`, no data at hand. ✓ reads like the thesis, ✗ does not.\n\n\
         {verdict}{picture}{body}",
        id = table.id,
        title = table.title,
    )
}

/// The page as HTML, to be looked at in a browser; its picture and CSV lie beside it.
#[must_use]
pub fn html_page(table: &Table, source: &str, drawings: Drawings<'_>) -> String {
    let stable = without_timings(table);
    let (id, title) = (escape(&table.id), escape(&table.title));
    let picture = |extension: &str| {
        format!(
            "<p><a href=\"{id}.{extension}\"><img src=\"{id}.{extension}\" alt=\"{title}\"></a></p>\n"
        )
    };
    let figure = drawings.figure.then(|| picture("svg"));
    let sheet =
        drawings.sheet.map(|legend| format!("{}<p>{}</p>\n", picture("png"), escape(legend)));
    let verdict = match stable.agreement() {
        (_, 0) => String::new(),
        (n_agree, n) => {
            format!("<p>Against the thesis: {n_agree} of {n} numbers read the same.</p>\n")
        }
    };
    let body = format!(
        "<p>Source: {}. <a href=\"{id}.csv\">All digits</a> · <a href=\"index.html\">all results</a></p>\n\
         <p>Origins: published, computed from the author's published files; measured, from real \
         images; generated, from generated images; absent, no data at hand. ✓ reads like the \
         thesis, ✗ does not.</p>\n{verdict}{}{}",
        escape(source),
        figure.into_iter().chain(sheet).collect::<String>(),
        stable.render(Format::Html),
    );
    html_document(&format!("{}: {}", table.id, table.title), &body)
}

/// A document around a body; readable in light and dark, on paper and on a telephone.
#[must_use]
pub fn html_document(title: &str, body: &str) -> String {
    let title = escape(title);
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n\
         <title>{title}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<main>\n\
         <h1>{title}</h1>\n{body}</main>\n</body>\n</html>\n"
    )
}

const STYLE: &str = ":root{color-scheme:light dark}\
    body{font:16px/1.5 system-ui,sans-serif;margin:1rem;background:#fff;color:#1d2127}a{color:#005a9c}\
    @media (prefers-color-scheme:dark){body{background:#14171c;color:#e8eaed}a{color:#8ec7ff}}\
    @media print{body{background:#fff;color:#000}}main{max-width:75rem;margin:auto}\
    .wide{overflow-x:auto}table{border-collapse:collapse;font-variant-numeric:tabular-nums}\
    th,td{text-align:left;padding:.2rem .7rem;border-bottom:1px solid #8886;vertical-align:top}\
    img{max-width:100%;background:#fff}td a{white-space:nowrap}td img{max-height:9rem;width:auto}";

/// The cells of a page's CSV, timings left out.
#[must_use]
pub fn csv_page(table: &Table) -> String {
    render::csv(table.cells.iter().filter(|cell| !cell.volatile))
}

/// Reads the CSV beside a committed page.
///
/// # Errors
///
/// [`Error::Format`] names the line that is not a cell; [`Error::Io`] if the file cannot be read.
pub fn read_csv(path: &Path) -> Result<Vec<Cell>> {
    let bytes = std::fs::read(path).map_err(Error::io(path))?;
    let mut reader = csv::Reader::from_reader(bytes.as_slice());
    reader
        .deserialize()
        .enumerate()
        .map(|(index, cell)| {
            let cell: CsvCell = cell.map_err(|err: csv::Error| {
                let line = err.position().map_or(1, csv::Position::line);
                Error::format(path, format!("line {line}"), err.to_string())
            })?;
            let place = || format!("cell {}", index + 1);
            Cell::try_from(cell).map_err(|reason| Error::format(path, place(), reason))
        })
        .collect()
}

fn without_timings(table: &Table) -> Table {
    let cells = table.cells.iter().filter(|cell| !cell.volatile).cloned().collect();
    Table { cells, ..table.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::Value;
    use vpr_core::Provenance;

    #[test]
    fn what_is_written_is_read_back() {
        let mut table = Table::new("table-0", "t");
        let mut cell = Cell::new("a, \"b\"", "c", 0.1 + 0.2, Provenance::Measured, 3);
        cell.thesis = Some(Value::Text("✓".to_owned()));
        table.push(cell.defined("corrected").noted("line\nbreak").within(0.1, 0.4, "Wilson"));
        table.cells[0].best = true;
        table.push(Cell::absent("a", "c", "no data"));
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("table-0.csv");
        std::fs::write(&path, csv_page(&table)).unwrap();
        assert_eq!(read_csv(&path).unwrap(), table.cells);
    }

    #[test]
    fn timings_stay_out_of_pages() {
        let mut table = Table::new("table-0", "t");
        table.push(Cell::new("r", "t_e", 0.123, Provenance::Measured, 3).timing());
        assert!(!markdown_page(&table, "s", Drawings::default()).contains("0.123"));
        assert!(!csv_page(&table).contains("0.123"));
    }

    #[test]
    fn a_bad_line_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x.csv");
        std::fs::write(
            &path,
            "row,column,value,thesis,definition,provenance,n,low,high,interval,note\na,b\n",
        )
        .unwrap();
        assert!(read_csv(&path).unwrap_err().to_string().contains("line 2"));
    }
}
