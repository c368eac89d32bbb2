//! Poses to regress descriptors at.

mod choice;
mod depth;
mod grid;

use nalgebra::{Isometry3, Translation3, Vector3};
use serde::{Deserialize, Serialize};
use vpr_core::{Error as CoreError, Pose};

pub use choice::disagreement;
pub use depth::{DepthView, behind};
pub use grid::Grid;

use crate::{Anchors, Error, Result};

/// The most targets that are taken for meant: at 512 values a row, 100 GB.
pub const MOST_TARGETS: usize = 50_000_000;

/// One pose to regress a descriptor at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Where, `world_from_camera`.
    pub pose: Pose,
    /// The anchor that it was placed from.
    pub home: usize,
}

/// In whose axes an offset is given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Frame {
    /// The camera's, x to the right, y down, z ahead: a turned world changes nothing
    #[default]
    Camera,
    /// The world's, as released
    World,
}

/// Poses to regress descriptors at, by number: none is held unless they are a list.
#[derive(Clone, Debug)]
pub struct Targets<'a> {
    anchors: &'a Anchors,
    placement: Placement,
}

#[derive(Clone, Debug)]
enum Placement {
    /// Offsets along world x and world y around every anchor.
    Around {
        x: Vec<f64>,
        y: Vec<f64>,
    },
    /// So many between two neighbouring anchors.
    Between {
        n: usize,
        segments: Vec<usize>,
    },
    Lane {
        offset: Vector3<f64>,
        frame: Frame,
    },
    Listed(Vec<Target>),
}

impl<'a> Targets<'a> {
    /// A grid in world x and y around every anchor, at its height and orientation (thesis §6.3.3).
    ///
    /// # Errors
    ///
    /// [`Error::TooMany`].
    pub fn around(anchors: &'a Anchors, grid: &Grid) -> Result<Self> {
        let [x, y] = grid.offsets()?;
        check_count(anchors.len() as u128 * x.len() as u128 * y.len() as u128)?;
        Ok(Self { anchors, placement: Placement::Around { x, y } })
    }

    /// One grid over the whole map, at multiples of `step_m` in world x and y: the points that lie
    /// at most `reach_m` from an anchor in the plane, each at the height and orientation of the
    /// nearest (thesis §6.2.1, second possibility).
    ///
    /// # Errors
    ///
    /// [`CoreError::Parameter`] for a step or a reach that is not positive, [`Error::TooMany`].
    pub fn global(anchors: &'a Anchors, step_m: f64, reach_m: f64) -> Result<Self> {
        Ok(Self { anchors, placement: Placement::Listed(grid::global(anchors, step_m, reach_m)?) })
    }

    /// `n` poses between every two neighbours of a sequence, evenly: positions on a line,
    /// orientations on the shortest arc.
    ///
    /// # Errors
    ///
    /// [`Error::TooMany`].
    pub fn between(anchors: &'a Anchors, n: usize) -> Result<Self> {
        let has_next = |&anchor: &usize| anchor + 1 < anchors.sequence_of(anchor).end;
        let segments: Vec<usize> = (0..anchors.len()).filter(has_next).collect();
        check_count(segments.len() as u128 * n as u128)?;
        Ok(Self { anchors, placement: Placement::Between { n, segments } })
    }

    /// Every anchor moved by one offset in metres, as to a parallel lane.
    ///
    /// # Errors
    ///
    /// [`CoreError::Parameter`] if the offset is not finite.
    pub fn lane(anchors: &'a Anchors, offset: Vector3<f64>, frame: Frame) -> Result<Self> {
        if !offset.iter().all(|value| value.is_finite()) {
            let value = format!("{},{},{}", offset.x, offset.y, offset.z);
            let reason = "must be finite";
            return Err(CoreError::Parameter { name: "lane", value, reason }.into());
        }
        Ok(Self { anchors, placement: Placement::Lane { offset, frame } })
    }

    /// These poses, each placed from the anchor nearest in space.
    ///
    /// # Errors
    ///
    /// [`CoreError::NotFinite`] names the first pose that is not finite.
    pub fn listed(anchors: &'a Anchors, poses: &[Pose]) -> Result<Self> {
        vpr_core::Poses::SixDof(poses.to_vec()).check_finite()?;
        let target = |&pose: &Pose| {
            let home = anchors.nearest(pose.translation.vector.into(), 1)?[0];
            Ok(Target { pose, home })
        };
        let targets = poses.iter().map(target).collect::<Result<_>>()?;
        Ok(Self { anchors, placement: Placement::Listed(targets) })
    }

