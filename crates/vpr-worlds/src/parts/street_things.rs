//! What stands and moves on streets: lamps, signs, benches, cars, people.

use glam::{Vec2, Vec3};

use crate::{
    camera::Camera,
    geometry::Geometry,
    material::{Material, hue, rgb},
    scene::{Draft, Lamp, Shape},
    seed::Seed,
};

/// Shared materials of street furniture.
pub(crate) struct StreetKit {
    metal: u32,
    wood: u32,
    bulb: u32,
    tyre: u32,
    glass: u32,
    skin: u32,
    cars: [u32; 10],
    coats: [u32; 6],
    signs: [u32; 4],
}

impl StreetKit {
    pub(crate) fn new(draft: &mut Draft, seed: Seed) -> Self {
        let metal = hue(seed.at(0).unit(), 0.3, seed.at(1).range(0.15, 0.45));
        let cars = [
            rgb(176, 179, 183),
            rgb(40, 42, 48),
            rgb(134, 36, 38),
            rgb(52, 70, 104),
            rgb(222, 221, 216),
            rgb(92, 100, 86),
            rgb(112, 116, 121),
            rgb(30, 33, 40),
            rgb(150, 140, 122),
            rgb(72, 84, 96),
        ];
        Self {
            metal: draft.material(Material::Plain { colour: metal, gloss: 0.1 }),
            wood: draft.material(Material::Boards { colour: rgb(140, 98, 62), width: 0.12 }),
            bulb: draft
                .material(Material::Lamp { colour: Vec3::new(6.0, 4.6, 2.8), by_day: false }),
            tyre: draft.material(Material::Plain { colour: rgb(36, 36, 38), gloss: 0.02 }),
            glass: draft.material(Material::Plain { colour: rgb(40, 46, 52), gloss: 0.5 }),
            skin: draft.material(Material::Plain { colour: rgb(205, 160, 130), gloss: 0.0 }),
            cars: cars.map(|colour| draft.material(Material::Car { colour })),
            coats: std::array::from_fn(|k| {
                let own = seed.named("coats").at(k as i64);
                let colour = hue(own.at(0).unit(), 0.5, own.at(1).range(0.2, 0.8));
                draft.material(Material::Plain { colour, gloss: 0.0 })
            }),
            signs: std::array::from_fn(|k| {
                let own = seed.named("signs").at(k as i64);
                let ground = hue(own.at(0).unit(), 0.8, own.at(1).range(0.25, 0.7));
                draft.material(Material::Sign { ground, ink: rgb(240, 240, 235), lit: false })
            }),
        }
    }

    /// A street lamp whose head hangs `reach` metres from its foot.
    pub(crate) fn lamp(&self, draft: &mut Draft, foot: Vec3, reach: Vec2, seed: Seed) {
        let height = 6.4;
        draft.add(
            Geometry::Pillar { base: foot, height, bottom: 0.1, top: 0.06 },
            self.metal,
            seed.bits(),
        );
        let head = foot + Vec3::new(reach.x, reach.y, height);
        let middle = foot + Vec3::new(0.5 * reach.x, 0.5 * reach.y, height);
        let size = Vec3::new(reach.x.abs() + 0.08, reach.y.abs() + 0.08, 0.08);
        draft.add(Geometry::block(middle, size, 0.0), self.metal, seed.bits());
        draft.add(Geometry::block(head, Vec3::new(0.5, 0.35, 0.14), 0.0), self.bulb, seed.bits());
        let colour =
            Vec3::new(1.0, 0.74, 0.42).lerp(Vec3::new(0.9, 0.95, 1.0), seed.at(3).unit() * 0.5);
        draft.lamps.push(Lamp {
            position: head - Vec3::Z * 0.25,
            colour: colour * 9.0,
            reach: 22.0,
            by_day: false,
        });
    }

