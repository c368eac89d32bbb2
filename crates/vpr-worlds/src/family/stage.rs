//! Two places each under measured viewpoints and lights: what invariance is quantified on.

use glam::{Vec2, Vec3};
use nalgebra::Vector3;

use super::{Plan, Shot, beside, looking_at};
use crate::{
    geometry::Ray,
    light::Light,
    parts::{Furnisher, Room, shell, toy_town},
    recipe::{Recipe, Stage, StageKind, Street},
    scene::{Draft, Lamp, Scene},
    seed::Seed,
    traverse::Offset,
};

/// Azimuth and elevation of the lights of table 3.4, degrees. The table's caption names the two
/// angles the other way round than its values allow: no elevation is 264°.
pub const LIGHTS_DEG: [(f64, f64); 19] = [
    (264.0, 57.0),
    (277.0, 57.0),
    (227.0, 68.0),
    (245.0, 72.0),
    (270.0, 73.0),
    (297.0, 72.0),
    (314.0, 68.0),
    (174.0, 74.0),
    (170.0, 80.0),
    (152.0, 86.0),
    (28.0, 86.0),
    (10.0, 80.0),
    (6.0, 74.0),
    (125.0, 65.0),
    (109.0, 68.0),
    (89.0, 69.0),
    (69.0, 68.0),
    (53.0, 64.0),
    (97.0, 56.0),
];

/// The arcs: span in degrees, radius in metres, number of viewpoints. The spans and radii are the
/// thesis'; how the 119 viewpoints are shared among the arcs and the way between them it does not
/// say, so the numbers are ours.
const ARCS: [(f64, f64, usize); 3] = [(40.0, 0.5, 49), (25.0, 0.65, 31), (20.0, 0.8, 25)];
const BETWEEN: usize = 14;

impl Stage {
    pub(crate) fn plan(self, recipe: &Recipe, seed: Seed) -> Plan {
        match self.kind {
            StageKind::LightStageViewpoints => {
                light_stage(recipe, seed, &viewpoints(), &LIGHTS_DEG[4..5])
            }
            StageKind::LightStageLights => {
                light_stage(recipe, seed, &viewpoints()[24..25], &LIGHTS_DEG)
            }
            StageKind::LightStage => light_stage(recipe, seed, &viewpoints(), &LIGHTS_DEG),
            StageKind::MultiLane => multi_lane(recipe, seed),
            StageKind::MultiIllumination => multi_illumination(recipe, seed),
        }
    }
}

/// Azimuth from the front (degrees) and radius (metres) of all viewpoints: the first arc from left
/// to right, the way back to the third radius, the second and the third arc.
pub(crate) fn viewpoints() -> Vec<(f64, f64)> {
    let arc = |(span, radius, n): (f64, f64, usize)| {
        (0..n).map(move |k| (span * (k as f64 / (n - 1) as f64 - 0.5), radius))
    };
    let between = (0..BETWEEN).map(|k| (0.0, 0.5 + 0.3 * (k + 1) as f64 / (BETWEEN + 1) as f64));
    arc(ARCS[0]).chain(between).chain(arc(ARCS[1])).chain(arc(ARCS[2])).collect()
}

fn shot(
    recipe: &Recipe,
    pose: vpr_core::Pose,
    scene: usize,
    lamp: Option<Lamp>,
    seed: Seed,
) -> Shot {
    Shot {
        pose,
        camera: recipe.camera,
        scene,
        light: 0,
        film: recipe.references.film,
        falling: 0.0,
        foreground: Vec::new(),
        lamp,
        seed,
        place: (scene == 0).then_some(0),
    }
}

/// The reference is the middle of the first arc under the light from straight behind the camera.
fn light_stage(recipe: &Recipe, seed: Seed, views: &[(f64, f64)], lights: &[(f64, f64)]) -> Plan {
    let scenes = (0..2)
        .map(|scene| {
            let mut draft = Draft::default();
            toy_town(&mut draft, 0.22, seed.named("town").at(scene));
            Scene::new(draft)
        })
        .collect();
    let mut light = Light::indoors(&recipe.references.condition, seed.named("light"));
    light.ambient *= 0.2;
    let pose = |(azimuth, radius): (f64, f64)| {
        let (a, e) = (azimuth.to_radians(), 32_f64.to_radians());
        let level = radius * libm::cos(e);
        let eye = Vector3::new(level * libm::sin(a), -level * libm::cos(a), radius * libm::sin(e));
        looking_at(eye, Vector3::new(0.0, 0.0, 0.03))
    };
    let lamp = |(azimuth, elevation): (f64, f64)| {
        let (a, e) = (azimuth.to_radians(), elevation.to_radians());
        let level = libm::cos(e);
        let toward = Vec3::new(
            (level * libm::cos(a)) as f32,
            (level * libm::sin(a)) as f32,
            libm::sin(e) as f32,
        );
        Lamp { position: toward * 1.1, colour: Vec3::splat(1.6), reach: 9.0, by_day: true }
    };
    let mut queries = Vec::new();
    for scene in 0..2 {
        for &view in views {
            for &light in lights {
                let own = seed.named("query").at(queries.len() as i64);
                queries.push(shot(recipe, pose(view), scene, Some(lamp(light)), own));
            }
        }
    }
    let first = pose(viewpoints()[24]);
    let reference = shot(recipe, first, 0, Some(lamp(LIGHTS_DEG[4])), seed.named("reference"));
    Plan {
        scenes,
        lights: vec![light],
        references: vec![reference],
        queries,
        grid: Vec::new(),
        world_from_scene: vpr_core::Pose::identity(),
    }
}

