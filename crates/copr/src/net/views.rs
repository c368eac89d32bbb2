//! Images with poses in several rooms: what the head of an encoder learns from.

use std::{ops::Range, path::PathBuf};

use ndarray::{Array2, ArrayView1, Axis, concatenate};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vpr_core::{Definition, Error as CoreError, Pose, map::BlockDigest};
use vpr_nets::{
    model::default::{DefaultEncoder, INPUT},
    regress::RELATIVE_POSE,
    train::{Album, planes, variants},
};

use super::relative_pose;
use crate::{Result, regression::narrow, rotation_error, translation_error};

/// How often a pair is drawn that is near enough before any is taken.
const DRAWS: usize = 200;

/// Images that go through the network at a time.
const BATCH: usize = 32;

/// Images of rooms as the trunk of a network sees them, once as they are and in variants.
#[derive(Clone, Debug)]
pub struct Views {
    /// One row an image and version, all images of a version after those of the one before.
    features: Array2<f32>,
    poses: Vec<Pose>,
    rooms: Vec<Range<usize>>,
}

/// How far apart the two cameras of a pair may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// Metres.
    pub metres: f64,
    /// Degrees.
    pub degrees: f64,
}

/// Pairs: first all firsts, then all seconds, then, if asked for, an image of another room for each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ViewBatch {
    /// `parts · n × features`, what the trunk makes of images.
    pub features: Vec<f32>,
    /// `n` distances between the cameras of a pair, metres.
    pub metres: Vec<f32>,
    /// `n × 7`: the second camera seen from the first, see [`relative_pose`].
    pub relative: Vec<f32>,
    /// Number of pairs.
    pub n: usize,
}

impl Views {
    /// Shows the images of rooms, paths and poses of each, to the trunk of a network: as they are, and
    /// `n_variants` times changed as in its training ([`variants`]).
    ///
    /// # Errors
    ///
    /// [`CoreError::Empty`] if a room has fewer than two images, [`CoreError::Mismatch`] if it has not as
    /// many poses; the first image that cannot be read, by its path.
    pub fn open(
        rooms: &[(Vec<PathBuf>, Vec<Pose>)],
        network: &DefaultEncoder,
        (n_variants, seed): (usize, u64),
    ) -> Result<Self> {
        let (mut paths, mut poses, mut ranges) = (Vec::new(), Vec::new(), Vec::new());
        for (images, at) in rooms {
            if images.len() < 2 {
                return Err(CoreError::Empty("pairs of images of a room").into());
            }
            if images.len() != at.len() {
                let (expected, actual) = (images.len(), at.len());
                let what = "poses of the images of a room";
                return Err(CoreError::Mismatch { what, expected, actual }.into());
            }
            ranges.push(paths.len()..paths.len() + images.len());
            paths.extend_from_slice(images);
            poses.extend_from_slice(at);
        }
        let values = planes(&paths, INPUT)?;
        let plane = INPUT.0 * INPUT.1;
        // Planes of one image after the other to pixels of three values.
        let pixels = values
            .chunks(3 * plane)
            .flat_map(|image| (0..3 * plane).map(move |at| byte(image[at % 3 * plane + at / 3])));
        let album = Album::new(pixels.collect(), INPUT)?;
        let mut versions = vec![network.pooled(&values, INPUT, BATCH)?];
        for version in 0..n_variants {
            let changed = variants(&album, INPUT, seed.wrapping_add(version as u64));
            versions.push(network.pooled(&changed, INPUT, BATCH)?);
        }
        let parts: Vec<_> = versions.iter().map(|it| it.view()).collect();
        let features = concatenate(Axis(0), &parts).map_err(|_| CoreError::Empty("features"))?;
        Ok(Self { features, poses, rooms: ranges })
    }

    /// Number of images.
    #[must_use]
    pub fn len(&self) -> usize {
        self.poses.len()
    }