    /// A panel with words on a pole, its face turned by `angle` from +x.
    pub(crate) fn sign(&self, draft: &mut Draft, foot: Vec3, angle: f32, seed: Seed) {
        let height = seed.at(0).range(2.3, 3.0);
        draft.add(Geometry::Pillar { base: foot, height, bottom: 0.04, top: 0.04 }, self.metal, 0);
        let size = Vec3::new(0.06, seed.at(1).range(0.5, 1.3), seed.at(2).range(0.3, 0.8));
        let center = foot + Vec3::Z * (height - 0.4);
        draft.add(
            Geometry::block(center, size, angle),
            self.signs[seed.at(3).index(4)],
            seed.bits(),
        );
    }

    /// A bench along y, or a bin, or a bollard.
    pub(crate) fn small_thing(&self, draft: &mut Draft, foot: Vec3, seed: Seed) {
        match seed.at(0).index(3) {
            0 => {
                draft.add(
                    Geometry::block(foot + Vec3::Z * 0.45, Vec3::new(0.45, 1.7, 0.06), 0.0),
                    self.wood,
                    seed.bits(),
                );
                draft.add(
                    Geometry::block(
                        foot + Vec3::new(0.2, 0.0, 0.75),
                        Vec3::new(0.05, 1.7, 0.4),
                        0.0,
                    ),
                    self.wood,
                    seed.bits(),
                );
                for end in [-0.7, 0.7] {
                    draft.add(
                        Geometry::block(
                            foot + Vec3::new(0.0, end, 0.22),
                            Vec3::new(0.4, 0.06, 0.44),
                            0.0,
                        ),
                        self.metal,
                        0,
                    );
                }
            }
            1 => draft.add(
                Geometry::Pillar { base: foot, height: 0.95, bottom: 0.22, top: 0.3 },
                self.signs[seed.at(1).index(4)],
                seed.bits(),
            ),
            _ => {
                let size = Vec3::new(0.4, 0.5, 1.3);
                draft.add(
                    Geometry::block(foot + Vec3::Z * 0.65, size, 0.0),
                    self.cars[seed.at(1).index(self.cars.len())],
                    seed.bits(),
                );
            }
        }
    }

    /// A car whose middle is above `foot`, its nose turned by `angle` from +x.
    pub(crate) fn car(&self, draft: &mut Draft, foot: Vec3, angle: f32, seed: Seed) {
        let van = seed.at(0).chance(0.18);
        let length = if van { 5.2 } else { seed.at(1).range(3.9, 4.6) };
        let body = if van { 1.85 } else { 0.62 };
        let paint = self.cars[seed.at(2).index(self.cars.len())];
        let turn = Vec2::new(libm::cosf(angle), libm::sinf(angle));
        let along = Vec3::new(turn.x, turn.y, 0.0);
        let across = Vec3::new(-turn.y, turn.x, 0.0);
        let size = Vec3::new(length, 1.76, body);
        draft.add_moving(
            Geometry::block(foot + Vec3::Z * (0.3 + 0.5 * body), size, angle),
            paint,
            seed.bits(),
        );
        if !van {
            let cabin = Vec3::new(length * 0.5, 1.56, 0.5);
            let center = foot - along * 0.25 + Vec3::Z * (0.3 + body + 0.25);
            draft.add_moving(Geometry::block(center, cabin, angle), self.glass, seed.bits());
            let roof = Vec3::new(length * 0.46, 1.5, 0.08);
            draft.add_moving(
                Geometry::block(center + Vec3::Z * 0.27, roof, angle),
                paint,
                seed.bits(),
            );
        }
        for (end, side) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
            let wheel =
                foot + along * (end * 0.31 * length) + across * (side * 0.8) + Vec3::Z * 0.32;
            let radii =
                Vec3::new(0.14, 0.14, 0.32) + Vec3::new(along.x.abs(), along.y.abs(), 0.0) * 0.18;
            draft.add_moving(Geometry::ball(wheel, radii), self.tyre, 0);
        }
    }

    /// Somebody standing or walking.
    pub(crate) fn person(&self, draft: &mut Draft, foot: Vec3, seed: Seed) {
        let mut parts = Vec::new();
        let angle = seed.at(9).range(0.0, std::f32::consts::TAU);
        self.body(&mut parts, foot, Vec2::new(libm::cosf(angle), libm::sinf(angle)), seed);
        draft.shapes.extend(parts);
    }

    /// A body whose shoulders lie along `across`.
    fn body(&self, shapes: &mut Vec<Shape>, foot: Vec3, across: Vec2, seed: Seed) {
        let tall = seed.at(0).range(0.88, 1.08);
        let coat = self.coats[seed.at(1).index(6)];
        let trousers = self.coats[seed.at(2).index(6)];
        let mut add = |geometry, material| {
            shapes.push(Shape { geometry, material, seed: seed.bits(), moving: true });
        };
        for side in [-0.1, 0.1] {
            let step = Vec2::new(-across.y, across.x) * (side * seed.at(3).range(-1.5, 1.5));
            let base = foot + (across * side + step).extend(0.0);
            add(Geometry::Pillar { base, height: 0.86 * tall, bottom: 0.08, top: 0.12 }, trousers);
        }
        add(
            Geometry::ball(foot + Vec3::Z * (1.12 * tall), Vec3::new(0.24, 0.22, 0.38 * tall)),
            coat,
        );
        for side in [-0.27, 0.27] {
            add(
                Geometry::ball(
                    foot + (across * side).extend(1.08 * tall),
                    Vec3::new(0.08, 0.08, 0.34 * tall),
                ),
                coat,
            );
        }
        add(Geometry::ball(foot + Vec3::Z * (1.62 * tall), Vec3::new(0.1, 0.11, 0.14)), self.skin);
    }
}

