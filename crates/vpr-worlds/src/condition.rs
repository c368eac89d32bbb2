//! The nuisances of one traverse, as numbers.

use serde::{Deserialize, Serialize};

use crate::refusal::{Refusal, between};

/// Light, weather, season and traffic of one traverse.
///
/// All shares are 0 to 1 and 0 means "absent".
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Condition {
    /// 0 noon, 1 night: daylight falls by three powers of ten.
    pub darkness: f64,
    /// Share of the sky under clouds; takes the sun's shadows with it.
    pub cloud: f64,
    /// Height of the sun above the horizon, degrees.
    pub sun_elevation_deg: f64,
    /// Direction of the sun, degrees clockwise from north (+y).
    pub sun_azimuth_deg: f64,
    /// Distance at which contrast has fallen to 2 %, metres.
    pub visibility_m: f64,
    /// Share of level ground under snow.
    pub snow: f64,
    /// Snow or rain in the air.
    pub falling: f64,
    /// 0 green leaves, 1 golden ones.
    pub autumn: f64,
    /// 0 with leaves, 1 without.
    pub bare: f64,
    /// Share of parking bays taken and of people's places filled.
    pub traffic: f64,
    /// Share of the image's width that people and vans right in front of the camera hide.
    pub occlusion: f64,
    /// Strength of lamps beside the camera at night.
    pub headlights: f64,
    /// Highest gain of the automatic exposure.
    pub max_gain: f64,
    /// Share of shop fronts, posters and furniture that are other ones than in the first traverse.
    pub changed: f64,
}

impl Default for Condition {
    fn default() -> Self {
        Self {
            darkness: 0.0,
            cloud: 0.25,
            sun_elevation_deg: 42.0,
            sun_azimuth_deg: 150.0,
            visibility_m: 2_500.0,
            snow: 0.0,
            falling: 0.0,
            autumn: 0.0,
            bare: 0.0,
            traffic: 0.5,
            occlusion: 0.0,
            headlights: 0.0,
            max_gain: 5.0,
            changed: 0.0,
        }
    }
}

impl Condition {
    pub(crate) fn check(&self) -> Result<(), Refusal> {
        let shares = [
            ("darkness", self.darkness),
            ("cloud", self.cloud),
            ("snow", self.snow),
            ("falling", self.falling),
            ("autumn", self.autumn),
            ("bare", self.bare),
            ("traffic", self.traffic),
            ("occlusion", self.occlusion),
            ("changed", self.changed),
        ];
        for (name, value) in shares {
            between(name, value, 0.0, 1.0)?;
        }
        between("sun_elevation_deg", self.sun_elevation_deg, 1.0, 90.0)?;
        between("sun_azimuth_deg", self.sun_azimuth_deg, 0.0, 360.0)?;
        between("visibility_m", self.visibility_m, 1.0, 100_000.0)?;
        between("headlights", self.headlights, 0.0, 100.0)?;
        between("max_gain", self.max_gain, 0.1, 1_000.0)
    }
}
