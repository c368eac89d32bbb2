//! What can be wrong with a file.

use std::{
    io,
    path::{Path, PathBuf},
};

/// The result of every fallible function here.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// A file that cannot be read or written, or is not what its format promises.
#[derive(Debug, thiserror::Error)]
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
}

impl Error {
    /// An [`Error::Io`] for `path`; for use in `map_err`.
    pub fn io(path: impl Into<PathBuf>) -> impl FnOnce(io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { path, source }
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

/// Why bytes were not decoded.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("byte {offset}: {reason}")]
pub struct Refusal {
    /// Where the offending opcode, field or object starts.
    pub offset: usize,
    /// What is wrong with it.
    pub reason: String,
}

impl Refusal {
    /// The same as an error of the file at `path`, in which the decoded bytes start at byte `start`.
    #[must_use]
    pub fn in_file(self, path: &Path, start: usize) -> Error {
        Error::format(path, format!("byte {}", start + self.offset), self.reason)
    }
}

/// A name from a file, short enough for a message of one line.
#[must_use]
pub fn shorten(name: &str) -> String {
    let mut short: String = name.chars().take(60).flat_map(char::escape_debug).collect();
    if name.chars().nth(60).is_some() {
        short.push('…');
    }
    short
}