    /// Rows of the map that the anchors are from, each placed from the last anchor that is not
    /// behind it: the frames that an interpolation fills in. The last row of a sequence is placed
    /// from the anchor before it, rows before the first anchor from that. Anchors are in the order of
    /// their rows.
    ///
    /// # Errors
    ///
    /// [`CoreError::OutOfRange`] if a row does not exist.
    pub fn frames(anchors: &'a Anchors, poses: &[Pose], rows: &[usize]) -> Result<Self> {
        let target = |&row: &usize| {
            let none = CoreError::OutOfRange { what: "frame", index: row, len: poses.len() };
            let pose = *poses.get(row).ok_or(none)?;
            let last = anchors.rows().partition_point(|&anchor| anchor <= row).saturating_sub(1);
            // The end of a sequence lies behind its last segment, not before another.
            let sequence = anchors.sequence_of(last);
            let is_end = last + 1 == sequence.end && anchors.rows()[last] == row;
            let home = if is_end { last.saturating_sub(1).max(sequence.start) } else { last };
            Ok(Target { pose, home })
        };
        let targets = rows.iter().map(target).collect::<Result<_>>()?;
        Ok(Self { anchors, placement: Placement::Listed(targets) })
    }

    /// The anchors that they are placed from.
    #[must_use]
    pub fn anchors(&self) -> &'a Anchors {
        self.anchors
    }

    /// Number of targets.
    #[must_use]
    pub fn len(&self) -> usize {
        let n = self.anchors.len();
        match &self.placement {
            Placement::Around { x, y } => n * x.len() * y.len(),
            Placement::Between { n, segments } => n * segments.len(),
            Placement::Lane { .. } => n,
            Placement::Listed(targets) => targets.len(),
        }
    }

    /// Whether there is no target.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// One target: of a grid anchor by anchor, x by x, y by y.
    ///
    /// # Panics
    ///
    /// If `index` is not below [`Self::len`].
    #[must_use]
    pub fn get(&self, index: usize) -> Target {
        let poses = self.anchors.poses();
        match &self.placement {
            Placement::Around { x, y } => {
                let (rest, column) = (index / y.len(), index % y.len());
                let (home, row) = (rest / x.len(), rest % x.len());
                let moved = Translation3::new(x[row], y[column], 0.0);
                Target { pose: moved * poses[home], home }
            }
            Placement::Between { n, segments } => {
                let home = segments[index / n];
                let share = (1 + index % n) as f64 / (1 + n) as f64;
                Target { pose: between(&poses[home], &poses[home + 1], share), home }
            }
            Placement::Lane { offset, frame } => {
                let pose = poses[index];
                let offset = match frame {
                    Frame::Camera => pose.rotation * offset,
                    Frame::World => *offset,
                };
                Target { pose: Translation3::from(offset) * pose, home: index }
            }
            Placement::Listed(targets) => targets[index],
        }
    }

    /// All targets in order.
    #[must_use]
    pub fn iter(&self) -> impl ExactSizeIterator<Item = Target> {
        (0..self.len()).map(|index| self.get(index))
    }
}

/// The pose at this share of the way.
fn between(from: &Pose, to: &Pose, share: f64) -> Pose {
    let position = from.translation.vector.lerp(&to.translation.vector, share);
    // Half a turn has no shortest arc: the nearer of the two orientations stands in.
    let rotation = from.rotation.try_slerp(&to.rotation, share, 1e-9);
    let rotation = rotation.unwrap_or(if share < 0.5 { from.rotation } else { to.rotation });
    Isometry3::from_parts(position.into(), rotation)
}

