//! Truths as text: pairs with or without titles, a line per query, a matrix.

use std::path::Path;

use vpr_core::{Error, Result};

use super::content::{Content, Grid, Item, Said};

/// Titles of the column of queries, lower case without `_`, `-` and blanks.
const QUERY: [&str; 11] = [
    "query",
    "queries",
    "q",
    "queryname",
    "queryid",
    "queryindex",
    "queryidx",
    "queryimage",
    "querypath",
    "queryfile",
    "qidx",
];
/// Titles of the column of references.
const REFERENCE: [&str; 23] = [
    "reference",
    "references",
    "ref",
    "refs",
    "referencename",
    "referenceid",
    "referenceindex",
    "refname",
    "refid",
    "refidx",
    "database",
    "databasename",
    "db",
    "dbname",
    "dbid",
    "dbidx",
    "positive",
    "positives",
    "match",
    "matches",
    "correct",
    "groundtruth",
    "gt",
];

/// A line that says something.
pub(super) struct Line {
    /// Its number, from 1.
    pub(super) number: usize,
    /// What stands between the separators.
    pub(super) fields: Vec<String>,
}

/// The lines of a text that say something, in fields: separated by tabs, semicolons or commas, the
/// first of these that the text has, or else by blanks. What follows a `#` at the start of a line
/// is a comment.
pub(super) fn lines(path: &Path, bytes: &[u8]) -> Result<Vec<Line>> {
    let text = std::str::from_utf8(bytes).map_err(|err| {
        Error::format(path, format!("byte {}", err.valid_up_to()), "is not UTF-8 text")
    })?;
    let text = text.trim_start_matches('\u{feff}');
    let content = || {
        let lines = text.lines().enumerate().map(|(index, line)| (index + 1, line.trim()));
        lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
    };
    let separator = ['\t', ';', ','].into_iter().find(|&it| content().any(|l| l.1.contains(it)));
    let Some(separator) = separator else {
        let line = |(number, line): (usize, &str)| Line {
            number,
            fields: line.split_whitespace().map(str::to_owned).collect(),
        };
        return Ok(content().map(line).collect());
    };
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(u8::try_from(separator).unwrap_or(b','))
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .flexible(true)
        .has_headers(false)
        .from_reader(text.as_bytes());
    let mut lines = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|err| {
            let line = err.position().map_or(1, csv::Position::line);
            Error::format(path, format!("line {line}"), err.to_string())
        })?;
        let number = record.position().map_or(0, csv::Position::line);
        let number = usize::try_from(number).unwrap_or_default();
        if record.iter().any(|field| !field.is_empty()) {
            lines.push(Line { number, fields: record.iter().map(str::to_owned).collect() });
        }
    }
    Ok(lines)
}

/// A title as it is compared.
pub(super) fn title(field: &str) -> String {
    field.to_lowercase().replace(['_', '-', ' '], "")
}

/// What a text says.
pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<Said> {
    let mut lines = lines(path, bytes)?;
    if lines.is_empty() {
        return Err(Error::format(path, "line 1", "there is no line that says something"));
    }
    let columns = titles(path, &lines[0].fields)?;
    if columns.is_some() {
        lines.remove(0);
    }
    let mut rows = Vec::with_capacity(lines.len());
    for line in &lines {
        let fields: Vec<&str> = match columns {
            None => line.fields.iter().map(String::as_str).collect(),
            Some(Columns { query, reference, n }) => {
                if line.fields.len() != n {
                    let reason = format!("{} values for {n} columns", line.fields.len());
                    return Err(Error::format(path, format!("line {}", line.number), reason));
                }
                let query = query.map(|query| line.fields[query].as_str());
                query.into_iter().chain([line.fields[reference].as_str()]).collect()
            }
        };
        rows.push(fields.into_iter().map(cell).collect::<Vec<_>>());
    }
    let has_query = columns.is_some_and(|columns| columns.query.is_some());
    let content = content(rows, has_query).map_err(|row| {
        let place = format!("line {}", lines.get(row).map_or(0, |line| line.number));
        Error::format(path, place, "does not begin with one query")
    })?;
    let notes = if bytes.ends_with(b"\n") || bytes.ends_with(b"\r") {
        Vec::new()
    } else {
        vec!["the last line has no end: the file may be cut off".to_owned()]
    };
    let lines = Some(lines.iter().map(|line| line.number).collect());
    Ok(Said { lines, notes, ..Said::of(content) })
}

