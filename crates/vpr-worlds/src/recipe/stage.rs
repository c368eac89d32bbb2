//! The table `stage`.

use serde::{Deserialize, Serialize};

/// One of the setups of section 3.2.5.
///
/// The one reference is the first place, unvaried; the queries are first all variations of it and
/// then the same variations of the other place, for which nothing is correct. A curve of figures
/// 3.19 to 3.21 is the score of either half against the reference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stage {
    /// Which setup, and what varies in it.
    pub kind: StageKind,
}

/// The setups.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StageKind {
    /// Point Features: every viewpoint under every light, 4 522 images.
    LightStage,
    /// Point Features: 119 viewpoints of a toy town under its first light.
    LightStageViewpoints,
    /// Point Features: the 19 lights of table 3.4 seen from the first viewpoint.
    LightStageLights,
    /// QUT multi-lane: five lanes 1.2 m apart, three steps of 3.5 m.
    MultiLane,
    /// MIT multi-illumination: 25 directions of a flash that bounces off walls and ceiling.
    MultiIllumination,
}
