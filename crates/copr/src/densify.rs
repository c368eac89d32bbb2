//! A map that is denser than its images.

use ndarray::{Array2, ArrayView2};
use vpr_core::{
    Error as CoreError, Map, Pose, Poses,
    map::{MapWriter, Names, Origins},
};

use crate::{
    Result,
    regression::{Anchor, Regressor, Request, Told},
    targets::Targets,
};

/// How targets are worked off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// Scales every regressed descriptor to unit length, which the released code does not although
    /// its encoders do (C-1).
    pub renormalise: bool,
    /// Targets at a time. Changes time and memory, not the result, but for [`crate::Control::Shuffled`].
    pub batch: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self { renormalise: false, batch: 1024 }
    }
}

/// Some regressed rows, in the order of their targets.
#[derive(Clone, Copy, Debug)]
pub struct Piece<'a> {
    /// Number of the first target.
    pub first: usize,
    /// `n × dim`.
    pub descriptors: ArrayView2<'a, f32>,
    /// Where they are.
    pub poses: &'a [Pose],
    /// The rows of the map that each is regressed from.
    pub anchors: &'a [Vec<usize>],
}

/// Regresses a descriptor at every target and hands them on piece by piece: memory does not grow
/// with the number of targets.
///
/// The anchors are rows of `map`. The result is the same for any number of threads, and, but for
/// [`crate::Control::Shuffled`], for any size of batch.
///
/// # Errors
///
/// The first target that has no descriptor, and why; [`CoreError::PoseKind`] if the map has no
/// orientations; those of `take`.
pub fn regress(
    map: &Map,
    targets: &Targets<'_>,
    regressor: &dyn Regressor,
    options: Options,
    mut take: impl FnMut(Piece<'_>) -> Result<()>,
) -> Result<Told> {
    let (poses, dim) = (map.poses().six_dof()?, map.descriptors().dim());
    let rows = map.descriptors().as_slice();
    let anchors = targets.anchors();
    if let Some(&index) = anchors.rows().iter().find(|&&row| row >= map.len()) {
        return Err(CoreError::OutOfRange { what: "anchor", index, len: map.len() }.into());
    }
    let (selection, name) = (regressor.selection(), regressor.name());
    let mut told = Told::default();
    let mut buffer = Vec::new();
    for first in (0..targets.len()).step_by(options.batch.max(1)) {
        let end = (first + options.batch.max(1)).min(targets.len());
        let batch: Vec<_> = (first..end).map(|target| targets.get(target)).collect();
        let chosen = batch.iter().zip(first..).map(|(it, target)| {
            let chosen = anchors.select(selection, (target, it.home, &it.pose), name)?;
            Ok(chosen.into_iter().map(|anchor| anchors.rows()[anchor]).collect())
        });
        let chosen: Vec<Vec<usize>> = chosen.collect::<Result<_>>()?;
        let requests: Vec<Request<'_>> = batch
            .iter()
            .zip(&chosen)
            .zip(first..)
            .map(|((it, chosen), target)| {
                let anchor = |&row: &usize| Anchor {
                    pose: &poses[row],
                    descriptor: &rows[row * dim..][..dim],
                };
                let anchors = chosen.iter().map(anchor).collect();
                Request { target, pose: it.pose, anchors }
            })
            .collect();
        buffer.clear();
        buffer.resize(batch.len() * dim, 0.0);
        told = told.and(regressor.regress(&requests, &mut buffer)?);
        if options.renormalise {
            buffer.chunks_mut(dim.max(1)).for_each(normalize);
        }
        let shape = (batch.len(), dim);
        let descriptors = ArrayView2::from_shape(shape, &buffer)
            .map_err(|_| CoreError::Empty("values in a descriptor"))?;
        let poses: Vec<Pose> = batch.iter().map(|it| it.pose).collect();
        take(Piece { first, descriptors, poses: &poses, anchors: &chosen })?;
    }
    Ok(told)
}

/// Appends a regressed row for every target to a map file that begins with the rows of `map`, in
/// their order; each says from which of them it is regressed. The writer may have more rows than
/// `map` by then, but not fewer.
///
/// Regressed rows are called `regressed-0000000`, … by the number of their target if `with_names`, which
/// the rows before them must be too.
///
/// # Errors
///
/// Those of [`regress`] and of [`MapWriter::append_regressed`].
pub fn densify(
    map: &Map,
    targets: &Targets<'_>,
    regressor: &dyn Regressor,
    options: Options,
    with_names: bool,
    writer: &mut MapWriter,
) -> Result<Told> {
    regress(map, targets, regressor, options, |piece| {
        let mut origins = Origins::default();
        for anchors in piece.anchors {
            origins.push_regressed(anchors)?;
        }
        let end = piece.first + piece.poses.len();
        let names: Option<Names> = with_names
            .then(|| (piece.first..end).map(|target| format!("regressed-{target:07}")).collect());
        let poses = Poses::SixDof(piece.poses.to_vec());
        writer.append_regressed(piece.descriptors, Some(&poses), names.as_ref(), &origins)?;
        Ok(())
    })
}

/// Regressed rows in memory: descriptors, `n × dim`, and where they are.
///
/// # Errors
///
/// Those of [`regress`].
pub fn regressed(
    map: &Map,
    targets: &Targets<'_>,
    regressor: &dyn Regressor,
    options: Options,
) -> Result<(Map, Told)> {
    let dim = map.descriptors().dim();
    let (mut values, mut poses) = (Vec::with_capacity(targets.len() * dim), Vec::new());
    let told = regress(map, targets, regressor, options, |piece| {
        values.extend(piece.descriptors.iter());
        poses.extend_from_slice(piece.poses);
        Ok(())
    })?;
    let rows = Array2::from_shape_vec((targets.len(), dim), values)
        .map_err(|_| CoreError::Empty("values in a descriptor"))?;
    let map = Map::new(vpr_core::Descriptors::new(rows)?, Poses::SixDof(poses))?;
    Ok((map, told))
}

/// Unit length; a row of zeros stays.
fn normalize(row: &mut [f32]) {
    let norm = row.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>().sqrt();
    if norm > 0.0 {
        for x in row {
            *x = crate::regression::narrow(f64::from(*x) / norm);
        }
    }
}

#[cfg(test)]
mod tests {
    use ndarray::array;
    use vpr_core::{
        Definition, Descriptors,
        map::{About, OpenMap, Opening, Origin, RowType, verify},
    };

    use super::*;
    use crate::{Anchors, Grid, LinearInterpolation, PlaneFit, Selection};

    fn map() -> Map {
        let rows = array![[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [2.0, 0.0], [0.5, 0.5]];
        let at =
            [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (3.0, 3.0, 0.0)];
        let poses = at.map(|(x, y, z)| Pose::translation(x, y, z)).to_vec();
        Map::new(Descriptors::new(rows).unwrap(), Poses::SixDof(poses)).unwrap()
    }

    #[test]
    fn a_dense_map_says_which_rows_are_regressed_and_from_what() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("dense.safetensors");
        let map = map();
        let anchors =
            Anchors::of_rows(map.poses().six_dof().unwrap(), &[vec![0, 1, 2, 3]]).unwrap();
        let grid = Grid::new([0.5, 0.0], 0.5, Definition::Published).unwrap();
        assert!(Targets::around(&anchors, &grid).unwrap().is_empty(), "arange of nothing");
        let grid = Grid::new([0.5, 0.5], 0.5, Definition::Corrected).unwrap();
        let targets = Targets::around(&anchors, &grid).unwrap();
        let mut writer = MapWriter::create(&path, 2, RowType::F32, About::default()).unwrap();
        let names: Names = ["a", "b", "c", "d", "e"].into_iter().collect();
        writer.append(map.descriptors().view(), Some(map.poses()), Some(&names)).unwrap();
        let options = Options { batch: 3, ..Options::default() };
        let told = densify(&map, &targets, &PlaneFit::corrected(), options, true, &mut writer);
        assert_eq!(told.unwrap(), Told::default());
        writer.finish().unwrap();
        assert_eq!(verify(&path).len(), 0);
        let dense = OpenMap::open(&path, Opening::default()).unwrap();
        assert_eq!(dense.len(), 5 + targets.len());
        let origins = dense.origins().unwrap().unwrap();
        assert_eq!(origins.measured_rows(), [0, 1, 2, 3, 4]);
        assert_eq!(origins.get(5), Some(Origin::Regressed(&[0, 1, 2, 3])));
        assert_eq!(dense.names().unwrap().unwrap().get(6), Some("regressed-0000001"));
    }

    #[test]
    fn batches_do_not_matter_and_lengths_can_be_mended() {
        let map = map();
        let anchors =
            Anchors::of_rows(map.poses().six_dof().unwrap(), &[(0..5).collect()]).unwrap();
        let targets = Targets::between(&anchors, 3).unwrap();
        let run = |batch, renormalise| {
            let options = Options { renormalise, batch };
            regressed(&map, &targets, &LinearInterpolation, options).unwrap().0
        };
        assert_eq!(run(1, false), run(7, false));
        assert_ne!(run(7, true), run(7, false));
        for row in run(7, true).descriptors().view().outer_iter() {
            approx::assert_abs_diff_eq!(row.dot(&row), 1.0, epsilon = 1e-6);
        }
        assert_eq!(run(7, false).descriptors().row(0).to_vec(), [0.75, 0.25]);
    }

    #[test]
    fn a_target_without_a_value_is_named_by_its_number_in_the_whole() {
        let map = map();
        let poses = map.poses().six_dof().unwrap();
        let anchors = Anchors::of_rows(poses, &[vec![0, 1], vec![2]]).unwrap();
        let targets = Targets::frames(&anchors, poses, &[0, 2]).unwrap();
        let options = Options { batch: 1, ..Options::default() };
        let err = regressed(&map, &targets, &LinearInterpolation, options).unwrap_err();
        assert!(err.to_string().starts_with("target 1: linear interpolation needs 2"), "{err}");
        assert_eq!(LinearInterpolation.selection(), Selection::Neighbours);
    }
}