/// Which columns are which.
#[derive(Clone, Copy)]
struct Columns {
    query: Option<usize>,
    reference: usize,
    n: usize,
}

/// The columns that a line of titles names; `None` if the line is none of titles.
fn titles(path: &Path, fields: &[String]) -> Result<Option<Columns>> {
    let titles: Vec<String> = fields.iter().map(|field| title(field)).collect();
    let column = |known: &[&str]| titles.iter().position(|it| known.contains(&it.as_str()));
    let n = fields.len();
    match (column(&QUERY), column(&REFERENCE)) {
        (query @ Some(_), Some(reference)) => Ok(Some(Columns { query, reference, n })),
        (None, Some(reference)) if n == 1 => Ok(Some(Columns { query: None, reference, n })),
        (None, None) => Ok(None),
        _ => {
            let reason = format!(
                "the titles are `{}`: expected `query` and `reference` among them",
                vpr_files::shorten(&fields.join(","))
            );
            Err(Error::format(path, "line 1", reason))
        }
    }
}

/// What stands in one field: an index, a name, or several indices.
fn cell(field: &str) -> Vec<Item> {
    let inner = field.trim_matches(|it| matches!(it, '[' | ']' | '(' | ')' | '{' | '}')).trim();
    let mut parts = inner.split(|it: char| it.is_whitespace() || matches!(it, ',' | ';' | '|'));
    let parts: Vec<&str> = parts.by_ref().filter(|part| !part.is_empty()).collect();
    let indices: Option<Vec<Item>> = parts.iter().map(|part| index(part)).collect();
    match indices {
        Some(indices) => indices,
        None => vec![Item::Name(field.to_owned())],
    }
}

/// A whole number; `1.0` and `0.000e+00` are some.
fn index(text: &str) -> Option<Item> {
    if let Ok(index) = text.parse() {
        return Some(Item::Index(index));
    }
    // No names of images: `1e5`, `nan`, `inf`.
    if !text.contains('.') {
        return None;
    }
    let value = text.parse::<f64>().ok().filter(|it| it.fract() == 0.0 && it.abs() < 1e15)?;
    #[expect(clippy::cast_possible_truncation, reason = "whole and below 2^53")]
    Some(Item::Index(value as i64))
}

/// Pairs where titles or names say so, else numbers in rows; or the row that is no pair.
fn content(rows: Vec<Vec<Vec<Item>>>, are_pairs: bool) -> Result<Content, usize> {
    let is_name = |item: &Item| matches!(item, Item::Name(_));
    let has_names = rows.iter().flatten().flatten().any(is_name);
    let is_single = rows.iter().all(|row| row.len() == 1);
    let has_lists = rows.iter().flatten().any(|cell| cell.len() > 1);
    if are_pairs || (has_names || has_lists) && !is_single {
        let pair = |(row, cells): (usize, Vec<Vec<Item>>)| {
            let mut cells = cells.into_iter();
            let query: [Item; 1] = cells.next().unwrap_or_default().try_into().map_err(|_| row)?;
            let [query] = query;
            Ok::<_, usize>((query, cells.flatten().collect()))
        };
        let rows = rows.into_iter().enumerate().map(pair).collect::<Result<_, _>>()?;
        return Ok(Content::Pairs { rows, is_complete: false });
    }
    let rows: Vec<Vec<Item>> = rows.into_iter().map(|row| row.concat()).collect();
    let n_columns = rows.first().map_or(0, Vec::len);
    if has_names || rows.iter().any(|row| row.len() != n_columns) {
        return Ok(Content::Lists(rows));
    }
    let number = |item: Item| match item {
        Item::Index(index) => index,
        Item::Name(_) => -1,
    };
    let n_rows = rows.len();
    let values = rows.into_iter().flatten().map(number).collect();
    Ok(Content::Grid(Grid { n_rows, n_columns, values, is_boolean: false }))
}
