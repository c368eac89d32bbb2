//! Seven rooms seen along the real camera paths of 7-Scenes, or along hand-held ones of our own.

use std::{fs, path::Path};

use glam::{Vec2, Vec3};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use vpr_core::Error;

use super::{Plan, Shot, looking_at};
use crate::{
    light::Light,
    parts::{Furnisher, Room, shell},
    recipe::{Recipe, SevenScenes},
    scene::{Draft, Scene},
    seed::Seed,
    traverse::Traverse,
};

impl SevenScenes {
    pub(crate) fn plan(&self, recipe: &Recipe, seed: Seed) -> vpr_core::Result<Plan> {
        let seed = seed.named(&self.scene);
        let n_queries = recipe.places.div_ceil(recipe.query_every);
        let (train, test) = match &self.poses {
            Some(folder) => {
                let [train, test] = self.paths(folder).map(|path| read_poses(&path));
                (thinned(&train?, recipe.places), thinned(&test?, n_queries))
            }
            None => (
                hand_held(recipe.places, seed.named("train")),
                hand_held(n_queries, seed.named("test")),
            ),
        };
        let up = train.iter().map(|pose| pose.rotation * -Vector3::y()).sum::<Vector3<f64>>();
        let upright = UnitQuaternion::rotation_between(&up, &Vector3::z())
            .unwrap_or_else(UnitQuaternion::identity);
        let scene_from_world = Isometry3::from_parts(Translation3::identity(), upright);
        let within = |poses: &[vpr_core::Pose]| -> Vec<_> {
            poses.iter().map(|pose| scene_from_world * pose).collect()
        };
        let (train, test) = (within(&train), within(&test));
        let elsewhere = elsewhere(recipe, seed.named("elsewhere"));
        let mut scenes = vec![
            build(&train, &test, &recipe.references, seed, 0),
            build(&train, &test, &recipe.queries, seed, 1),
        ];
        let lights = vec![
            Light::indoors(&recipe.references.condition, seed.named("first light")),
            Light::indoors(&recipe.queries.condition, seed.named("second light")),
        ];
        let mut queries = shots(recipe, &recipe.queries, &test, 1, seed.named("queries"));
        if !elsewhere.is_empty() {
            let own = seed.named("elsewhere");
            let new = shots(recipe, &recipe.queries, &elsewhere, 1, own.named("queries"));
            queries.extend(new.into_iter().map(|shot| Shot { scene: 2, place: None, ..shot }));
            scenes.push(build(&elsewhere, &[], &recipe.queries, own, 1));
        }
        Ok(Plan {
            scenes,
            lights,
            references: shots(recipe, &recipe.references, &train, 0, seed.named("references")),
            queries,
            grid: Vec::new(),
            world_from_scene: scene_from_world.inverse(),
        })
    }
}

/// Poses of the new places: in another room, a kilometre away.
fn elsewhere(recipe: &Recipe, seed: Seed) -> Vec<vpr_core::Pose> {
    let away = Translation3::new(1_000.0, 0.0, 0.0);
    hand_held(recipe.new_places, seed).into_iter().map(|pose| away * pose).collect()
}

/// A room around all cameras, with 1.6 m between them and the walls.
fn build(
    train: &[vpr_core::Pose],
    test: &[vpr_core::Pose],
    traverse: &Traverse,
    seed: Seed,
    number: i64,
) -> Scene {
    let centers: Vec<Vec3> = train
        .iter()
        .chain(test)
        .map(|pose| pose.translation.vector)
        .map(|at| Vec3::new(at.x as f32, at.y as f32, at.z as f32))
        .collect();
    let low = centers.iter().fold(Vec3::INFINITY, |low, &at| low.min(at));
    let high = centers.iter().fold(Vec3::NEG_INFINITY, |high, &at| high.max(at));
    let room = Room { low: low - Vec3::new(1.6, 1.6, 1.2), high: high + Vec3::new(1.6, 1.6, 1.1) };
    let mut draft = Draft::default();
    let furnisher = Furnisher::new(&mut draft, seed.named("furnisher"));
    shell(&mut draft, &room, seed.named("shell"));
    let changed = traverse.condition.changed as f32;
    furnisher.furnish(
        &mut draft,
        &room,
        0.08,
        seed.named("things"),
        (seed.named("visit").at(number), changed),
    );
    let lit = 1.0 - 0.67 * traverse.condition.darkness as f32;
    furnisher.lights(&mut draft, &room, 2.6, lit, seed.named("lamps"));
    // Tables where no camera passes.
    for table in 0..12 {
        let own = seed.named("table").at(table);
        let at = Vec3::new(
            own.at(0).range(room.low.x + 0.9, room.high.x - 0.9),
            own.at(1).range(room.low.y + 0.9, room.high.y - 0.9),
            room.low.z,
        );
        let free = centers
            .iter()
            .all(|center| Vec2::new(center.x - at.x, center.y - at.y).length() > 0.75);
        if free {
            furnisher.table(
                &mut draft,
                at,
                Vec2::new(own.at(2).range(0.5, 1.0), own.at(3).range(0.4, 0.8)),
                own,
            );
        }
    }
    Scene::new(draft)
}

