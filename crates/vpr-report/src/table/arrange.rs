//! A table as blocks that are no wider than the page: whole, in parts of its columns, or row by row.

use super::{Cell, Table, notes::Notes, number};
use vpr_core::Provenance;

/// Between two columns, borders included.
const BETWEEN: usize = 3;
/// Fewest columns beside the labels for which a table is cut into parts; with fewer, every row
/// becomes a block of its own.
const WORTH: usize = 3;

/// Lines under a header.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Block {
    /// The row it is about, if it is one.
    pub(super) heading: Option<String>,
    pub(super) header: Vec<String>,
    pub(super) lines: Vec<Vec<String>>,
    /// How many of the first columns are labels.
    pub(super) n_labels: usize,
}

/// A table of one line per row, definition and origin; a line with the thesis' values above them.
pub(super) struct Pivot<'a> {
    columns: Vec<&'a str>,
    lines: Vec<Line<'a>>,
    has_definitions: bool,
    pub(super) notes: Notes,
    pub(super) has_best: bool,
}

struct Line<'a> {
    row: &'a str,
    origin: String,
    definition: Option<&'a str>,
    /// One per column; empty where there is no cell.
    entries: Vec<String>,
}

/// How the best of a row is made to stand out.
pub(super) type Emphasis = fn(String) -> String;

impl<'a> Pivot<'a> {
    pub(super) fn new(table: &'a Table, emphasis: Emphasis) -> Self {
        let columns = in_order(table.cells.iter().map(|cell| cell.column.as_str()));
        let notes = Notes::of(table);
        let (mut lines, mut has_best) = (Vec::new(), false);
        for row in in_order(table.cells.iter().map(|cell| cell.row.as_str())) {
            let cells: Vec<&Cell> = table.cells.iter().filter(|cell| cell.row == row).collect();
            if cells.iter().any(|cell| cell.thesis.is_some()) {
                let thesis = |column: &&str| {
                    let cell =
                        cells.iter().find(|cell| cell.column == *column && cell.thesis.is_some());
                    cell.and_then(|cell| cell.thesis.as_ref())
                        .map_or_else(String::new, number::text)
                };
                let entries = columns.iter().map(thesis).collect();
                lines.push(Line { row, origin: "thesis".to_owned(), definition: None, entries });
            }
            let groups =
                in_order(cells.iter().map(|cell| (cell.provenance, cell.definition.as_deref())));
            for (provenance, definition) in groups {
                let of_group = |cell: &&&Cell| {
                    (cell.provenance, cell.definition.as_deref()) == (provenance, definition)
                };
                let group: Vec<&Cell> = cells.iter().filter(of_group).copied().collect();
                has_best |= group.iter().any(|cell| cell.best);
                let entry = |column: &&str| {
                    let cell = group.iter().find(|cell| cell.column == *column);
                    cell.map_or_else(String::new, |cell| {
                        let text = entry(table, cell);
                        (if cell.best { emphasis(text) } else { text }) + &notes.mark(cell)
                    })
                };
                let entries = columns.iter().map(entry).collect();
                lines.push(Line { row, origin: provenance.to_string(), definition, entries });
            }
        }
        let has_definitions = table.cells.iter().any(|cell| cell.definition.is_some());
        Self { columns, lines, has_definitions, notes, has_best }
    }

    /// The table as blocks of at most `limit` letters where that can be.
    pub(super) fn blocks(&self, limit: usize) -> Vec<Block> {
        let whole = self.whole();
        if width(&whole) <= limit {
            return vec![whole];
        }
        let labels = whole.n_labels;
        let parts = parts(&whole, limit);
        let is_worth = parts.iter().all(|part| width(part) <= limit)
            && parts.iter().rev().skip(1).all(|part| part.header.len() >= labels + WORTH);
        if is_worth {
            return parts;
        }
        in_order(self.lines.iter().map(|line| line.row))
            .into_iter()
            .flat_map(|row| self.row(row, limit))
            .collect()
    }

    fn whole(&self) -> Block {
        let labels = ["", "origin"].into_iter().chain(self.has_definitions.then_some("definition"));
        let header: Vec<String> =
            labels.map(str::to_owned).chain(self.columns.iter().map(|it| self.head(it))).collect();
        let lines = self.lines.iter().map(|line| {
            let mut cells = vec![line.row.to_owned(), line.origin.clone()];
            cells.extend(self.has_definitions.then(|| line.definition.unwrap_or("").to_owned()));
            cells.extend(line.entries.iter().cloned());
            cells
        });
        let n_labels = 2 + usize::from(self.has_definitions);
        Block { heading: None, lines: lines.collect(), header, n_labels }
    }

