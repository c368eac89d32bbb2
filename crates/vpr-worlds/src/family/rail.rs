//! One railway track through hills, woods, stations and tunnels.

use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};

use super::{Plan, level_pose, two_traverses};
use crate::{
    geometry::Geometry,
    light::Light,
    material::{Material, Wall, hue, rgb},
    noise::{cloudy, lerp, step},
    parts::{Grove, Lot, OUTDOORS, Species, StreetKit, Style, hide_behind, house},
    recipe::{Recipe, Refusal, Traverse, between},
    scene::{Draft, Scene},
    seed::Seed,
};

/// A track that winds northwards (+y), seen from the driver's seat.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Rail {
    /// Distance between places along y, metres.
    pub spacing_m: f64,
    /// Share of the land under woods.
    pub woods: f64,
    /// Stations per kilometre.
    pub stations_per_km: f64,
    /// Tunnels per kilometre; images inside are nearly black.
    pub tunnels_per_km: f64,
    /// Height of the hills, metres.
    pub hills_m: f64,
    /// Camera height above the rails.
    pub eye_m: f64,
}

impl Default for Rail {
    fn default() -> Self {
        Self {
            spacing_m: 18.0,
            woods: 0.5,
            stations_per_km: 0.8,
            tunnels_per_km: 0.5,
            hills_m: 55.0,
            eye_m: 2.6,
        }
    }
}

/// Distances from the track at which the ground is sampled.
const ACROSS: [f32; 26] = [
    -600.0, -400.0, -260.0, -170.0, -115.0, -80.0, -58.0, -42.0, -31.0, -23.0, -17.0, -11.0, -5.0,
    5.0, 11.0, 17.0, 23.0, 31.0, 42.0, 58.0, 80.0, 115.0, 170.0, 260.0, 400.0, 600.0,
];
/// Distance between samples along the track.
const ALONG: f32 = 9.0;
/// Length of a straight piece of track.
const PIECE: f32 = 9.1;
const TUNNEL: f32 = 55.0;
const STATION: f32 = 90.0;

impl Rail {
    pub(crate) fn check(&self) -> Result<(), Refusal> {
        between("rail.spacing_m", self.spacing_m, 0.5, 500.0)?;
        between("rail.woods", self.woods, 0.0, 1.0)?;
        between("rail.stations_per_km", self.stations_per_km, 0.0, 4.0)?;
        between("rail.tunnels_per_km", self.tunnels_per_km, 0.0, 4.0)?;
        between("rail.hills_m", self.hills_m, 0.0, 400.0)?;
        between("rail.eye_m", self.eye_m, 0.5, 6.0)
    }

    pub(crate) fn plan(&self, recipe: &Recipe, seed: Seed) -> Plan {
        let steps = recipe.steps(self.spacing_m);
        let n = steps.last().map_or(0, |last| last + 1);
        let line = Line { rail: self, length: n as f32 * self.spacing_m as f32, seed };
        let route: Vec<_> = steps
            .into_iter()
            .map(|place| {
                let y = (place as f64 * self.spacing_m) as f32 + 2.0;
                let heading = std::f64::consts::FRAC_PI_2 - f64::from(libm::atanf(slope(y)));
                level_pose(Vec3::new(bend(y), y, self.eye_m as f32), heading)
            })
            .collect();
        let (first, _) = line.build(&recipe.references, 0);
        let (second, kit) = line.build(&recipe.queries, 1);
        let lights = vec![
            Light::new(&recipe.references.condition, seed.named("first light")),
            Light::new(&recipe.queries.condition, seed.named("second light")),
        ];
        let share = recipe.queries.condition.occlusion;
        let (references, queries) = two_traverses(recipe, &route, seed, |pose, own| {
            hide_behind(&kit, (pose, &recipe.camera), share, OUTDOORS, own)
        });
        Plan {
            scenes: vec![first, second],
            lights,
            references,
            queries,
            grid: Vec::new(),
            world_from_scene: vpr_core::Pose::identity(),
        }
    }
}

/// x of the track at y.
fn bend(y: f32) -> f32 {
    70.0 * libm::sinf(y / 410.0) + 22.0 * libm::sinf(y / 150.0 + 1.0)
}

fn slope(y: f32) -> f32 {
    70.0 / 410.0 * libm::cosf(y / 410.0) + 22.0 / 150.0 * libm::cosf(y / 150.0 + 1.0)
}

struct Line<'a> {
    rail: &'a Rail,
    length: f32,
    seed: Seed,
}

