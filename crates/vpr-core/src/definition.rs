//! Which of several definitions a number follows.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Where released code and its own intent differ, both definitions exist under these names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Definition {
    /// Exactly as the released code computes it, defects included.
    Published,
    /// As the thesis' text or the metric's own intent says.
    Corrected,
}

impl fmt::Display for Definition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Published => "published",
            Self::Corrected => "corrected",
        })
    }
}
