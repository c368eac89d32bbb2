//! The table `street`.

use serde::{Deserialize, Serialize};

use crate::refusal::{Refusal, between, count};

/// A city whose avenues run north (+y) and are driven northwards, one after the other.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Street {
    /// Parallel avenues the route drives.
    pub avenues: usize,
    /// Distance between places, metres.
    pub spacing_m: f64,
    /// How unevenly the places lie: the drive is slower and faster by this share in turn, below 1.
    #[serde(skip_serializing_if = "is_even")]
    pub uneven: f64,
    /// Distance between cross streets, metres.
    #[serde(skip_serializing_if = "is_usual_block")]
    pub block_m: f64,
    /// Width of the roads between their kerbs, metres.
    #[serde(skip_serializing_if = "is_usual_road")]
    pub road_m: f64,
    /// How many kinds of houses there are.
    pub styles: usize,
    /// How many places share a look where `aliasing` has its way: 1 none.
    pub look_alikes: usize,
    /// Share of lots that repeat with the look-alikes.
    pub aliasing: f64,
    /// Share of places along the kerb that have a tree.
    pub trees: f64,
    /// Camera height above the road.
    pub eye_m: f64,
    /// Camera direction, degrees counter-clockwise from the direction of travel.
    pub heading_deg: f64,
    /// Further views on a grid around the references' route.
    pub grid: Option<Grid>,
}

/// True images at the places of a densified map: `rows` beside each other across the route and
/// `columns` along it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// Number of places across the route.
    pub rows: usize,
    /// Number of places along the route.
    pub columns: usize,
    /// Distance between them, metres.
    pub step_m: f64,
}

impl Default for Street {
    fn default() -> Self {
        Self {
            avenues: 3,
            spacing_m: 6.0,
            uneven: 0.0,
            block_m: BLOCK,
            road_m: ROAD,
            styles: 10,
            look_alikes: 1,
            aliasing: 0.0,
            trees: 0.45,
            eye_m: 1.9,
            heading_deg: 25.0,
            grid: None,
        }
    }
}

/// Usual distance between cross streets, metres.
const BLOCK: f64 = 92.0;
/// Usual width between kerbs, metres.
const ROAD: f64 = 11.2;

// Keys that came later are only written where they differ: recipes without them keep their folders.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde calls these")]
fn is_even(uneven: &f64) -> bool {
    *uneven == 0.0
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde calls these")]
fn is_usual_block(block: &f64) -> bool {
    *block == BLOCK
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde calls these")]
fn is_usual_road(road: &f64) -> bool {
    *road == ROAD
}

impl Street {
    pub(crate) fn check(&self) -> Result<(), Refusal> {
        count("street.avenues", self.avenues, 1, 40)?;
        count("street.styles", self.styles, 1, 200)?;
        count("street.look_alikes", self.look_alikes, 1, 1_000)?;
        between("street.spacing_m", self.spacing_m, 0.2, 200.0)?;
        between("street.uneven", self.uneven, 0.0, 0.95)?;
        between("street.block_m", self.block_m, 60.0, 400.0)?;
        between("street.road_m", self.road_m, 9.0, 20.0)?;
        between("street.aliasing", self.aliasing, 0.0, 1.0)?;
        between("street.trees", self.trees, 0.0, 1.0)?;
        between("street.eye_m", self.eye_m, 0.3, 6.0)?;
        if let Some(grid) = self.grid {
            count("street.grid.rows", grid.rows, 1, 200)?;
            count("street.grid.columns", grid.columns, 1, 200)?;
            between("street.grid.step_m", grid.step_m, 0.01, 50.0)?;
        }
        between("street.heading_deg", self.heading_deg, -180.0, 180.0)
    }
}
