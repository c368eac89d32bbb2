//! What can be wrong with weights, networks and images.

use std::{fmt, path::PathBuf};

use crate::train::{Difference, listed};

/// The result of every fallible function here.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Wrong input of a network. Broken invariants of our own code panic instead.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// What `vpr-core` says: a file, a parameter, a name, a count.
    #[error(transparent)]
    Core(#[from] vpr_core::Error),
    /// The weights of a file are not those of the network.
    #[error("{}: {mismatch}", path.display())]
    Weights {
        /// The file.
        path: PathBuf,
        /// What does not fit.
        mismatch: Box<Mismatch>,
    },
    /// The folder of a training run is that of a run with other settings.
    #[error("{}", listed(folder, differences))]
    OtherRun {
        /// The folder.
        folder: PathBuf,
        /// Every setting that differs.
        differences: Vec<Difference>,
    },
    /// A device that is not there, or failed.
    #[error("device {device}: {reason}")]
    Device {
        /// Which.
        device: String,
        /// What it said.
        reason: String,
    },
    /// A pattern of a key is not a regular expression.
    #[error("key pattern `{pattern}`: {reason}")]
    Pattern {
        /// The pattern.
        pattern: String,
        /// Why it is none.
        reason: String,
    },
}

impl From<vpr_files::Error> for Error {
    fn from(err: vpr_files::Error) -> Self {
        Self::Core(err.into())
    }
}

impl From<Error> for vpr_core::Error {
    fn from(err: Error) -> Self {
        match err {
            Error::Core(err) => err,
            Error::Weights { path, mismatch } => Self::format(path, "keys", mismatch.to_string()),
            Error::OtherRun { folder, differences } => {
                let lines: Vec<String> = differences.iter().map(ToString::to_string).collect();
                let reason = format!("those of another run:\n{}", lines.join("\n"));
                Self::format(folder, "settings", reason)
            }
            Error::Device { device, reason } => Self::format("device", device, reason),
            Error::Pattern { pattern, reason } => {
                Self::format("key pattern", format!("`{pattern}`"), reason)
            }
        }
    }
}

/// The keys in which a file and a network differ, each list sorted.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Mismatch {
    /// Keys of the network that the file does not have.
    pub missing: Vec<String>,
    /// Keys of the file that the network does not have.
    pub unexpected: Vec<String>,
    /// Keys of both: shape in the network, shape in the file.
    pub shapes: Vec<(String, Vec<usize>, Vec<usize>)>,
}

impl Mismatch {
    /// Whether nothing differs.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.missing.is_empty() && self.unexpected.is_empty() && self.shapes.is_empty()
    }
}

impl fmt::Display for Mismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        /// How many keys of a kind a message lists.
        const LISTED: usize = 20;
        let mut first = true;
        let mut part = |what: &str, keys: &mut dyn ExactSizeIterator<Item = String>| {
            let (n_keys, separator) = (keys.len(), if first { "" } else { "; " });
            if n_keys == 0 {
                return Ok(());
            }
            first = false;
            let listed: Vec<_> = keys.take(LISTED).collect();
            let more = if n_keys > LISTED { ", …" } else { "" };
            write!(f, "{separator}{n_keys} {what}: {}{more}", listed.join(", "))
        };
        part("missing", &mut self.missing.iter().cloned())?;
        part("unexpected", &mut self.unexpected.iter().cloned())?;
        let shapes = self
            .shapes
            .iter()
            .map(|(key, network, file)| format!("{key} is {file:?}, the network's is {network:?}"));
        part("of another shape", &mut shapes.into_iter())
    }
}

impl Error {
    /// A [`vpr_core::Error::Format`] of the file at `path`.
    pub fn format(
        path: impl Into<PathBuf>,
        place: impl Into<String>,
        reason: impl Into<String>,
    ) -> Self {
        vpr_core::Error::format(path, place, reason).into()
    }
}