impl Line<'_> {
    /// Things per kilometre as their places along y.
    fn along(&self, what: &str, per_km: f64, size: f32) -> Vec<f32> {
        let seed = self.seed.named(what);
        let n = (self.length / 1_000.0 * per_km as f32).round() as i64;
        let share = self.length / n.max(1) as f32;
        (0..n)
            .map(|k| share * (k as f32 + seed.at(k).range(0.1, 0.8)) - 0.5 * size + 30.0)
            .collect()
    }

    fn height(&self, across: f32, y: f32) -> f32 {
        let seed = self.seed.named("hills").bits();
        let at = Vec2::new(bend(y) + across, y);
        let broad = cloudy(seed, at / 260.0, 4, 0.0) - 0.42;
        let away = step(6.0, 140.0, across.abs());
        let bank =
            7.0 * (cloudy(seed ^ 1, Vec2::new(y / 70.0, 0.5 + across.signum()), 2, 0.0) - 0.5);
        let near = step(5.0, 18.0, across.abs()) * bank;
        near + away * broad * 2.2 * self.rail.hills_m as f32 - 0.5
    }

    fn build(&self, traverse: &Traverse, number: i64) -> (Scene, StreetKit) {
        let mut draft = Draft::default();
        let kit = StreetKit::new(&mut draft, self.seed.named("kit"));
        let grove =
            Grove::new(&mut draft, self.seed.named("grove"), traverse.condition.bare as f32);
        let tunnels = self.along("tunnels", self.rail.tunnels_per_km, TUNNEL);
        let stations: Vec<f32> = self
            .along("stations", self.rail.stations_per_km, STATION)
            .into_iter()
            .filter(|s| tunnels.iter().all(|t| (t - s).abs() > 120.0))
            .collect();
        let inside = |y: f32| tunnels.iter().any(|t| (*t..t + TUNNEL).contains(&y));
        let beside = |y: f32| stations.iter().any(|s| (*s - 12.0..s + STATION + 12.0).contains(&y));
        self.ground(&mut draft, &inside);
        self.track(&mut draft);
        self.woods(&mut draft, &grove, &inside, &beside);
        for (k, &start) in (0..).zip(&tunnels) {
            tunnel(&mut draft, start, self.seed.named("tunnel").at(k));
        }
        for (k, &start) in (0..).zip(&stations) {
            let people = self.seed.named("people").at(number).at(k);
            station(&mut draft, &kit, start, self.seed.named("station").at(k), (people, traverse));
        }
        self.farms(&mut draft, &beside);
        (Scene::new(draft), kit)
    }

    fn ground(&self, draft: &mut Draft, inside: &impl Fn(f32) -> bool) {
        let meadow = draft.material(Material::Meadow { colour: rgb(92, 116, 58) });
        let water = draft.material(Material::Plain { colour: rgb(60, 84, 96), gloss: 0.55 });
        let low = Vec3::new(-3_000.0, -3_000.0, -5.5);
        draft.add(
            Geometry::Patch {
                corner: low,
                u: Vec3::X * 6_000.0,
                v: Vec3::Y * (self.length + 6_000.0),
            },
            water,
            1,
        );
        let point = |across: f32, y: f32| {
            let hill = if inside(y) { 11.0 * step(60.0, 20.0, across.abs()) } else { f32::MIN };
            Vec3::new(bend(y) + across, y, self.height(across, y).max(hill))
        };
        let normal = |across: f32, y: f32| {
            let du = point(across + 3.0, y) - point(across - 3.0, y);
            let dv = point(across, y + 3.0) - point(across, y - 3.0);
            du.cross(dv).normalize_or(Vec3::Z)
        };
        let n_rows = ((self.length + 900.0) / ALONG) as i32;
        for row in -12..n_rows {
            let (from, to) = (row as f32 * ALONG, (row + 1) as f32 * ALONG);
            for pair in ACROSS.windows(2) {
                let corners = [(pair[0], from), (pair[1], from), (pair[1], to), (pair[0], to)];
                let points = corners.map(|(across, y)| point(across, y));
                let normals = corners.map(|(across, y)| normal(across, y));
                for half in [[0, 1, 2], [0, 2, 3]] {
                    let facet = Geometry::Facet {
                        corners: half.map(|k| points[k]),
                        normals: half.map(|k| normals[k]),
                    };
                    draft.add(facet, meadow, 5);
                }
            }
        }
    }

    fn track(&self, draft: &mut Draft) {
        let ballast = draft.material(Material::Ballast);
        let steel = draft.material(Material::Plain { colour: rgb(120, 112, 108), gloss: 0.35 });
        let mast = draft.material(Material::Plain { colour: rgb(120, 124, 122), gloss: 0.05 });
        let n = ((self.length + 600.0) / PIECE) as i32;
        for piece in -10..n {
            let y = (piece as f32 + 0.5) * PIECE;
            let angle = libm::atanf(slope(y));
            let along = Vec3::new(libm::sinf(angle), libm::cosf(angle), 0.0);
            let across = Vec3::new(along.y, -along.x, 0.0);
            let center = Vec3::new(bend(y), y, 0.0);
            let length = PIECE / libm::cosf(angle) + 0.15;
            let corner = center - along * (0.5 * length) - across * 2.4 - Vec3::Z * 0.18;
            draft.add(
                Geometry::Patch { corner, u: across * 4.8, v: along * length },
                ballast,
                3 + piece as u32 % 5,
            );
            for side in [-0.75, 0.75] {
                let size = Vec3::new(0.08, length, 0.16);
                draft.add(
                    Geometry::block(center + across * side - Vec3::Z * 0.08, size, -angle),
                    steel,
                    0,
                );
            }
            if piece % 6 == 0 {
                let foot = center + across * 3.1 - Vec3::Z * 0.3;
                draft.add(
                    Geometry::Pillar { base: foot, height: 7.2, bottom: 0.14, top: 0.1 },
                    mast,
                    0,
                );
                let arm = center + across * 1.5 + Vec3::Z * 6.2;
                draft.add(Geometry::block(arm, Vec3::new(3.4, 0.07, 0.07), -angle), mast, 0);
            }
            let wire = center + Vec3::Z * 5.5;
            draft.add(Geometry::block(wire, Vec3::new(0.035, length, 0.035), -angle), mast, 0);
        }
    }

    fn woods(
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
    fn farms(&self, draft: &mut Draft, beside: &impl Fn(f32) -> bool) {
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

fn tunnel(draft: &mut Draft, start: f32, seed: Seed) {
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

fn station(
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