    /// Whether there is no image.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.poses.is_empty()
    }

    /// Number of rooms.
    #[must_use]
    pub fn n_rooms(&self) -> usize {
        self.rooms.len()
    }

    /// Stands for images, poses and rooms.
    #[must_use]
    pub fn digest(&self) -> String {
        let mut bytes: Vec<u8> = self.features.iter().flat_map(|it| it.to_le_bytes()).collect();
        for pose in &self.poses {
            let parts = pose.translation.vector.iter().chain(pose.rotation.coords.iter());
            bytes.extend(parts.flat_map(|it| it.to_le_bytes()));
        }
        bytes.extend(self.rooms.iter().flat_map(|it| (it.end as u64).to_le_bytes()));
        BlockDigest::of(&bytes).to_hex()
    }

    /// `n` pairs, each of one room: a function of `seed` and `step` alone. With `others` each comes
    /// with an image of another room. Every image is seen in any of its versions.
    ///
    /// # Errors
    ///
    /// [`CoreError::Empty`] if another room is asked for and there is none.
    pub fn batch(
        &self,
        (seed, step): (u64, usize),
        n: usize,
        reach: Reach,
        others: bool,
    ) -> vpr_core::Result<ViewBatch> {
        if others && self.rooms.len() < 2 {
            return Err(CoreError::Empty("other rooms: negatives need two rooms"));
        }
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(step as u64);
        let mut batch = ViewBatch { n, ..ViewBatch::default() };
        let (mut firsts, mut seconds, mut thirds) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..n {
            let room = random.random_range(0..self.rooms.len());
            let (a, b) = self.pair(room, reach, &mut random);
            let (from, to) = (&self.poses[a], &self.poses[b]);
            batch.metres.push(narrow(translation_error(from, to)));
            batch.relative.extend(relative_pose(from, to, Definition::Corrected));
            firsts.push(a);
            seconds.push(b);
            if others {
                let other = (room + random.random_range(1..self.rooms.len())) % self.rooms.len();
                thirds.push(random.random_range(self.rooms[other].clone()));
            }
        }
        debug_assert_eq!(batch.relative.len(), n * RELATIVE_POSE);
        for image in [firsts, seconds, thirds].concat() {
            batch.features.extend(self.version(image, &mut random));
        }
        Ok(batch)
    }

    fn version(&self, image: usize, random: &mut ChaCha8Rng) -> ArrayView1<'_, f32> {
        let version = random.random_range(0..self.features.nrows() / self.len());
        self.features.row(version * self.len() + image)
    }

    /// Two images of a room that are near enough, or, where none is found, any two.
    fn pair(&self, room: usize, reach: Reach, random: &mut ChaCha8Rng) -> (usize, usize) {
        let rows = self.rooms[room].clone();
        let mut two = || {
            let a = random.random_range(rows.clone());
            let b = rows.start + (a - rows.start + random.random_range(1..rows.len())) % rows.len();
            (a, b)
        };
        let is_near = |&(a, b): &(usize, usize)| {
            translation_error(&self.poses[a], &self.poses[b]) <= reach.metres
                && rotation_error(&self.poses[a], &self.poses[b]) <= reach.degrees
        };
        let first = two();
        std::iter::once(first)
            .chain(std::iter::repeat_with(two))
            .take(DRAWS)
            .find(is_near)
            .unwrap_or(first)
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
fn byte(value: f32) -> u8 {
    (255.0 * value).round().clamp(0.0, 255.0) as u8
}

#[cfg(test)]
pub(super) mod tests {
    use std::path::Path;

    use vpr_vision::image::{ImageSize, from_pixels, write_png};

    use super::*;

    /// Two rooms, one bright and one dark, whose images say where on a line they were taken.
    pub(in crate::net) fn rooms(folder: &Path, n: usize) -> Vec<(Vec<PathBuf>, Vec<Pose>)> {
        let room = |room: usize| {
            let image = |at: usize| {
                let (width, height) = (32, 24);
                let level = |value: usize| {
                    let column = value / 3 % width;
                    let lit = column.abs_diff(4 + at * 24 / n) < 3;
                    u8::try_from(if lit { 230 } else { 40 + 90 * room + 3 * (column % 7) }).unwrap()
                };
                let path = folder.join(format!("{room}-{at:02}.png"));
                let size = ImageSize { width, height };
                let pixels = (0..3 * width * height).map(level).collect();
                write_png(&from_pixels(size, pixels), &path).unwrap();
                path
            };
            let pose = |at: usize| Pose::translation(at as f64 / n as f64, 0.0, 0.0);
            ((0..n).map(image).collect(), (0..n).map(pose).collect())
        };
        (0..2).map(room).collect()
    }

    pub(in crate::net) fn seen(folder: &Path, n: usize) -> Result<Views> {
        let (network, _) = crate::net::default_network()?;
        Views::open(&rooms(folder, n), &network, (1, 7))
    }

    #[test]
    fn pairs_stay_in_their_room_and_negatives_do_not() {
        let folder = tempfile::tempdir().unwrap();
        let views = seen(folder.path(), 12).unwrap();
        assert_eq!((views.len(), views.n_rooms()), (24, 2));
        let reach = Reach { metres: 0.3, degrees: 10.0 };
        let batch = views.batch((3, 5), 40, reach, true).unwrap();
        assert!(batch.metres.iter().all(|it| *it > 0.0 && *it <= 0.31), "{:?}", batch.metres);
        let width = batch.features.len() / 120;
        let room = |number: usize| {
            let found = &batch.features[number * width..][..width];
            let is_it = |row: usize| views.features.row(row).iter().eq(found);
            (0..views.features.nrows()).find(|row| is_it(*row)).unwrap() % 24 / 12
        };
        for pair in 0..40 {
            assert_eq!(room(pair), room(40 + pair));
            assert_ne!(room(pair), room(80 + pair));
            let (metres, x) = (batch.metres[pair], batch.relative[RELATIVE_POSE * pair]);
            approx::assert_abs_diff_eq!(metres, x.abs(), epsilon = 1e-6);
        }
        assert_eq!(batch, views.batch((3, 5), 40, reach, true).unwrap());
        assert_ne!(batch, views.batch((3, 6), 40, reach, true).unwrap());
    }

    #[test]
    fn what_is_no_room_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let (network, _) = crate::net::default_network().unwrap();
        let open = |all: &[_]| Views::open(all, &network, (0, 0));
        let mut all = rooms(folder.path(), 3);
        all.truncate(1);
        let one = open(&all).unwrap();
        let reach = Reach { metres: 9.0, degrees: 180.0 };
        assert!(one.batch((0, 0), 2, reach, true).is_err());
        assert!(one.batch((0, 0), 2, reach, false).is_ok());
        all[0].1.pop();
        assert!(open(&all).unwrap_err().to_string().contains("poses of the images"));
        all[0].0.truncate(1);
        assert!(open(&all).is_err());
    }
}
