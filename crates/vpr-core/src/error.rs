//! What can be wrong with the input of this crate.

use std::{io, path::PathBuf};

/// The result of every fallible function here.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Wrong input: a file, a shape, a parameter. Broken invariants of our own code panic instead.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused.
    #[error("{}", path.display())]
    Io {
        /// File or folder that was asked for.
        path: PathBuf,
        /// Why it was refused.
        source: io::Error,
    },
    /// A file is not what its format promises.
    #[error("{}: {place}: {reason}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// Where in it: a byte offset, a line, a row, a key.
        place: String,
        /// What is wrong there.
        reason: String,
    },
    /// A descriptor, position or score is NaN or infinite.
    #[error("{what}: row {row}, column {column} is {value}, not a finite number")]
    NotFinite {
        /// What the rows are.
        what: &'static str,
        /// Row of the first such value.
        row: usize,
        /// Column of the first such value.
        column: usize,
        /// The value itself.
        value: f64,
    },
    /// Two things that belong together differ in length or dimension.
    #[error("{what}: expected {expected}, got {actual}")]
    Mismatch {
        /// What was counted.
        what: &'static str,
        /// What the other side has.
        expected: usize,
        /// What was given.
        actual: usize,
    },
    /// Something that must have at least one element has none.
    #[error("no {0}")]
    Empty(&'static str),
    /// What must be there once is there twice.
    #[error("{kind} `{name}` stands in rows {} and {}", rows[0], rows[1])]
    Repeated {
        /// What it is.
        kind: &'static str,
        /// Its name.
        name: String,
        /// Two of the rows it stands in, counted from 0.
        rows: [usize; 2],
    },
    /// An index points outside of what it refers to.
    #[error("{what} {index}: only {len} exist")]
    OutOfRange {
        /// What the index refers to.
        what: &'static str,
        /// The index.
        index: usize,
        /// How many there are.
        len: usize,
    },
    /// A method needs another kind of pose than the map has.
    #[error("needs {needed} poses, the map has {actual}")]
    PoseKind {
        /// The kind it needs.
        needed: &'static str,
        /// The kind there is.
        actual: &'static str,
    },
    /// A parameter is out of range; the name is the one the user typed.
    #[error("`{name}` = {value}: {reason}")]
    Parameter {
        /// The parameter.
        name: &'static str,
        /// Its value, as text.
        value: String,
        /// Which values are allowed.
        reason: &'static str,
    },
    /// A metric has no value for this input.
    #[error("{metric} is undefined: {reason}")]
    Undefined {
        /// The metric.
        metric: &'static str,
        /// Why it is undefined.
        reason: &'static str,
    },
    /// No dataset, technique or experiment has this name.
    #[error("unknown {kind} `{name}`; known: {known}")]
    Unknown {
        /// What was looked for.
        kind: &'static str,
        /// The name that was given.
        name: String,
        /// The names there are.
        known: String,
    },
}

impl From<vpr_files::Error> for Error {
    fn from(error: vpr_files::Error) -> Self {
        match error {
            vpr_files::Error::Io { path, source } => Self::Io { path, source },
            vpr_files::Error::Format { path, place, reason } => {
                Self::Format { path, place, reason }
            }
        }
    }
}

impl Error {
    /// An [`Error::Io`] for `path`; for use in `map_err`.
    pub fn io(path: impl Into<PathBuf>) -> impl FnOnce(io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { path, source }
    }

    /// The same error, naming the file its input came from if it names none itself.
    #[must_use]
    pub fn in_file(self, path: impl Into<PathBuf>) -> Self {
        match self {
            Self::Io { .. } | Self::Format { .. } => self,
            other => Self::format(path, "content", other.to_string()),
        }
    }

    /// An [`Error::Format`].
    pub fn format(
        path: impl Into<PathBuf>,
        place: impl Into<String>,
        reason: impl Into<String>,
    ) -> Self {
        Self::Format { path: path.into(), place: place.into(), reason: reason.into() }
    }
}