fn check_count(n: u128) -> Result<()> {
    if n > MOST_TARGETS as u128 {
        return Err(Error::TooMany { n, most: MOST_TARGETS });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use nalgebra::UnitQuaternion;
    use vpr_core::Definition;

    use super::*;
    use crate::sequences;

    fn anchors(poses: &[Pose]) -> Anchors {
        Anchors::of_rows(poses, &[(0..poses.len()).collect()]).unwrap()
    }

    fn at(x: f64, y: f64, z: f64) -> Pose {
        Pose::translation(x, y, z)
    }

    fn turned(x: f64, y: f64, z: f64, yaw: f64) -> Pose {
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
        Isometry3::from_parts(Translation3::new(x, y, z), rotation)
    }

    fn positions(targets: &Targets<'_>) -> Vec<[f64; 3]> {
        let round = |value: f64| (value * 1e9).round() / 1e9 + 0.0;
        targets.iter().map(|it| it.pose.translation.vector.map(round).into()).collect()
    }

    #[test]
    fn a_grid_keeps_height_and_orientation_of_its_anchor() {
        let anchors = anchors(&[turned(1.0, 2.0, 3.0, 0.3), at(10.0, 0.0, 1.0)]);
        let grid = Grid::new([0.2, 0.1], 0.1, Definition::Corrected).unwrap();
        let targets = Targets::around(&anchors, &grid).unwrap();
        assert_eq!(targets.len(), 6);
        let found = positions(&targets);
        assert_eq!(found[..3], [[0.9, 2.0, 3.0], [1.0, 2.0, 3.0], [1.1, 2.0, 3.0]]);
        assert_eq!((targets.get(2).home, targets.get(3).home), (0, 1));
        assert_eq!(targets.get(0).pose.rotation, anchors.poses()[0].rotation);
    }

    #[test]
    fn between_two_anchors_positions_and_turns_are_even() {
        let poses = [turned(0.0, 0.0, 0.0, 0.0), turned(3.0, 0.0, 0.0, FRAC_PI_2)];
        let anchors = anchors(&poses);
        let targets = Targets::between(&anchors, 2).unwrap();
        assert_eq!(positions(&targets), [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]);
        let turn = targets.get(0).pose.rotation.angle();
        approx::assert_abs_diff_eq!(turn, FRAC_PI_2 / 3.0, epsilon = 1e-12);
        let split = Anchors::of_rows(&poses, &[vec![0], vec![1]]).unwrap();
        assert!(Targets::between(&split, 2).unwrap().is_empty(), "across sequences lies nothing");
    }

    #[test]
    fn half_a_turn_does_not_panic() {
        let half = between(&at(0.0, 0.0, 0.0), &turned(2.0, 0.0, 0.0, 2.0 * FRAC_PI_2), 0.5);
        assert_eq!(half.translation.vector.x, 1.0);
        assert!(half.rotation.coords.iter().all(|value| value.is_finite()));
    }

    #[test]
    fn a_lane_lies_beside_the_camera_or_along_the_world() {
        let anchors = anchors(&[turned(1.0, 0.0, 0.0, FRAC_PI_2)]);
        let offset = Vector3::new(-1.8, 0.0, 0.0);
        let lane = |frame| positions(&Targets::lane(&anchors, offset, frame).unwrap());
        assert_eq!(lane(Frame::World), [[-0.8, 0.0, 0.0]]);
        assert_eq!(lane(Frame::Camera), [[1.0, -1.8, 0.0]]);
        let nan = Vector3::new(f64::NAN, 0.0, 0.0);
        assert!(Targets::lane(&anchors, nan, Frame::World).is_err());
    }

    #[test]
    fn frames_belong_to_the_anchor_before_them_and_listed_poses_to_the_nearest() {
        let poses: Vec<Pose> = (0..9).map(|x| at(f64::from(x), 0.0, 0.0)).collect();
        let anchors = Anchors::every(&poses, &sequences(None, 9), 4).unwrap();
        let targets = Targets::frames(&anchors, &poses, &[1, 3, 5, 8]).unwrap();
        assert_eq!(targets.iter().map(|it| it.home).collect::<Vec<_>>(), [0, 0, 1, 1]);
        let listed = Targets::listed(&anchors, &[at(3.0, 1.0, 0.0), at(-9.0, 0.0, 0.0)]).unwrap();
        assert_eq!(listed.iter().map(|it| it.home).collect::<Vec<_>>(), [1, 0]);
        assert!(Targets::frames(&anchors, &poses, &[9]).is_err());
        assert!(Targets::listed(&anchors, &[at(f64::NAN, 0.0, 0.0)]).is_err());
    }

    #[test]
    fn a_global_grid_stays_within_reach_of_anchors() {
        let anchors = anchors(&[at(0.0, 0.0, 1.0), at(10.0, 0.0, 2.0)]);
        let targets = Targets::global(&anchors, 1.0, 1.0).unwrap();
        let around = |x: f64, z: f64| {
            [[x - 1.0, 0.0, z], [x, -1.0, z], [x, 0.0, z], [x, 1.0, z], [x + 1.0, 0.0, z]]
        };
        assert_eq!(positions(&targets), [around(0.0, 1.0), around(10.0, 2.0)].concat());
        assert!(Targets::global(&anchors, 0.0, 1.0).is_err());
        assert!(Targets::global(&anchors, 1.0, -1.0).is_err());
    }

    #[test]
    fn the_absurd_is_refused_before_anything_is_made() {
        let anchors = anchors(&[at(0.0, 0.0, 0.0), at(1e6, 1e6, 0.0)]);
        let grid = Grid::new([1e4, 1e4], 0.01, Definition::Corrected).unwrap();
        let err = Targets::around(&anchors, &grid).unwrap_err().to_string();
        assert!(err.contains("2000004000002 targets"), "{err}");
        assert!(matches!(Targets::global(&anchors, 0.01, 1.0), Err(Error::TooMany { .. })));
        assert!(Targets::between(&anchors, 60_000_000).is_err());
    }
}