    fn head(&self, column: &str) -> String {
        format!("{column}{}", self.notes.mark_of_column(column))
    }

    /// One row, whichever way up takes fewer lines.
    fn row(&self, row: &str, limit: usize) -> Vec<Block> {
        let lines: Vec<&Line<'_>> = self.lines.iter().filter(|line| line.row == row).collect();
        let used: Vec<usize> = (0..self.columns.len())
            .filter(|&column| lines.iter().any(|line| !line.entries[column].is_empty()))
            .collect();
        let label = |line: &Line<'_>| match line.definition {
            Some(definition) => format!("{}, {definition}", line.origin),
            None => line.origin.clone(),
        };
        let heads = || used.iter().map(|&column| self.head(self.columns[column]));
        let upright = Block {
            heading: Some(row.to_owned()),
            header: std::iter::once(String::new()).chain(heads()).collect(),
            lines: lines
                .iter()
                .map(|line| {
                    let entries = used.iter().map(|&column| line.entries[column].clone());
                    std::iter::once(label(line)).chain(entries).collect()
                })
                .collect(),
            n_labels: 1,
        };
        let turned = Block {
            heading: Some(row.to_owned()),
            header: std::iter::once(String::new())
                .chain(lines.iter().map(|line| label(line)))
                .collect(),
            lines: heads()
                .zip(&used)
                .map(|(head, &column)| {
                    let entries = lines.iter().map(|line| line.entries[column].clone());
                    std::iter::once(head).chain(entries).collect()
                })
                .collect(),
            n_labels: 1,
        };
        let (upright, turned) = (parts(&upright, limit), parts(&turned, limit));
        let height = |parts: &[Block]| parts.iter().map(|it| it.lines.len() + 3).sum::<usize>();
        if height(&upright) < height(&turned) { upright } else { turned }
    }
}

/// Letters of a block's longest line.
fn width(block: &Block) -> usize {
    widths(block).into_iter().map(|it| it + BETWEEN).sum::<usize>() + 1
}

fn widths(block: &Block) -> Vec<usize> {
    let longest = |column: usize| {
        let cells = block.lines.iter().map(|line| &line[column]);
        cells.chain([&block.header[column]]).map(|it| it.chars().count()).max().unwrap_or(0)
    };
    (0..block.header.len()).map(longest).collect()
}

/// A block in parts of as many columns as fit, each with all labels; lines without an entry in a
/// part are left out of it.
fn parts(block: &Block, limit: usize) -> Vec<Block> {
    let widths = widths(block);
    let (labels, rest) = widths.split_at(block.n_labels);
    let label_width: usize = labels.iter().map(|it| it + BETWEEN).sum::<usize>() + 1;
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let mut room = 0;
    for (index, width) in rest.iter().enumerate() {
        let column = block.n_labels + index;
        let needed = width + BETWEEN;
        match groups.last_mut() {
            Some(group) if needed <= room => group.push(column),
            _ => {
                groups.push(vec![column]);
                room = limit.saturating_sub(label_width);
            }
        }
        room = room.saturating_sub(needed);
    }
    if groups.is_empty() {
        return vec![block.clone()];
    }
    let part = |(nth, group): (usize, Vec<usize>)| {
        let pick = |line: &[String]| -> Vec<String> {
            let columns = (0..block.n_labels).chain(group.iter().copied());
            columns.map(|column| line[column].clone()).collect()
        };
        let is_told = |line: &&Vec<String>| group.iter().any(|&it| !line[it].is_empty());
        Block {
            heading: block.heading.clone().filter(|_| nth == 0),
            header: pick(&block.header),
            lines: block.lines.iter().filter(is_told).map(|line| pick(line)).collect(),
            n_labels: block.n_labels,
        }
    };
    groups.into_iter().enumerate().map(part).collect()
}

/// Value, interval and agreement mark of one cell.
fn entry(table: &Table, cell: &Cell) -> String {
    let value = match (&cell.value, cell.provenance) {
        (Some(value), _) => number::with_interval(value, cell.interval.as_ref()),
        (None, Provenance::Absent) => "absent".to_owned(),
        (None, _) => "–".to_owned(),
    };
    let mark = match table.agrees(cell) {
        Some(true) => " ✓",
        Some(false) => " ✗",
        None => "",
    };
    format!("{value}{mark}")
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