/// Lane 0 and step 0 are the reference's; queries go lane by lane within each step.
fn multi_lane(recipe: &Recipe, seed: Seed) -> Plan {
    let street = Street { avenues: 1, spacing_m: 60.0, heading_deg: 0.0, ..Street::default() };
    let two = Recipe { places: 2, new_places: 0, ..recipe.clone() };
    let mut plan = street.plan(&two, seed);
    let bases: Vec<vpr_core::Pose> = plan.references.iter().map(|shot| shot.pose).collect();
    let mut queries = Vec::new();
    for (place, base) in bases.iter().enumerate() {
        for step in 0..3_u8 {
            for lane in 0..5_u8 {
                let offset = Offset {
                    lateral_m: 1.2 * f64::from(lane) - 2.4,
                    forward_m: 3.5 * f64::from(step),
                    ..Offset::default()
                };
                let own = seed.named("query").at(queries.len() as i64);
                // Both places are in the one city, so the place is not told by the scene.
                let taken = shot(recipe, beside(base, &offset, own), 0, None, own);
                queries.push(Shot { place: (place == 0).then_some(0), ..taken });
            }
        }
    }
    let first = beside(&bases[0], &Offset { lateral_m: -2.4, ..Offset::default() }, seed);
    plan.references = vec![shot(recipe, first, 0, None, seed.named("reference"))];
    plan.queries = queries;
    plan
}

fn multi_illumination(recipe: &Recipe, seed: Seed) -> Plan {
    let room = Room { low: Vec3::ZERO, high: Vec3::new(4.6, 5.2, 2.7) };
    let scenes: Vec<Scene> = (0..2)
        .map(|number| {
            let own = seed.named("room").at(number);
            let mut draft = Draft::default();
            let furnisher = Furnisher::new(&mut draft, own.named("furnisher"));
            shell(&mut draft, &room, own);
            furnisher.furnish(&mut draft, &room, 0.1, own.named("things"), (own, 0.0));
            furnisher.table(
                &mut draft,
                Vec3::new(2.2, 3.2, 0.0),
                Vec2::new(1.3, 0.9),
                own.named("table"),
            );
            Scene::new(draft)
        })
        .collect();
    let mut light = Light::indoors(&recipe.references.condition, seed.named("light"));
    light.ambient *= 0.35;
    let eye = Vector3::new(2.3, 0.9, 1.45);
    let pose = looking_at(eye, Vector3::new(2.3, 3.6, 0.9));
    // Five azimuths by five heights over the upper hemisphere; the beam's spot on wall or ceiling
    // becomes the light.
    let flash = |number: usize, scene: &Scene| {
        let azimuth = (number % 5) as f32 / 5.0 * std::f32::consts::TAU + 0.3;
        let elevation = (12.0 + 16.0 * (number / 5) as f32).to_radians();
        let level = libm::cosf(elevation);
        let direction = Vec3::new(
            level * libm::sinf(azimuth),
            level * libm::cosf(azimuth),
            libm::sinf(elevation),
        );
        let origin = Vec3::new(eye.x as f32, eye.y as f32, eye.z as f32);
        let reach = scene.nearest(&Ray { origin, direction }, 20.0).map_or(2.0, |hit| hit.t);
        let position = origin + direction * (reach - 0.25).max(0.1);
        Lamp { position, colour: Vec3::new(1.0, 0.97, 0.92) * 1.8, reach: 12.0, by_day: true }
    };
    let mut queries = Vec::new();
    for (number, scene) in scenes.iter().enumerate() {
        for direction in 0..25 {
            let own = seed.named("query").at(queries.len() as i64);
            queries.push(shot(recipe, pose, number, Some(flash(direction, scene)), own));
        }
    }
    let reference = shot(recipe, pose, 0, Some(flash(20, &scenes[0])), seed.named("reference"));
    Plan {
        scenes,
        lights: vec![light],
        references: vec![reference],
        queries,
        grid: Vec::new(),
        world_from_scene: vpr_core::Pose::identity(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_119_viewpoints_on_the_arcs_of_the_thesis() {
        let views = viewpoints();
        assert_eq!(views.len(), 119);
        assert_eq!(views[0], (-20.0, 0.5));
        assert_eq!(views[48], (20.0, 0.5));
        assert_eq!(views[24], (0.0, 0.5));
        assert_eq!(views[118], (10.0, 0.8));
    }
}
