//! Which references are correct: one reader for all the ways in which people write it down.
//!
//! A file is a list of references per query, pairs, or a matrix, as an array, an archive, a pickle,
//! JSON or text; which of them it is follows from its shape and from how many queries and references
//! there are. What could be read in two ways that differ is refused with the flag that decides, or,
//! where one way is usual, read that way and noted. Truths without such a file: [`Labels`], and the
//! same index on both sides, see [`Source`].
//!
//! ```
//! use vpr_data::truth::{self, Reading, Side, Sides};
//!
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("truth.csv");
//! std::fs::write(&path, "query,reference\n0,1\n0,2\n1,0\n")?;
//! let sides = Sides { queries: Side::numbered(3), references: Side::numbered(4) };
//! let found = truth::read(&path, &Reading::default(), &sides)?;
//! assert_eq!(found.truth.correct(0), [1, 2]);
//! assert_eq!(found.notes.len(), 1, "query 2 is in no pair, which is said");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod archive;
mod check;
mod content;
mod file;
mod formats;
mod grid;
mod json;
mod labels;
mod names;
mod positions;
mod resolve;
mod scores;
mod side;
mod task;
mod text;
mod value;

use std::{
    fmt,
    path::{Path, PathBuf},
};

use vpr_core::{Error, GroundTruth, Result};
use vpr_files::{npy, pickle};

use content::Said;
use resolve::resolve;
use task::{Lists, Task};

pub(crate) use check::problems;
pub use file::GroundTruthFile;
pub use formats::FORMATS;
pub use labels::Labels;
pub use scores::{Scale, read_scores};
pub use side::{Side, Sides};

/// How numbers in rows and columns are meant, where they could be several things.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// A row per query with its references, filled up with −1.
    Lists,
    /// Rows of a query and a reference, or several.
    Pairs,
    /// Truth values, queries × references or the transpose.
    Matrix,
}

/// What the rows of a square matrix are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rows {
    /// One per query.
    Queries,
    /// One per reference.
    References,
}

/// How a file is to be read; the default leaves it to the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    /// The array of an archive, the entry of a dictionary.
    pub key: Option<String>,
    /// What numbers in rows and columns are.
    pub form: Option<Form>,
    /// What the rows of a square matrix are.
    pub rows: Option<Rows>,
    /// How near positions must be, in metres, the limit included; for files that have positions.
    pub radius: f64,
}

/// Where a truth is from, other than positions with a radius.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// A file, and how it is to be read.
    File(PathBuf, Reading),
    /// Places by label.
    Labels(Labels),
    /// A reference is correct if its index is that of the query, give or take so many.
    SameIndex(usize),
}

/// A truth, and what a person should know of how it was read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// The correct references of every query.
    pub truth: GroundTruth,
    /// One line each.
    pub notes: Vec<String>,
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path, _) => write!(f, "as {} has them", path.display()),
            Self::Labels(Labels::Folders) => f.write_str("those in folders of the same name"),
            Self::Labels(Labels::File { path, .. }) => {
                write!(f, "those with the same label in {}", path.display())
            }
            Self::SameIndex(0) => f.write_str("the one with the same index"),
            Self::SameIndex(n) => write!(f, "those with the same index, give or take {n}"),
        }
    }
}

impl Form {
    /// The name that is typed.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Lists => "lists",
            Self::Pairs => "pairs",
            Self::Matrix => "matrix",
        }
    }
}

impl Rows {
    /// The name that is typed.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Queries => "queries",
            Self::References => "references",
        }
    }
}

impl Default for Reading {
    fn default() -> Self {
        Self { key: None, form: None, rows: None, radius: 25.0 }
    }
}

impl Source {
    /// The truth for these images.
    ///
    /// # Errors
    ///
    /// Those of [`read`] and of [`Labels::truth`].
    pub fn truth(&self, sides: &Sides) -> Result<Found> {
        match self {
            Self::File(path, reading) => read(path, reading, sides),
            Self::Labels(labels) => labels.truth(sides),
            &Self::SameIndex(tolerance) => {
                let (n_queries, n_references) = (sides.queries.len, sides.references.len);
                let truth = GroundTruth::within_frames(n_queries, n_references, tolerance);
                let mut notes = Vec::new();
                if n_queries != n_references {
                    notes.push(format!(
                        "{n_queries} queries and {n_references} references are compared by index"
                    ));
                }
                Ok(Found { truth, notes })
            }
        }
    }
}