/// In how many columns the view is cut for lorries to stand in.
const COLUMNS: usize = 8;

/// How far before the camera the things stand that hide the view, metres.
pub(crate) const OUTDOORS: f64 = 3.0;
/// The same between walls.
pub(crate) const INDOORS: f64 = 0.6;

/// Lorries, and people before them, right in front of a camera until `share` of its view's width
/// is hidden.
///
/// The view is cut in columns; hidden ones are drawn without repetition and hidden from the bottom
/// to the top, so the share is exact up to half a column of [`COLUMNS`].
pub(crate) fn hide_behind(
    kit: &StreetKit,
    (pose, camera): (&vpr_core::Pose, &Camera),
    share: f64,
    depth: f64,
    seed: Seed,
) -> Vec<Shape> {
    let mut order: Vec<usize> = (0..COLUMNS).collect();
    order.sort_by_key(|&column| seed.at(column as i64).bits());
    let half = 0.5 * f64::from(camera.width) / camera.focal;
    let right = pose.rotation * nalgebra::Vector3::x();
    let across = Vec2::new(right.x as f32, right.y as f32);
    let n_hidden = (share * COLUMNS as f64).round() as usize;
    let mut shapes = Vec::new();
    for &column in order.iter().take(n_hidden) {
        let own = seed.at(1_000 + column as i64);
        let at = |depth: f64| {
            let aside = (2.0 * (column as f64 + 0.5) / COLUMNS as f64 - 1.0) * half * depth;
            let there = pose * nalgebra::Point3::new(aside, 0.0, depth);
            Vec3::new(there.x as f32, there.y as f32, pose.translation.z as f32 - 1.55)
        };
        let wide = (2.0 * half * depth / COLUMNS as f64) as f32;
        let turn = across.normalize_or(Vec2::X);
        let side = Geometry::Block {
            center: at(depth) + Vec3::Z * 2.0,
            half: Vec3::new(0.5 * wide, 0.01, 6.0),
            turn,
        };
        let material = kit.cars[own.at(5).index(kit.cars.len())];
        shapes.push(Shape { geometry: side, material, seed: own.bits(), moving: true });
        kit.body(&mut shapes, at(depth * 2.2 / 3.0), across, own);
    }
    shapes
}
