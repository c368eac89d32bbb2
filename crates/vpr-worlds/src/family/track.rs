//! The line itself: where a railway track runs, the ground it crosses, rails and masts.

use glam::{Vec2, Vec3};

use crate::{
    geometry::Geometry,
    material::{Material, rgb},
    noise::{cloudy, step},
    recipe::Rail,
    scene::Draft,
    seed::Seed,
};

/// Distances from the track at which the ground is sampled.
const ACROSS: [f32; 26] = [
    -600.0, -400.0, -260.0, -170.0, -115.0, -80.0, -58.0, -42.0, -31.0, -23.0, -17.0, -11.0, -5.0,
    5.0, 11.0, 17.0, 23.0, 31.0, 42.0, 58.0, 80.0, 115.0, 170.0, 260.0, 400.0, 600.0,
];
/// Distance between samples along the track.
const ALONG: f32 = 9.0;
/// Length of a straight piece of track.
const PIECE: f32 = 9.1;

/// x of the track at y.
pub(super) fn bend(y: f32) -> f32 {
    70.0 * libm::sinf(y / 410.0) + 22.0 * libm::sinf(y / 150.0 + 1.0)
}

/// Change of x per metre of y.
pub(super) fn slope(y: f32) -> f32 {
    70.0 / 410.0 * libm::cosf(y / 410.0) + 22.0 / 150.0 * libm::cosf(y / 150.0 + 1.0)
}

/// What lasts along a track, whoever drives it.
pub(super) struct Line<'a> {
    pub(super) rail: &'a Rail,
    /// Metres along y.
    pub(super) length: f32,
    pub(super) seed: Seed,
}

impl Line<'_> {
    /// Things per kilometre as their places along y.
    pub(super) fn along(&self, what: &str, per_km: f64, size: f32) -> Vec<f32> {
        let seed = self.seed.named(what);
        let n = (self.length / 1_000.0 * per_km as f32).round() as i64;
        let share = self.length / n.max(1) as f32;
        (0..n)
            .map(|k| share * (k as f32 + seed.at(k).range(0.1, 0.8)) - 0.5 * size + 30.0)
            .collect()
    }

    /// Height of the ground so far from the track.
    pub(super) fn height(&self, across: f32, y: f32) -> f32 {
        let seed = self.seed.named("hills").bits();
        let at = Vec2::new(bend(y) + across, y);
        let broad = cloudy(seed, at / 260.0, 4, 0.0) - 0.42;
        let away = step(6.0, 140.0, across.abs());
        let bank =
            7.0 * (cloudy(seed ^ 1, Vec2::new(y / 70.0, 0.5 + across.signum()), 2, 0.0) - 0.5);
        let near = step(5.0, 18.0, across.abs()) * bank;
        near + away * broad * 2.2 * self.rail.hills_m as f32 - 0.5
    }

    /// Hills, raised over tunnels, and the water in their valleys.
    pub(super) fn ground(&self, draft: &mut Draft, inside: &impl Fn(f32) -> bool) {
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

    /// Ballast, rails, masts and the wire.
    pub(super) fn track(&self, draft: &mut Draft) {
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
}
