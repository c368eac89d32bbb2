//! What stands beside a railway track: woods, farms, tunnels, stations.

use glam::{Vec2, Vec3};

use super::track::{Line, bend};
use crate::{
    geometry::Geometry,
    material::{Material, Wall, hue, rgb},
    noise::{cloudy, lerp},
    parts::{Grove, Lot, Species, StreetKit, Style, house},
    scene::Draft,
    seed::Seed,
    traverse::Traverse,
};

/// Length of a tunnel, metres.
pub(super) const TUNNEL: f32 = 55.0;
/// Length of a platform, metres.
pub(super) const STATION: f32 = 90.0;

impl Line<'_> {
    /// Trees, dense where the ground is wooded.
    pub(super) fn woods(
        &self,
        draft: &mut Draft,
        grove: &Grove,
        inside: &impl Fn(f32) -> bool,
        beside: &impl Fn(f32) -> bool,
    ) {
        let seed = self.seed.named("woods");
        let threshold = 1.0 - self.rail.woods as f32;
        let n = ((self.length + 500.0) / 4.0) as i64;
        for row in -20..n {
            for column in 0..10 {
                let own = seed.at(row).at(column);
                let side = if column % 2 == 0 { -1.0 } else { 1.0 };
                let spread = own.at(0).unit();
                let across = side * (7.5 + 95.0 * spread * spread);
                let y = (row as f32 + own.at(1).unit()) * 4.0;
                let dense =
                    cloudy(seed.bits(), Vec2::new(y / 90.0, side * 3.0 + across / 120.0), 3, 0.0);
                let wooded = lerp(0.15, 0.85, dense.clamp(0.2, 0.8)) > threshold;
                let chance = if wooded { 0.75 } else { 0.05 };
                if inside(y) || (beside(y) && across.abs() < 30.0) || !own.at(2).chance(chance) {
                    continue;
                }
                let foot = Vec3::new(bend(y) + across, y, self.height(across, y) - 0.2);
                if foot.z < -5.0 {
                    continue;
                }
                let conifers = cloudy(seed.bits() ^ 3, Vec2::new(y / 150.0, side), 2, 0.0);
                let species = if own.at(3).unit() < conifers + 0.1 {
                    Species::Conifer
                } else {
                    own.at(4).pick(&[
                        Species::Broad,
                        Species::Poplar,
                        Species::Bush,
                        Species::Broad,
                    ])
                };
                let height = if species == Species::Bush {
                    own.at(5).range(1.0, 2.4)
                } else {
                    own.at(5).range(4.0, 13.0)
                };
                grove.plant(draft, species, foot, height, own);
            }
        }
    }

    /// Lone houses with fields around them.
    pub(super) fn farms(&self, draft: &mut Draft, beside: &impl Fn(f32) -> bool) {
        let seed = self.seed.named("farms");
        let n = (self.length / 130.0) as i64;
        for farm in 0..n {
            let own = seed.at(farm);
            let y = (farm as f32 + own.at(0).unit()) * 130.0;
            let side = if own.at(1).chance(0.5) { 1.0 } else { -1.0 };
            let across = side * own.at(2).range(22.0, 70.0);
            let level = self.height(across, y) - 0.3;
            if beside(y) || level < -3.0 || own.at(3).chance(0.35) {
                continue;
            }
            let lot = Lot {
                front: bend(y) + across,
                span: (y, y + own.at(4).range(7.0, 14.0)),
                depth: own.at(5).range(6.0, 9.0),
                side: -side,
                level,
            };
            house(draft, &lot, &Style::new(own.named("style")), own, own.named("shop"));
        }
    }
}

