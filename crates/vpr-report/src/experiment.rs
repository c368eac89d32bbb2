//! Experiment files: what to run, on what, and what the thesis says.
//!
//! One TOML file per table or figure in `experiments/`. The study inside is typed by the chapter
//! that runs it, so a misspelled key is an error with file, line and column.

use std::path::Path;

use serde::{Deserialize, de::DeserializeOwned};

use crate::table::{Cell, Rounding, Table, Value};
use vpr_core::{Error, Provenance, Result};

/// One experiment; `S` is the chapter's own description of what to compute.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Experiment<S> {
    /// `table-3.5`; equals the file's name.
    pub id: String,
    /// One line that says what the numbers are.
    pub title: String,
    /// Where the thesis has it, and whose data it is.
    pub source: String,
    /// The crate whose program runs this file.
    pub chapter: String,
    /// Seed of every random draw.
    #[serde(default)]
    pub seed: u64,
    /// What to compute.
    pub study: S,
    /// What the thesis prints.
    pub thesis: Option<ThesisGrid>,
    /// Numbers that `--check` insists on, where the data is at hand.
    #[serde(default)]
    pub expect: Vec<Expectation>,
}

/// The numbers printed in the thesis and how it prints them.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ThesisGrid {
    /// Decimals printed; agreement is not judged without.
    pub decimals: Option<u32>,
    /// How the printed digits come about.
    #[serde(default = "rounded")]
    pub rounding: Rounding,
    /// Column labels.
    pub columns: Vec<String>,
    /// Rows in the order of the thesis.
    pub rows: Vec<GridRow>,
}

fn rounded() -> Rounding {
    Rounding::Rounded
}

/// Numbers by row and column.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// Column labels.
    pub columns: Vec<String>,
    /// Rows, each as wide as `columns`.
    pub rows: Vec<GridRow>,
}

/// One row of a [`Grid`]; `nan` where there is no number.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GridRow {
    /// Row label.
    pub name: String,
    /// One value per column.
    pub values: Vec<Value>,
}

impl Grid {
    /// A grid of one number.
    #[must_use]
    pub fn single(row: &str, column: &str, value: f64) -> Self {
        Self {
            columns: vec![column.to_owned()],
            rows: vec![GridRow { name: row.to_owned(), values: vec![Value::Number(value)] }],
        }
    }

    /// Row label, column label and value of every entry that has a value.
    pub fn entries(&self) -> impl Iterator<Item = (&str, &str, &Value)> {
        entries(&self.columns, &self.rows)
    }
}

impl ThesisGrid {
    /// Row label, column label and value of every entry that has a value.
    pub fn entries(&self) -> impl Iterator<Item = (&str, &str, &Value)> {
        entries(&self.columns, &self.rows)
    }
}

fn entries<'a>(
    columns: &'a [String],
    rows: &'a [GridRow],
) -> impl Iterator<Item = (&'a str, &'a str, &'a Value)> {
    rows.iter()
        .flat_map(move |row| {
            let labelled = columns.iter().zip(&row.values);
            labelled.map(|(column, value)| (row.name.as_str(), column.as_str(), value))
        })
        .filter(|(_, _, value)| value.number().is_none_or(|number| !number.is_nan()))
}

/// Numbers that must come out, from a stated oracle.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Expectation {
    /// Definition of the cells it is about.
    pub definition: Option<String>,
    /// Origin of the cells it is about.
    pub provenance: Provenance,
    /// Largest allowed absolute difference.
    pub tolerance: f64,
    /// The numbers.
    pub grid: Grid,
}

