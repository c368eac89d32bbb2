//! Tables of numbers that say where they come from.

mod arrange;
mod check;
mod csv_cell;
mod notes;
mod number;
mod page;
mod render;

#[cfg(test)]
mod tests;

use serde::{Deserialize, Serialize};
use vpr_core::Provenance;

pub use check::{Checked, Finding, check};
pub use number::p_value;
pub use page::{Drawings, csv_page, html_document, html_page, markdown_page, read_csv};
pub use render::{Format, WIDTH};

/// What stands in a cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Value {
    /// A number; fractions, not percent.
    Number(f64),
    /// A word, in the few tables that have words.
    Text(String),
}

impl From<f64> for Value {
    fn from(value: f64) -> Self {
        Self::Number(value)
    }
}

impl From<&str> for Value {
    fn from(value: &str) -> Self {
        Self::Text(value.to_owned())
    }
}

impl Value {
    /// The number, if it is one.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Number(value) => Some(*value),
            Self::Text(_) => None,
        }
    }
}

/// A 95 % interval of a value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// How it was found, such as `Wilson` or `bootstrap over queries`.
    pub method: String,
}

/// One number of a table, with everything needed to judge it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cell {
    /// Row label: a dataset, a metric.
    pub row: String,
    /// Column label: a technique, a quantity.
    pub column: String,
    /// Ours; null if absent.
    pub value: Option<Value>,
    /// What the thesis prints in this place; null if it prints nothing.
    pub thesis: Option<Value>,
    /// Which definition the value follows; null if there is only one.
    pub definition: Option<String>,
    /// Where the value comes from.
    pub provenance: Provenance,
    /// How many items (queries, pairs, curve points) the value rests on.
    pub n: usize,
    /// How sure the value is; null where that was not asked.
    pub interval: Option<Interval>,
    /// What a reader must know, or why it is absent.
    pub note: Option<String>,
    /// Whether a paired test on the same queries tells it from every other of its row.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub best: bool,
    /// Whether it differs from run to run (a timing): printed, but kept out of pages and checks.
    #[serde(skip)]
    pub volatile: bool,
    /// Whether the note is one cell's own and would only clutter a page's footnotes.
    #[serde(skip)]
    pub quiet: bool,
}

impl Cell {
    /// A value with its origin; `n` is the number of items it rests on.
    #[must_use]
    pub fn new(
        row: impl Into<String>,
        column: impl Into<String>,
        value: impl Into<Value>,
        provenance: Provenance,
        n: usize,
    ) -> Self {
        Self {
            row: row.into(),
            column: column.into(),
            value: Some(value.into()),
            thesis: None,
            definition: None,
            provenance,
            n,
            interval: None,
            note: None,
            best: false,
            volatile: false,
            quiet: false,
        }
    }

    /// A cell without a value, and why.
    #[must_use]
    pub fn absent(
        row: impl Into<String>,
        column: impl Into<String>,
        note: impl Into<String>,
    ) -> Self {
        Self {
            value: None,
            provenance: Provenance::Absent,
            note: Some(note.into()),
            ..Self::new(row, column, 0.0, Provenance::Absent, 0)
        }
    }

    /// Names the definition it follows.
    #[must_use]
    pub fn defined(mut self, definition: impl ToString) -> Self {
        self.definition = Some(definition.to_string());
        self
    }

    /// Adds a remark.
    #[must_use]
    pub fn noted(mut self, note: impl Into<String>) -> Self {
        self.note = Some(note.into());
        self
    }

    /// Says how sure the value is: its 95 % interval and how that was found.
    #[must_use]
    pub fn within(mut self, low: f64, high: f64, method: &str) -> Self {
        self.interval = Some(Interval { low, high, method: method.to_owned() });
        self
    }

    /// Marks a timing.
    #[must_use]
    pub fn timing(mut self) -> Self {
        self.volatile = true;
        self
    }

    /// What tells it from every other cell of its table.
    pub(crate) fn key(&self) -> (&str, &str, Option<&str>, Provenance) {
        (&self.row, &self.column, self.definition.as_deref(), self.provenance)
    }

    /// Whether it is the same quantity as the thesis' value beside it: same definition, real data.
    fn is_comparable(&self) -> bool {
        matches!(self.provenance, Provenance::Published | Provenance::Measured)
            && self.definition.as_deref().is_none_or(|it| it == "published")
    }
}

/// How the thesis prints its numbers, and so when ours agrees.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Rounding {
    /// To the nearest last digit.
    Rounded,
    /// Digits after the last cut off, as table 3.5 does.
    Truncated,
}

impl Rounding {
    /// Whether `value`, printed with this many decimals, reads like `thesis`.
    #[must_use]
    pub fn agrees(self, value: f64, thesis: f64, decimals: u32) -> bool {
        let unit = 10_f64.powi(-decimals.cast_signed());
        match self {
            Self::Rounded => (value - thesis).abs() <= 0.5 * unit * (1.0 + 1e-9),
            // A value a hair below a printed digit is that digit: 0.69999999999 is 0.70.
            Self::Truncated => {
                let scaled = value / unit;
                (scaled + 1e-9).floor() == (thesis / unit).round()
            }
        }
    }
}

/// A table or the numbers behind a figure.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Table {
    /// `table-3.5`, `figure-3.19`, ….
    pub id: String,
    /// One line that says what the numbers are.
    pub title: String,
    /// All cells; rows and columns print in order of first appearance.
    pub cells: Vec<Cell>,
    /// Decimals the thesis prints and how it gets them; `None` if agreement is not judged.
    #[serde(skip)]
    pub rounding: Option<(Rounding, u32)>,
}

impl Table {
    /// An empty table.
    #[must_use]
    pub fn new(id: impl Into<String>, title: impl Into<String>) -> Self {
        Self { id: id.into(), title: title.into(), cells: Vec::new(), rounding: None }
    }

    /// Adds a cell.
    pub fn push(&mut self, cell: Cell) {
        self.cells.push(cell);
    }

    /// Whether a cell reads like the thesis; `None` if the two are not the same quantity.
    #[must_use]
    pub fn agrees(&self, cell: &Cell) -> Option<bool> {
        let (rounding, decimals) = self.rounding?;
        match (cell.value.as_ref()?, cell.thesis.as_ref()?) {
            _ if !cell.is_comparable() => None,
            (Value::Number(value), Value::Number(thesis)) => {
                Some(rounding.agrees(*value, *thesis, decimals))
            }
            (Value::Text(value), Value::Text(thesis)) => Some(value == thesis),
            _ => Some(false),
        }
    }

    /// How many of the thesis' numbers ours read like, and how many are the same quantity.
    #[must_use]
    pub fn agreement(&self) -> (usize, usize) {
        let judged: Vec<bool> = self.cells.iter().filter_map(|cell| self.agrees(cell)).collect();
        (judged.iter().filter(|agrees| **agrees).count(), judged.len())
    }

    /// This table in one of the four formats, ending in a newline, for lines of [`WIDTH`] letters.
    #[must_use]
    pub fn render(&self, format: Format) -> String {
        render::render(self, format, WIDTH)
    }

    /// As [`Self::render`], for lines of another width: a wider table is cut into parts of its
    /// columns, or row by row.
    #[must_use]
    pub fn render_within(&self, format: Format, width: usize) -> String {
        render::render(self, format, width)
    }
}
