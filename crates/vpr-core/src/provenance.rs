//! Where a number comes from.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Where a number comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Provenance {
    /// Computed here from files the author of the thesis published (scores, ground truths), or
    /// stated there.
    Published,
    /// Computed here from real images.
    Measured,
    /// Computed here from generated images.
    Generated,
    /// Not computed: the data is not at hand. The value is null.
    Absent,
}

impl fmt::Display for Provenance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Published => "published",
            Self::Measured => "measured",
            Self::Generated => "generated",
            Self::Absent => "absent",
        })
    }
}
