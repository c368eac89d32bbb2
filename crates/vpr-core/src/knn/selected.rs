//! Search in a part of the references: those near a position that is roughly known.

use std::ops::Range;

use rstar::{AABB, PointDistance, RTree, RTreeObject};

use super::{RowSource, SearchParams, search};
use crate::{Descriptors, Error, Poses, Position, Result, Retrieval};

/// Some rows of a source, in ascending order, as a source of their own.
pub struct Selected<'a, R: ?Sized> {
    rows: &'a R,
    indices: Vec<usize>,
}

impl<'a, R: RowSource + ?Sized> Selected<'a, R> {
    /// Chooses rows by index; order and repetitions do not matter.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] if a row does not exist.
    pub fn new(rows: &'a R, mut indices: Vec<usize>) -> Result<Self> {
        indices.sort_unstable();
        indices.dedup();
        match indices.last() {
            Some(&index) if index >= rows.len() => {
                Err(Error::OutOfRange { what: "row", index, len: rows.len() })
            }
            _ => Ok(Self { rows, indices }),
        }
    }

    /// Index in the whole source of every row chosen, ascending.
    #[must_use]
    pub fn indices(&self) -> &[usize] {
        &self.indices
    }
}

impl<R: RowSource + ?Sized> RowSource for Selected<'_, R> {
    fn len(&self) -> usize {
        self.indices.len()
    }

    fn dim(&self) -> usize {
        self.rows.dim()
    }

    fn block<'a>(&'a self, rows: Range<usize>, scratch: &'a mut Vec<f32>) -> Result<&'a [f32]> {
        let chosen = &self.indices[rows];
        if let (Some(&first), Some(&last)) = (chosen.first(), chosen.last())
            && last - first + 1 == chosen.len()
        {
            return self.rows.block(first..last + 1, scratch);
        }
        scratch.clear();
        let mut decoded = Vec::new();
        for run in chosen.chunk_by(|a, b| a + 1 == *b) {
            let block = self.rows.block(run[0]..run[0] + run.len(), &mut decoded)?;
            scratch.extend_from_slice(block);
        }
        Ok(scratch)
    }
}

/// The positions of a map, arranged so that those near a point are found without a look at the
/// others (an R*-tree).
#[derive(Clone, Debug)]
pub struct PositionIndex(RTree<Place>);

#[derive(Clone, Copy, Debug)]
struct Place {
    position: [f64; 3],
    index: usize,
}

impl RTreeObject for Place {
    type Envelope = AABB<[f64; 3]>;

    fn envelope(&self) -> Self::Envelope {
        AABB::from_point(self.position)
    }
}

impl PointDistance for Place {
    fn distance_2(&self, point: &[f64; 3]) -> f64 {
        self.position.iter().zip(point).map(|(a, b)| (a - b) * (a - b)).sum()
    }
}

impl PositionIndex {
    /// Arranges the positions of all references; planar positions lie at height zero.
    ///
    /// # Errors
    ///
    /// [`Error::NotFinite`] if a pose is not finite.
    pub fn new(poses: &Poses) -> Result<Self> {
        poses.check_finite()?;
        let place = |index| Place { position: poses.position(index).into(), index };
        Ok(Self(RTree::bulk_load((0..poses.len()).map(place).collect())))
    }

    /// References at most `radius` metres from `center`, ascending.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if the radius is negative or any of the numbers is not finite.
    pub fn within(&self, center: Position, radius: f64) -> Result<Vec<usize>> {
        if !(radius >= 0.0 && radius.is_finite() && center.iter().all(|value| value.is_finite())) {
            return Err(Error::Parameter {
                name: "near",
                value: format!("{},{},{},{radius}", center.x, center.y, center.z),
                reason: "needs finite numbers and a radius that is not negative",
            });
        }
        // The envelope finds a superset whatever the rounding of squares; the distance decides.
        let corners = [center.map(|value| value - radius), center.map(|value| value + radius)];
        let envelope = AABB::from_corners(
            corners[0].coords.map(f64::next_down).into(),
            corners[1].coords.map(f64::next_up).into(),
        );
        let mut found: Vec<usize> = self
            .0
            .locate_in_envelope(envelope)
            .filter(|place| nalgebra::distance(&place.position.into(), &center) <= radius)
            .map(|place| place.index)
            .collect();
        found.sort_unstable();
        Ok(found)
    }

