//! The table `campus`.

use serde::{Deserialize, Serialize};

use crate::refusal::{Refusal, between};

/// A path that runs north (+y) through a university campus, part of it under a roof.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Campus {
    /// Distance between places, metres.
    pub spacing_m: f64,
    /// Share of the path that runs under an arcade.
    pub arcades: f64,
    /// Width of the path, metres.
    pub path_m: f64,
    /// Camera height, metres.
    pub eye_m: f64,
    /// Share of buildings that look like one of two models.
    pub aliasing: f64,
}

impl Default for Campus {
    fn default() -> Self {
        Self { spacing_m: 1.6, arcades: 0.25, path_m: 5.0, eye_m: 1.6, aliasing: 0.0 }
    }
}

impl Campus {
    pub(crate) fn check(&self) -> Result<(), Refusal> {
        between("campus.spacing_m", self.spacing_m, 0.1, 100.0)?;
        between("campus.arcades", self.arcades, 0.0, 1.0)?;
        between("campus.path_m", self.path_m, 1.0, 20.0)?;
        between("campus.eye_m", self.eye_m, 0.2, 4.0)?;
        between("campus.aliasing", self.aliasing, 0.0, 1.0)
    }
}
