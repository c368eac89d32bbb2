//! The families of worlds: each turns its table of a recipe into scenes and shots.

mod campus;
mod city;
mod interior;
mod lineside;
mod rail;
mod seven_scenes;
mod stage;
mod street;
mod track;

pub use stage::LIGHTS_DEG;

use glam::Vec3;
use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use vpr_core::{GroundTruth, PlanarPosition, Poses};

use crate::{
    camera::Camera,
    film::Film,
    light::Light,
    recipe::{Recipe, Tolerance},
    scene::{Lamp, Scene, Shape},
    seed::Seed,
    traverse::{Offset, Traverse},
};

/// Everything that is needed to render a world.
pub(crate) struct Plan {
    pub(crate) scenes: Vec<Scene>,
    pub(crate) lights: Vec<Light>,
    pub(crate) references: Vec<Shot>,
    pub(crate) queries: Vec<Shot>,
    /// Further views, for maps that are denser than the references.
    pub(crate) grid: Vec<Shot>,
    /// From the frame in which scenes are built (z up) to the one in which poses are told.
    pub(crate) world_from_scene: vpr_core::Pose,
}

/// One image to take.
#[derive(Clone)]
pub(crate) struct Shot {
    pub(crate) pose: vpr_core::Pose,
    pub(crate) camera: Camera,
    /// Which of the plan's scenes.
    pub(crate) scene: usize,
    /// Which of the plan's lights.
    pub(crate) light: usize,
    pub(crate) film: Film,
    /// Snow in the air.
    pub(crate) falling: f64,
    pub(crate) foreground: Vec<Shape>,
    /// A lamp that is on for this image only.
    pub(crate) lamp: Option<Lamp>,
    pub(crate) seed: Seed,
    /// The place it belongs to; `None` for a new place.
    pub(crate) place: Option<usize>,
}

/// Builds the scenes and lists the shots of a recipe.
///
/// # Errors
///
/// Those of reading the files that the recipe names.
pub(crate) fn plan(recipe: &Recipe) -> vpr_core::Result<Plan> {
    let seed = Seed::new(recipe.seed);
    if let Some(scenes) = &recipe.seven_scenes {
        return scenes.plan(recipe, seed);
    }
    let plans = [
        recipe.street.map(|family| family.plan(recipe, seed)),
        recipe.rail.map(|family| family.plan(recipe, seed)),
        recipe.campus.map(|family| family.plan(recipe, seed)),
        recipe.interior.map(|family| family.plan(recipe, seed)),
        recipe.stage.map(|family| family.plan(recipe, seed)),
    ];
    Ok(plans.into_iter().flatten().next().expect("a checked recipe has one family"))
}

/// Shots of a city, one per place and visit, place by place.
///
/// # Errors
///
/// [`vpr_core::Error::Format`] if the recipe is not of the street family.
pub(crate) fn tour(recipe: &Recipe, visits: &[Traverse]) -> vpr_core::Result<Plan> {
    let street = recipe.street.ok_or_else(|| {
        vpr_core::Error::format(&recipe.name, "street", "is missing: only cities are toured")
    })?;
    Ok(street.tour(recipe, visits, Seed::new(recipe.seed)))
}

/// A camera at `eye` that looks along `heading` (radians counter-clockwise from +x), level.
pub(crate) fn level_pose(eye: Vec3, heading: f64) -> vpr_core::Pose {
    let (sin, cos) = (libm::sin(heading), libm::cos(heading));
    // Columns: right, down, forward.
    let columns = Matrix3::from_columns(&[
        Vector3::new(sin, -cos, 0.0),
        Vector3::new(0.0, 0.0, -1.0),
        Vector3::new(cos, sin, 0.0),
    ]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(columns));
    let at = Translation3::new(f64::from(eye.x), f64::from(eye.y), f64::from(eye.z));
    Isometry3::from_parts(at, rotation)
}

