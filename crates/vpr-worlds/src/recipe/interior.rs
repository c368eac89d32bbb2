//! The table `interior`.

use serde::{Deserialize, Serialize};

use crate::refusal::{Refusal, between, count};

/// Places indoors.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Interior {
    /// What is built.
    pub kind: Kind,
    /// Distance between places, metres.
    pub spacing_m: f64,
    /// Width of a corridor, metres.
    pub width_m: f64,
    /// Share of wall places that stay empty.
    pub blank: f64,
    /// Share of sections that look like one of two models.
    pub aliasing: f64,
    /// Places in each room (`rooms` only).
    pub places_per_room: usize,
    /// Camera height above the floor, metres.
    pub eye_m: f64,
}

/// What kind of interior.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// One long corridor.
    Corridor,
    /// Room after room.
    Rooms,
    /// Two parallel escalators up through a station, lanes 1.8 m apart.
    Escalator,
}

impl Default for Interior {
    fn default() -> Self {
        Self {
            kind: Kind::Corridor,
            spacing_m: 0.6,
            width_m: 2.4,
            blank: 0.35,
            aliasing: 0.0,
            places_per_room: 12,
            eye_m: 1.4,
        }
    }
}

impl Interior {
    pub(crate) fn check(&self) -> Result<(), Refusal> {
        between("interior.spacing_m", self.spacing_m, 0.02, 20.0)?;
        between("interior.width_m", self.width_m, 1.2, 12.0)?;
        between("interior.blank", self.blank, 0.0, 1.0)?;
        between("interior.aliasing", self.aliasing, 0.0, 1.0)?;
        count("interior.places_per_room", self.places_per_room, 2, 500)?;
        between("interior.eye_m", self.eye_m, 0.05, 2.2)
    }
}