fn shots(
    recipe: &Recipe,
    traverse: &Traverse,
    poses: &[vpr_core::Pose],
    scene: usize,
    seed: Seed,
) -> Vec<Shot> {
    let shot = |(index, pose): (usize, &vpr_core::Pose)| Shot {
        pose: *pose,
        camera: recipe.camera,
        scene,
        light: scene,
        film: traverse.film,
        falling: 0.0,
        foreground: Vec::new(),
        lamp: None,
        seed: seed.at(index as i64),
        place: Some(index),
    };
    poses.iter().enumerate().map(shot).collect()
}

/// Camera-to-world poses in the order of the frames' names.
fn read_poses(path: &Path) -> vpr_core::Result<Vec<vpr_core::Pose>> {
    let text = fs::read_to_string(path).map_err(Error::io(path))?;
    let mut rows = Vec::new();
    for (number, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let values: Vec<f64> =
            fields.iter().skip(1).filter_map(|field| field.parse().ok()).collect();
        if fields.len() != 9 || values.len() != 8 || values.iter().any(|value| !value.is_finite()) {
            let reason = "is not `name qw qx qy qz tx ty tz f`";
            return Err(Error::format(path, format!("line {}", number + 1), reason));
        }
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(
            values[0], values[1], values[2], values[3],
        ));
        let pose =
            Isometry3::from_parts(Translation3::new(values[4], values[5], values[6]), rotation);
        rows.push((fields[0].to_owned(), pose.inverse()));
    }
    if rows.is_empty() {
        return Err(Error::format(path, "line 1", "there is no pose"));
    }
    rows.sort_by(|a, b| a.0.cmp(&b.0));
    Ok(rows.into_iter().map(|(_, pose)| pose).collect())
}

/// Evenly spaced ones, at most `n`.
fn thinned(poses: &[vpr_core::Pose], n: usize) -> Vec<vpr_core::Pose> {
    let n = n.min(poses.len());
    (0..n).map(|k| poses[k * poses.len() / n]).collect()
}

/// A camera held in the hand: it wanders within a metre and looks at a corner of the room.
fn hand_held(n: usize, seed: Seed) -> Vec<vpr_core::Pose> {
    let wander = |t: f64, key: i64| {
        let own = seed.at(key);
        (0..3_u8)
            .map(|wave| {
                let draw = own.at(i64::from(wave));
                let rate = f64::from(draw.at(0).range(0.6, 1.6)) * f64::from(1 + wave);
                let phase = f64::from(draw.at(1).range(0.0, std::f32::consts::TAU));
                libm::sin(t * rate + phase) / f64::from(1 + wave)
            })
            .sum::<f64>()
    };
    (0..n)
        .map(|k| {
            let t = 12.0 * k as f64 / n.max(1) as f64;
            let eye = Vector3::new(0.55 * wander(t, 0), 0.4 * wander(t, 1), 0.2 * wander(t, 2));
            let look = Vector3::new(
                2.2 + 0.5 * wander(t, 3),
                1.2 * wander(t, 4),
                -0.4 + 0.3 * wander(t, 5),
            );
            looking_at(eye, look)
        })
        .collect()
}