/// A camera at `eye` that looks at `target`, its upper edge up.
pub(crate) fn looking_at(eye: Vector3<f64>, target: Vector3<f64>) -> vpr_core::Pose {
    let forward = (target - eye).normalize();
    let right = forward.cross(&Vector3::z()).normalize();
    let columns = Matrix3::from_columns(&[right, forward.cross(&right), forward]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(columns));
    Isometry3::from_parts(Translation3::from(eye), rotation)
}

/// A pose beside the place's own, by the fixed and the random part of an offset.
pub(crate) fn beside(pose: &vpr_core::Pose, offset: &Offset, seed: Seed) -> vpr_core::Pose {
    let draw = |key: i64| offset.jitter * f64::from(seed.named("jitter").at(key).range(-1.0, 1.0));
    let shift = Translation3::new(
        offset.lateral_m + draw(0),
        -offset.up_m - 0.2 * draw(1),
        offset.forward_m + draw(2),
    );
    let yaw = (-offset.yaw_deg + 10.0 * draw(3)).to_radians();
    let pitch = (offset.pitch_deg + 3.0 * draw(4)).to_radians();
    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), yaw)
        * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), pitch);
    pose * shift * turn
}

/// The correct references by the recipe's tolerance.
pub(crate) fn truth(tolerance: Tolerance, queries: &[Shot], references: &[Shot]) -> GroundTruth {
    let planar = |shots: &[Shot]| {
        let at = |shot: &Shot| {
            let position = shot.pose.translation.vector;
            PlanarPosition::new(position.x, position.y)
        };
        Poses::Planar(shots.iter().map(at).collect())
    };
    match tolerance {
        Tolerance::RadiusM(radius) => {
            GroundTruth::within_radius(&planar(queries), &planar(references), radius)
                .expect("the radius is checked and all poses are planar")
        }
        Tolerance::Frames(frames) => {
            let near = |query: &Shot| {
                let place = query.place;
                let near = |reference: &Shot| {
                    place.zip(reference.place).is_some_and(|(a, b)| a.abs_diff(b) <= frames)
                };
                (0..references.len()).filter(|&index| near(&references[index])).collect()
            };
            GroundTruth::from_lists(queries.iter().map(near).collect(), references.len())
                .expect("indices come from the references")
        }
    }
}

/// Shots of one traverse along a route of level poses.
pub(crate) fn drive(
    recipe: &Recipe,
    traverse: &Traverse,
    route: &[vpr_core::Pose],
    scene: usize,
    seed: Seed,
) -> Vec<Shot> {
    (0_i64..)
        .zip(route)
        .map(|(place, pose)| {
            let own = seed.at(place);
            Shot {
                pose: beside(pose, &traverse.offset, own),
                camera: recipe.camera,
                scene,
                light: scene,
                film: traverse.film,
                falling: traverse.condition.falling,
                foreground: Vec::new(),
                lamp: None,
                seed: own,
                place: usize::try_from(place).ok(),
            }
        })
        .collect()
}

/// Two traverses of a route, references then queries, with the queries' new places at its end.
///
/// `route` holds `recipe.places` poses and `recipe.new_places` more that only queries visit.
pub(crate) fn two_traverses(
    recipe: &Recipe,
    route: &[vpr_core::Pose],
    seed: Seed,
    mut foreground: impl FnMut(&vpr_core::Pose, Seed) -> Vec<Shape>,
) -> (Vec<Shot>, Vec<Shot>) {
    let known = &route[..recipe.places];
    let references = drive(recipe, &recipe.references, known, 0, seed.named("references"));
    let all = drive(recipe, &recipe.queries, route, 1, seed.named("queries"));
    let mut queries: Vec<Shot> = all
        .into_iter()
        .enumerate()
        .filter(|(place, _)| *place >= recipe.places || place % recipe.query_every == 0)
        .map(|(place, shot)| Shot { place: (place < recipe.places).then_some(place), ..shot })
        .collect();
    for shot in &mut queries {
        shot.foreground = foreground(&shot.pose, shot.seed);
    }
    (references, queries)
}
