//! Depth of single images of a world, without a folder: what a walk through its map needs to know of
//! walls.

use ndarray::Array2;
use rayon::prelude::*;
use vpr_core::{Error, Pose, Result};

use crate::{
    Camera,
    family::plan,
    layout::{self, Side},
    recipe::Recipe,
    world::take,
};

/// What a camera measures.
#[derive(Clone, Debug, PartialEq)]
pub struct Depth {
    /// Its intrinsics.
    pub camera: Camera,
    /// Where it stands, `world_from_camera`, metres.
    pub pose: Pose,
    /// Along the optical axis, metres, `height × width`; infinite where nothing is.
    pub metres: Array2<f32>,
}

/// Depth of some images of a side, by their numbers; rendered anew at every call.
///
/// # Errors
///
/// [`Error::OutOfRange`] for an image that does not exist, and those of reading the files that the
/// recipe names.
pub fn depths(recipe: &Recipe, side: Side, images: &[usize]) -> Result<Vec<Depth>> {
    let mut plan = plan(recipe)?;
    layout::in_reading_order(recipe.layout, &mut plan);
    let shots = side.shots(&plan);
    let one = |&index: &usize| {
        let len = shots.len();
        let shot = shots.get(index).ok_or(Error::OutOfRange { what: "image", index, len })?;
        let shape = (shot.camera.height as usize, shot.camera.width as usize);
        let metres = Array2::from_shape_vec(shape, take(&plan, shot).1.depth)
            .map_err(|_| Error::Empty("pixels of a depth image"))?;
        Ok(Depth { camera: shot.camera, pose: shot.pose, metres })
    };
    images.par_iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{World, recipe_with};

    #[test]
    fn depth_is_that_of_a_rendered_world() {
        let settings = [("places", "3"), ("camera.width", "40"), ("camera.height", "30")];
        let recipe = recipe_with("corridor", &settings).unwrap();
        let recipe = Recipe { depth: true, ..recipe };
        let folder = tempfile::tempdir().unwrap();
        let world = World::open(&recipe, folder.path(), &|| {}).unwrap();
        let alone = depths(&recipe, Side::References, &[2, 0]).unwrap();
        for (depth, index) in alone.iter().zip([2, 0]) {
            let stored = world.depth(Side::References, index).unwrap();
            assert_eq!(depth.metres.dim(), (30, 40));
            let near = depth.metres.iter().zip(&stored).filter(|it| it.1.is_finite());
            assert!(near.clone().count() > 600, "most of a corridor is near");
            for (alone, stored) in near {
                assert!((alone - stored).abs() < 0.01, "{alone} {stored}");
            }
            let poses = world.poses(Side::References).unwrap();
            let apart =
                poses.six_dof().unwrap()[index].translation.vector - depth.pose.translation.vector;
            assert!(apart.norm() < 1e-3, "{apart}");
        }
        assert!(depths(&recipe, Side::References, &[3]).is_err());
    }
}
