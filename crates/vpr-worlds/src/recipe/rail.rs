//! The table `rail`.

use serde::{Deserialize, Serialize};

use crate::refusal::{Refusal, between};

/// A track that winds northwards (+y), seen from the driver's seat.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Rail {
    /// Distance between places along y, metres.
    pub spacing_m: f64,
    /// Share of the land under woods.
    pub woods: f64,
    /// Stations per kilometre.
    pub stations_per_km: f64,
    /// Tunnels per kilometre; images inside are nearly black.
    pub tunnels_per_km: f64,
    /// Height of the hills, metres.
    pub hills_m: f64,
    /// Camera height above the rails.
    pub eye_m: f64,
}

impl Default for Rail {
    fn default() -> Self {
        Self {
            spacing_m: 18.0,
            woods: 0.5,
            stations_per_km: 0.8,
            tunnels_per_km: 0.5,
            hills_m: 55.0,
            eye_m: 2.6,
        }
    }
}

impl Rail {
    pub(crate) fn check(&self) -> Result<(), Refusal> {
        between("rail.spacing_m", self.spacing_m, 0.5, 500.0)?;
        between("rail.woods", self.woods, 0.0, 1.0)?;
        between("rail.stations_per_km", self.stations_per_km, 0.0, 4.0)?;
        between("rail.tunnels_per_km", self.tunnels_per_km, 0.0, 4.0)?;
        between("rail.hills_m", self.hills_m, 0.0, 400.0)?;
        between("rail.eye_m", self.eye_m, 0.5, 6.0)
    }
}