/// A tube with a portal at both ends.
pub(super) fn tunnel(draft: &mut Draft, start: f32, seed: Seed) {
    let stone = draft.material(Material::Wall {
        kind: Wall::Stone,
        colour: rgb(128, 122, 112) * seed.at(0).range(0.6, 1.1),
    });
    let dark = draft.material(Material::Plain { colour: Vec3::splat(0.006), gloss: 0.0 });
    for piece in 0..(TUNNEL / 5.0) as i32 {
        let y = start + (piece as f32 + 0.5) * 5.0;
        let x = bend(y);
        for (low, high) in [(-4.2, -3.4), (3.4, 4.2)] {
            draft.add(
                Geometry::span(
                    Vec3::new(x + low, y - 3.0, -1.0),
                    Vec3::new(x + high, y + 3.0, 7.5),
                ),
                dark,
                0,
            );
        }
        draft.add(
            Geometry::span(Vec3::new(x - 4.0, y - 3.0, 6.4), Vec3::new(x + 4.0, y + 3.0, 7.5)),
            dark,
            0,
        );
    }
    for (y, out) in [(start - 1.2, -1.0), (start + TUNNEL + 1.2, 1.0)] {
        let x = bend(y);
        for (low, high) in [
            (Vec3::new(-9.0, 0.0, -2.0), Vec3::new(-3.2, 0.0, 9.5)),
            (Vec3::new(3.2, 0.0, -2.0), Vec3::new(9.0, 0.0, 9.5)),
            (Vec3::new(-3.2, 0.0, 6.2), Vec3::new(3.2, 0.0, 10.2)),
        ] {
            let at = Vec3::new(x, y, 0.0);
            draft.add(
                Geometry::span(at + low - Vec3::Y * 0.6, at + high + Vec3::Y * 0.6),
                stone,
                seed.bits(),
            );
        }
        // Deep inside nothing is seen: neither from outside nor from within.
        let corner = Vec3::new(x - 3.4, y - out * 3.0, -1.0);
        draft.add(Geometry::Patch { corner, u: Vec3::X * 6.8, v: Vec3::Z * 8.0 }, dark, 0);
    }
}

/// A platform with its lamps, signs, people and house.
pub(super) fn station(
    draft: &mut Draft,
    kit: &StreetKit,
    start: f32,
    seed: Seed,
    (people, traverse): (Seed, &Traverse),
) {
    let side = if seed.at(0).chance(0.5) { 1.0 } else { -1.0 };
    let slab = draft.material(Material::Pavement { colour: rgb(160, 156, 148) });
    let name = draft.material(Material::Sign {
        ground: hue(seed.at(1).unit(), 0.7, 0.4),
        ink: Vec3::splat(0.85),
        lit: true,
    });
    let middle = bend(start + 0.5 * STATION);
    for piece in 0..(STATION / 10.0) as i64 {
        let y = start + piece as f32 * 10.0;
        let edge = bend(y + 5.0) + side * 2.3;
        let (a, b) = (edge, edge + side * 6.0);
        draft.add(
            Geometry::span(Vec3::new(a.min(b), y, -1.0), Vec3::new(a.max(b), y + 10.0, 0.75)),
            slab,
            seed.bits(),
        );
        if piece % 3 == 1 {
            kit.lamp(
                draft,
                Vec3::new(edge + side * 4.0, y, 0.75),
                Vec2::new(-side * 1.2, 0.0),
                seed.at(20 + piece),
            );
            let panel = Vec3::new(edge + side * 4.4, y + 4.0, 2.9);
            draft.add(Geometry::block(panel, Vec3::new(3.0, 0.1, 0.6), 0.0), name, seed.bits());
        }
        if people.at(piece).chance(0.7 * traverse.condition.traffic as f32) {
            let at = Vec3::new(edge + side * people.at(50 + piece).range(1.0, 4.5), y + 3.0, 0.75);
            kit.person(draft, at, people.at(80 + piece));
        }
    }
    let front = middle + side * 9.5;
    let lot = Lot {
        front,
        span: (start + 25.0, start + 25.0 + seed.at(2).range(16.0, 34.0)),
        depth: 9.0,
        side: -side,
        level: 0.6,
    };
    house(draft, &lot, &Style::new(seed.named("style")), seed, seed.named("shop"));
}
