//! Images with poses in several rooms: what an encoder learns from.

use std::{ops::Range, path::PathBuf};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vpr_core::{Definition, Error as CoreError, Pose, map::BlockDigest};
use vpr_nets::{
    model::default::INPUT,
    regress::RELATIVE_POSE,
    train::{Album, augment, planes},
};

use super::relative_pose;
use crate::{Result, regression::narrow, rotation_error, translation_error};

/// How often a pair is drawn that is near enough before any is taken.
const DRAWS: usize = 200;

/// Images of rooms, decoded, at the size that the network takes.
#[derive(Clone, Debug)]
pub struct Views {
    album: Album,
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

/// Images of pairs: first all firsts, then all seconds, then, if asked for, an image of another room
/// for each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ViewBatch {
    /// `parts · n × 3 × height × width` values in 0 to 1.
    pub images: Vec<f32>,
    /// `n` distances between the cameras of a pair, metres.
    pub metres: Vec<f32>,
    /// `n × 7`: the second camera seen from the first, see [`relative_pose`].
    pub relative: Vec<f32>,
    /// Number of pairs.
    pub n: usize,
}

impl Views {
    /// Decodes the images of rooms: paths and poses of each.
    ///
    /// # Errors
    ///
    /// [`CoreError::Empty`] if a room has fewer than two images, [`CoreError::Mismatch`] if it has not as
    /// many poses; the first image that cannot be read, by its path.
    pub fn open(rooms: &[(Vec<PathBuf>, Vec<Pose>)]) -> Result<Self> {
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
        Ok(Self { album, poses, rooms: ranges })
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
        let mut bytes: Vec<u8> = Vec::new();
        for image in 0..self.len() {
            bytes.extend(BlockDigest::of(self.album.get(image).bytes).to_hex().into_bytes());
        }
        for pose in &self.poses {
            let parts = pose.translation.vector.iter().chain(pose.rotation.coords.iter());
            bytes.extend(parts.flat_map(|it| it.to_le_bytes()));
        }
        bytes.extend(self.rooms.iter().flat_map(|it| (it.end as u64).to_le_bytes()));
        BlockDigest::of(&bytes).to_hex()
    }

    /// `n` pairs, each of one room: a function of `seed` and `step` alone. With `others` each comes
    /// with an image of another room; with `changed` every image is changed as in training
    /// ([`augment`]), otherwise it stays as it is.
    ///
    /// # Errors
    ///
    /// [`CoreError::Empty`] if another room is asked for and there is none.
    pub fn batch(
        &self,
        (seed, step): (u64, usize),
        n: usize,
        reach: Reach,
        (others, changed): (bool, bool),
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
        let each = 3 * INPUT.0 * INPUT.1;
        let images = [firsts, seconds, thirds].concat();
        batch.images = vec![0.0; images.len() * each];
        for (image, output) in images.into_iter().zip(batch.images.chunks_mut(each)) {
            let pixels = self.album.get(image);
            if changed {
                augment(pixels, INPUT, random.random(), output);
            } else {
                let plane = INPUT.0 * INPUT.1;
                for (at, &value) in pixels.bytes.iter().enumerate() {
                    output[at % 3 * plane + at / 3] = f32::from(value) / 255.0;
                }
            }
        }
        Ok(batch)
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

    #[test]
    fn pairs_stay_in_their_room_and_negatives_do_not() {
        let folder = tempfile::tempdir().unwrap();
        let views = Views::open(&rooms(folder.path(), 12)).unwrap();
        assert_eq!((views.len(), views.n_rooms()), (24, 2));
        let reach = Reach { metres: 0.3, degrees: 10.0 };
        let batch = views.batch((3, 5), 40, reach, (true, false)).unwrap();
        assert!(batch.metres.iter().all(|it| *it > 0.0 && *it <= 0.31), "{:?}", batch.metres);
        let each = 3 * INPUT.0 * INPUT.1;
        let is_bright = |number: usize| batch.images[number * each] > 0.4;
        for pair in 0..40 {
            assert_eq!(is_bright(pair), is_bright(40 + pair));
            assert_ne!(is_bright(pair), is_bright(80 + pair));
            let (metres, x) = (batch.metres[pair], batch.relative[RELATIVE_POSE * pair]);
            approx::assert_abs_diff_eq!(metres, x.abs(), epsilon = 1e-6);
        }
        assert_eq!(batch, views.batch((3, 5), 40, reach, (true, false)).unwrap());
        assert_ne!(batch, views.batch((3, 6), 40, reach, (true, false)).unwrap());
    }

    #[test]
    fn what_is_no_room_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let mut all = rooms(folder.path(), 3);
        all.truncate(1);
        let one = Views::open(&all).unwrap();
        let reach = Reach { metres: 9.0, degrees: 180.0 };
        assert!(one.batch((0, 0), 2, reach, (true, false)).is_err());
        assert!(one.batch((0, 0), 2, reach, (false, true)).is_ok());
        all[0].1.pop();
        assert!(Views::open(&all).unwrap_err().to_string().contains("poses of the images"));
        all[0].0.truncate(1);
        assert!(Views::open(&all).is_err());
    }
}