/// Reads which references are correct for which query.
///
/// # Errors
///
/// As [`read_lists`]; [`Error::Format`] for a negative index that means nothing.
pub fn read(path: &Path, reading: &Reading, sides: &Sides) -> Result<Found> {
    let (file, mut notes) = read_lists(path, reading, sides)?;
    let n_references = sides.references.len;
    let (truth, n_clamped) = file.truth(n_references)?;
    if n_clamped > 0 {
        notes.push(format!(
            "{}: {n_clamped} entries point past the {n_references} references and are dropped",
            path.display()
        ));
    }
    Ok(Found { truth, notes })
}

/// Reads the lists of a file as it has them, and what a person should know of how they were read.
///
/// # Errors
///
/// [`Error::Io`]; [`Error::Format`] with the row, line or array that is malformed, for another
/// number of queries than there are, for names that no image has, and for what could be meant in
/// two ways.
pub fn read_lists(
    path: &Path,
    reading: &Reading,
    sides: &Sides,
) -> Result<(GroundTruthFile, Vec<String>)> {
    let task = Task { path, reading, sides };
    let (lists, notes) = match kind(path)? {
        Kind::Archive => archive::read(task)?,
        Kind::Array => of_value(task, npy::read_value(path)?)?,
        Kind::Pickle => of_value(task, pickle::read(path)?)?,
        Kind::Json => of_value(task, json::read(path, &bytes(path)?)?)?,
        Kind::Text => {
            no_key(task)?;
            resolve(task, text::read(path, &bytes(path)?)?)?
        }
    };
    let name = path.display();
    let notes = notes.into_iter().map(|note| format!("{name}: {note}")).collect();
    Ok((GroundTruthFile { path: path.to_owned(), lists }, notes))
}

fn of_value(task: Task<'_>, value: pickle::Value) -> Result<(Lists, Vec<String>)> {
    // An array of no axes around a dictionary is what `numpy.save` makes of one.
    let value = match value {
        pickle::Value::Array { shape, elements: pickle::Elements::Object(mut values) }
            if shape.is_empty() && values.len() == 1 =>
        {
            values.pop().unwrap_or(pickle::Value::None)
        }
        other => other,
    };
    match (value, task.reading.key.as_deref()) {
        (pickle::Value::Dict(entries), Some(key)) => archive::entry(task, entries, key),
        (value, None) => {
            let content = value::content_of(value).map_err(|reason| task.err("content", reason))?;
            resolve(task, Said::of(content))
        }
        (_, Some(_)) => no_key(task).map(|()| (Vec::new(), Vec::new())),
    }
}

/// Refuses a key for a file that has none.
fn no_key(task: Task<'_>) -> Result<()> {
    match &task.reading.key {
        None => Ok(()),
        Some(key) => {
            let reason = "the file has no arrays by name";
            Err(task.err(format!("array `{}`", vpr_files::shorten(key)), reason))
        }
    }
}

fn bytes(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).map_err(Error::io(path))
}

/// Kinds of files, told apart by how they begin.
#[derive(Clone, Copy)]
enum Kind {
    Array,
    Archive,
    Pickle,
    Json,
    Text,
}

fn kind(path: &Path) -> Result<Kind> {
    use std::io::Read as _;
    let mut start = Vec::new();
    let file = std::fs::File::open(path).map_err(Error::io(path))?;
    file.take(64).read_to_end(&mut start).map_err(Error::io(path))?;
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    let first = start.iter().find(|byte| !byte.is_ascii_whitespace());
    Ok(match extension.as_str() {
        "npy" => Kind::Array,
        "npz" => Kind::Archive,
        "pkl" | "pickle" => Kind::Pickle,
        "json" => Kind::Json,
        "csv" | "tsv" => Kind::Text,
        _ if start.starts_with(b"\x93NUMPY") => Kind::Array,
        _ if start.starts_with(b"PK\x03\x04") => Kind::Archive,
        _ if start.starts_with(b"\x80") => Kind::Pickle,
        _ if first.is_some_and(|byte| matches!(byte, b'[' | b'{')) => Kind::Json,
        _ => Kind::Text,
    })
}
