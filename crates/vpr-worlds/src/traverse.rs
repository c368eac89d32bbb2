//! One pass through a world: what it was like, what it was taken with, and from where.

use std::path::Path;

use serde::{Deserialize, Serialize};
use vpr_core::Error;

use crate::{
    condition::Condition,
    film::Film,
    refusal::{Refusal, between},
};

/// One pass through a world.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Traverse {
    /// Light, weather, season, traffic.
    pub condition: Condition,
    /// Sensor and print.
    pub film: Film,
    /// Where the camera is beside the route.
    pub offset: Offset,
}

/// The camera against the place it belongs to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Offset {
    /// To the right of the route.
    pub lateral_m: f64,
    /// Along the route.
    pub forward_m: f64,
    /// Above the usual height.
    pub up_m: f64,
    /// To the left (counter-clockwise from above).
    pub yaw_deg: f64,
    /// Upwards.
    pub pitch_deg: f64,
    /// Largest random part of the five above, as a share of 1 m and 10°; drawn per image.
    pub jitter: f64,
}

impl Traverse {
    /// Checks all numbers; `path` is for messages.
    pub(crate) fn checked(&self, path: &Path) -> vpr_core::Result<()> {
        self.check().map_err(|refusal| Error::format(path, refusal.key, refusal.reason))
    }

    pub(crate) fn check(&self) -> Result<(), Refusal> {
        self.condition.check()?;
        self.film.check()?;
        self.offset.check()
    }
}

impl Offset {
    fn check(&self) -> Result<(), Refusal> {
        between("lateral_m", self.lateral_m, -50.0, 50.0)?;
        between("forward_m", self.forward_m, -100.0, 100.0)?;
        between("up_m", self.up_m, -1.2, 50.0)?;
        between("yaw_deg", self.yaw_deg, -180.0, 180.0)?;
        between("pitch_deg", self.pitch_deg, -60.0, 60.0)?;
        between("jitter", self.jitter, 0.0, 5.0)
    }
}