    /// The `n` references nearest to `center` in space, nearest first, ties by lower index; fewer if
    /// there are fewer.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if `center` is not finite.
    pub fn nearest(&self, center: Position, n: usize) -> Result<Vec<usize>> {
        if !center.iter().all(|value| value.is_finite()) {
            let value = format!("{},{},{}", center.x, center.y, center.z);
            return Err(Error::Parameter { name: "near", value, reason: "needs finite numbers" });
        }
        let mut found: Vec<(f64, usize)> = Vec::with_capacity(n + 1);
        for (place, squared) in self.0.nearest_neighbor_iter_with_distance_2(center.into()) {
            // All that are as near as the last one wanted come before they are cut.
            if found.len() >= n && found.last().is_none_or(|&(last, _)| squared > last) {
                break;
            }
            found.push((squared, place.index));
        }
        found.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        Ok(found.into_iter().take(n).map(|(_, index)| index).collect())
    }
}

/// Finds the `k` references nearest to every query among those given, exactly; the indices of the
/// result are those of the whole source.
///
/// # Errors
///
/// Those of [`Selected::new`] and [`search`]: in particular [`Error::Empty`] if no reference is given.
pub fn search_among(
    rows: &(impl RowSource + ?Sized),
    among: Vec<usize>,
    queries: &Descriptors,
    params: &SearchParams,
) -> Result<Retrieval> {
    let selected = Selected::new(rows, among)?;
    search(&selected, queries, params)?.with_indices(selected.indices())
}

#[cfg(test)]
mod tests {
    use ndarray::{Array2, array};
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn only_references_inside_the_radius_are_found() {
        let rows = Descriptors::new(array![[0.0], [1.0], [2.0], [3.0]]).unwrap();
        let poses = Poses::Planar([0.0, 100.0, 3.0, 4.0].map(|x| [x, 0.0].into()).to_vec());
        let near = PositionIndex::new(&poses).unwrap().within([0.0, 0.0, 0.0].into(), 4.0).unwrap();
        assert_eq!(near, [0, 2, 3]);
        let query = Descriptors::new(array![[1.1]]).unwrap();
        let found = search_among(&rows, near, &query, &SearchParams::default()).unwrap();
        assert_eq!(found.indices(0).to_vec(), [2, 0, 3]);
    }

    #[test]
    fn nobody_near_is_an_error_not_an_empty_rank() {
        let rows = Descriptors::new(array![[0.0]]).unwrap();
        let found = search_among(&rows, Vec::new(), &rows, &SearchParams::default());
        assert!(matches!(found, Err(Error::Empty(_))));
    }

    proptest! {
        #[test]
        fn the_index_agrees_with_a_look_at_every_position(
            places in prop::collection::vec((-9_i8..9, -9_i8..9, -2_i8..2), 0..200),
            center in (-9_i8..9, -9_i8..9), radius in 0_u8..12,
        ) {
            let position = |&(x, y, z): &(i8, i8, i8)| Position::new(x.into(), y.into(), z.into());
            let poses = Poses::Spatial(places.iter().map(position).collect());
            let (center, radius) = (position(&(center.0, center.1, 0)), f64::from(radius));
            let expected: Vec<usize> = (0..poses.len())
                .filter(|&index| nalgebra::distance(&poses.position(index), &center) <= radius)
                .collect();
            prop_assert_eq!(PositionIndex::new(&poses).unwrap().within(center, radius).unwrap(), expected);
        }

        #[test]
        fn the_nearest_are_those_of_a_look_at_every_position(
            places in prop::collection::vec((-9_i8..9, -9_i8..9, -2_i8..2), 0..80),
            center in (-9_i8..9, -9_i8..9), n in 0_usize..9,
        ) {
            let position = |&(x, y, z): &(i8, i8, i8)| Position::new(x.into(), y.into(), z.into());
            let poses = Poses::Spatial(places.iter().map(position).collect());
            let center = position(&(center.0, center.1, 0));
            let mut expected: Vec<usize> = (0..poses.len()).collect();
            expected.sort_by(|&a, &b| {
                let squared = |index| nalgebra::distance_squared(&poses.position(index), &center);
                squared(a).total_cmp(&squared(b))
            });
            expected.truncate(n);
            prop_assert_eq!(PositionIndex::new(&poses).unwrap().nearest(center, n).unwrap(), expected);
        }

        #[test]
        fn a_selection_delivers_its_rows(chosen in prop::collection::vec(0_usize..30, 1..40)) {
            let rows = Array2::from_shape_fn((30, 2), |(row, column)| (2 * row + column) as f32);
            let rows = Descriptors::new(rows).unwrap();
            let selected = Selected::new(&rows, chosen).unwrap();
            let mut scratch = Vec::new();
            let block = selected.block(0..selected.len(), &mut scratch).unwrap();
            let expected: Vec<f32> =
                selected.indices().iter().flat_map(|&i| [2 * i, 2 * i + 1]).map(|i| i as f32).collect();
            prop_assert_eq!(block, expected);
        }
    }
}
