//! Toy houses, cars and trees on a table, a few centimetres each.

use glam::Vec3;

use crate::{
    geometry::Geometry,
    material::{Material, hue, rgb},
    scene::Draft,
    seed::Seed,
};

/// A town of toys within `reach` metres of the origin, on a table whose top is at z = 0.
pub(crate) fn toy_town(draft: &mut Draft, reach: f32, seed: Seed) {
    let cloth = draft.material(Material::Checks {
        first: hue(seed.at(0).unit(), 0.3, 0.55),
        second: hue(seed.at(0).unit(), 0.25, 0.5),
        size: 0.04,
    });
    let corner = Vec3::new(-0.7, -0.7, 0.0);
    draft.add(Geometry::Patch { corner, u: Vec3::X * 1.4, v: Vec3::Y * 1.4 }, cloth, seed.bits());
    let backdrop =
        draft.material(Material::Plain { colour: hue(seed.at(1).unit(), 0.2, 0.35), gloss: 0.0 });
    let far = Vec3::new(-1.5, 0.9, -0.6);
    draft.add(
        Geometry::Patch { corner: far, u: Vec3::X * 3.0, v: Vec3::Z * 2.2 },
        backdrop,
        seed.at(2).bits(),
    );
    let dark = draft.material(Material::Plain { colour: rgb(40, 44, 52), gloss: 0.3 });
    let leaves = draft.material(Material::Foliage { colour: rgb(66, 120, 52), evergreen: true });
    // A jittered grid keeps the toys apart.
    let cell = reach / 2.5;
    for row in -2..=2_i64 {
        for column in -2..=2_i64 {
            let own = seed.at(10 + row * 10 + column);
            let at = Vec3::new(
                (column as f32 + own.at(0).range(-0.25, 0.25)) * cell,
                (row as f32 + own.at(1).range(-0.25, 0.25)) * cell,
                0.0,
            );
            match own.at(2).index(5) {
                0 | 1 => toy_house(draft, at, cell, dark, own),
                2 => toy_car(draft, at, dark, own),
                3 => toy_tree(draft, at, (backdrop, leaves), own),
                _ => toy_figure(draft, at, own),
            }
        }
    }
}

fn toy_tree(draft: &mut Draft, at: Vec3, (bark, leaves): (u32, u32), seed: Seed) {
    let stem = Geometry::Pillar { base: at, height: 0.05, bottom: 0.006, top: 0.005 };
    draft.add(stem, bark, 0);
    for ball in 0..3 {
        let part = seed.at(20 + ball);
        let shift = Vec3::new(
            part.at(0).range(-0.015, 0.015),
            part.at(1).range(-0.015, 0.015),
            part.at(2).range(0.045, 0.085),
        );
        let crown = Geometry::Ellipsoid {
            center: at + shift,
            radii: Vec3::splat(part.at(3).range(0.018, 0.03)),
            holes: 0.35,
            grain: 0.008,
            seed: part.bits(),
        };
        draft.add(crown, leaves, part.bits());
    }
}

/// A wooden figure: a cone with a ball on it.
fn toy_figure(draft: &mut Draft, at: Vec3, seed: Seed) {
    let colour = hue(seed.at(30).unit(), 0.7, 0.7);
    let plain = draft.material(Material::Plain { colour, gloss: 0.1 });
    let r = seed.at(31).range(0.012, 0.026);
    let body = Geometry::Pillar { base: at, height: 3.0 * r, bottom: r, top: 0.5 * r };
    draft.add(body, plain, seed.bits());
    let head = Geometry::ball(at + Vec3::Z * (3.4 * r), Vec3::splat(0.6 * r));
    draft.add(head, plain, seed.bits());
}

fn toy_house(draft: &mut Draft, at: Vec3, cell: f32, dark: u32, seed: Seed) {
    let walls = draft.material(Material::Plain {
        colour: hue(seed.at(3).unit(), 0.5, seed.at(4).range(0.5, 0.95)),
        gloss: 0.05,
    });
    let roof = draft.material(Material::Tiles {
        colour: hue(seed.at(5).range(-0.05, 0.1), 0.7, 0.55),
        size: 0.012,
    });
    let size = Vec3::new(
        seed.at(6).range(0.5, 0.75),
        seed.at(7).range(0.45, 0.7),
        seed.at(8).range(0.5, 1.2),
    ) * cell;
    let low = at - Vec3::new(0.5 * size.x, 0.5 * size.y, 0.0);
    let high = low + size;
    draft.add(Geometry::span(low, high), walls, seed.bits());
    let top = high.z + 0.35 * size.y;
    let ridge = [Vec3::new(low.x - 0.004, at.y, top), Vec3::new(high.x + 0.004, at.y, top)];
    for y in [low.y - 0.006, high.y + 0.006] {
        let eave = [
            Vec3::new(low.x - 0.004, y, high.z - 0.004),
            Vec3::new(high.x + 0.004, y, high.z - 0.004),
        ];
        draft.add(Geometry::triangle(eave[0], eave[1], ridge[1]), roof, seed.bits());
        draft.add(Geometry::triangle(eave[0], ridge[1], ridge[0]), roof, seed.bits());
    }
    for x in [low.x, high.x] {
        let base = [Vec3::new(x, low.y, high.z), Vec3::new(x, high.y, high.z)];
        draft.add(
            Geometry::triangle(base[0], base[1], Vec3::new(x, at.y, top)),
            walls,
            seed.bits(),
        );
    }
    let n = 2 + seed.at(9).index(2);
    for level in 0..(size.z / 0.035) as usize {
        for window in 0..n {
            let x = low.x + size.x * (window as f32 + 0.5) / n as f32;
            let center = Vec3::new(x, low.y, low.z + 0.02 + 0.035 * level as f32);
            let is_door = level == 0 && window == seed.at(10).index(n);
            let pane = if is_door {
                Vec3::new(0.012, 0.003, 0.034)
            } else {
                Vec3::new(0.012, 0.003, 0.015)
            };
            draft.add(Geometry::block(center, pane, 0.0), dark, seed.bits());
        }
    }
}

fn toy_car(draft: &mut Draft, at: Vec3, dark: u32, seed: Seed) {
    let paint =
        draft.material(Material::Plain { colour: hue(seed.at(3).unit(), 0.85, 0.7), gloss: 0.3 });
    let angle = seed.at(4).range(0.0, std::f32::consts::TAU);
    draft.add(
        Geometry::block(at + Vec3::Z * 0.014, Vec3::new(0.07, 0.03, 0.016), angle),
        paint,
        seed.bits(),
    );
    draft.add(
        Geometry::block(at + Vec3::Z * 0.028, Vec3::new(0.036, 0.027, 0.013), angle),
        dark,
        seed.bits(),
    );
    for end in [-0.022, 0.022] {
        for side in [-0.015, 0.015] {
            let (sin, cos) = (libm::sinf(angle), libm::cosf(angle));
            let wheel = Vec3::new(end * cos - side * sin, end * sin + side * cos, 0.007);
            draft.add(Geometry::ball(at + wheel, Vec3::splat(0.007)), dark, 0);
        }
    }
}