/// Reads and checks an experiment file.
///
/// # Errors
///
/// [`Error::Io`] if it cannot be read; [`Error::Format`] names line and column of what is wrong.
pub fn load<S: DeserializeOwned>(path: &Path) -> Result<Experiment<S>> {
    let text = std::fs::read_to_string(path).map_err(Error::io(path))?;
    let experiment: Experiment<S> = toml::from_str(&text).map_err(|err| {
        let start = err.span().map_or(0, |span| span.start);
        let line = text[..start].matches('\n').count() + 1;
        Error::format(path, format!("line {line}"), err.message().to_owned())
    })?;
    if path.file_stem().is_none_or(|stem| stem != experiment.id.as_str()) {
        let reason = format!("`{}` is not the name of the file", experiment.id);
        return Err(Error::format(path, "id", reason));
    }
    let grids = experiment.expect.iter().map(|it| (&it.grid.columns, &it.grid.rows));
    let thesis = experiment.thesis.iter().map(|it| (&it.columns, &it.rows));
    for (columns, rows) in grids.chain(thesis) {
        if let Some(row) = rows.iter().find(|row| row.values.len() != columns.len()) {
            let reason = format!("{} values for {} columns", row.values.len(), columns.len());
            return Err(Error::format(path, format!("row `{}`", row.name), reason));
        }
    }
    Ok(experiment)
}

impl<S> Experiment<S> {
    /// An experiment that no file describes, with nothing to compare it with.
    #[must_use]
    pub fn new(id: impl Into<String>, title: impl Into<String>, study: S) -> Self {
        Self {
            id: id.into(),
            title: title.into(),
            source: String::new(),
            chapter: String::new(),
            seed: 0,
            study,
            thesis: None,
            expect: Vec::new(),
        }
    }

    /// An empty table with this experiment's id, title and way of rounding.
    #[must_use]
    pub fn table(&self) -> Table {
        let mut table = Table::new(&self.id, &self.title);
        let grid = self.thesis.as_ref();
        table.rounding = grid.and_then(|grid| Some((grid.rounding, grid.decimals?)));
        table
    }

    /// Writes the thesis' values beside ours; where we have none, an absent cell holds it.
    pub fn fill_thesis(&self, table: &mut Table) {
        let Some(grid) = &self.thesis else { return };
        for (row, column, value) in grid.entries() {
            let mut is_here = false;
            for cell in table.cells.iter_mut().filter(|it| it.row == row && it.column == column) {
                cell.thesis = Some(value.clone());
                is_here = true;
            }
            if !is_here {
                let cell = Cell::absent(row, column, "nothing at hand computes it");
                table.push(Cell { thesis: Some(value.clone()), ..cell });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Study {
        neighbors: usize,
    }

    fn load_text(text: &str) -> Result<Experiment<Study>> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("table-0.toml");
        std::fs::write(&path, text).unwrap();
        load(&path)
    }

    const HEAD: &str = "id = \"table-0\"\ntitle = \"t\"\nsource = \"s\"\nchapter = \"bench\"\n";

    #[test]
    fn a_misspelled_key_is_named_with_its_line() {
        let err = load_text(&format!("{HEAD}[study]\nneigbors = 3\n")).unwrap_err().to_string();
        assert!(err.contains("line 6") && err.contains("neigbors"), "{err}");
    }

    #[test]
    fn the_id_is_the_file_name() {
        let text = HEAD.replace("table-0", "table-1") + "[study]\nneighbors = 3\n";
        assert!(load_text(&text).unwrap_err().to_string().contains("table-1"));
    }

    #[test]
    fn rows_are_as_wide_as_the_header() {
        let grid =
            "[thesis]\ncolumns = [\"a\", \"b\"]\nrows = [{ name = \"r\", values = [1.0] }]\n";
        let err = load_text(&format!("{HEAD}[study]\nneighbors = 3\n{grid}")).unwrap_err();
        assert!(err.to_string().contains("row `r`: 1 values for 2 columns"), "{err}");
    }

    #[test]
    fn missing_numbers_are_skipped() {
        let rows = vec![GridRow {
            name: "r".into(),
            values: vec![Value::Number(f64::NAN), Value::Number(2.0)],
        }];
        let grid = Grid { columns: vec!["a".into(), "b".into()], rows };
        assert_eq!(grid.entries().collect::<Vec<_>>(), [("r", "b", &Value::Number(2.0))]);
    }
}
