//! Streets with lanes, crossings and repairs, and the ballast of a railway.

use glam::{Vec2, Vec3};

use super::{Paint, Season, Touch, rgb};
use crate::{
    noise::{cloudy, lerp, step},
    seed::{cell, mix, unit},
};

/// A grid of streets: avenues along y at multiples of `period.x`, streets along x at multiples of
/// `period.y`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Roads {
    /// Distance between avenues, between streets.
    pub(crate) period: Vec2,
    /// Half the width between the kerbs.
    pub(crate) half_width: f32,
}

/// Asphalt with markings.
pub(crate) fn road_ground(roads: &Roads, touch: &Touch, season: &Season) -> Paint {
    let at = Vec2::new(touch.point.x, touch.point.y);
    let nearest = (at / roads.period).round();
    let off = at - nearest * roads.period;
    let local = touch.spot.uv;
    let grain = cloudy(touch.seed, local * 7.0, 2, 7.0 * touch.footprint);
    let worn = cloudy(touch.seed ^ 4, local * Vec2::new(0.5, 0.13), 4, 0.5 * touch.footprint);
    let mut colour = rgb(92, 92, 94) * lerp(0.7, 1.2, worn) * lerp(0.85, 1.15, grain);
    colour *= repairs(touch.seed, local);
    let on_avenue = off.x.abs() < roads.half_width;
    let on_street = off.y.abs() < roads.half_width;
    let paint = rgb(205, 203, 196) * lerp(0.6, 1.0, worn);
    let mark = match (on_avenue, on_street) {
        (true, true) | (false, false) => 0.0,
        (true, false) => marking(off.x, off.y, roads),
        (false, true) => marking(off.y, off.x, roads),
    };
    colour = colour.lerp(paint, mark * step(0.35, 0.05, touch.footprint).max(0.4));
    let wet = 0.04 + 0.2 * season.snow * (1.0 - season.snow) + 0.1 * season.night;
    Paint::glossy(colour, wet)
}

/// Share of paint `across` a lane's middle and `along` it, from the crossing's middle.
fn marking(across: f32, along: f32, roads: &Roads) -> f32 {
    let from_kerb = along.abs() - roads.half_width;
    let width = roads.half_width;
    if (0.8..3.6).contains(&from_kerb) {
        let stripe = (across / 1.0 + 0.25).rem_euclid(1.0) < 0.5;
        return f32::from(u8::from(stripe && across.abs() < width - 0.3));
    }
    if (4.4..4.9).contains(&from_kerb) && across * along < 0.0 {
        return f32::from(u8::from(across.abs() < width - 0.3));
    }
    let dash = along.rem_euclid(6.0) < 3.0 && from_kerb > 6.0;
    let parking = (across.abs() - (width - 2.1)).abs() < 0.06 && from_kerb > 6.0;
    let bay = across.abs() > width - 2.1 && (along.rem_euclid(5.5) - 0.05).abs() < 0.06;
    f32::from(u8::from((across.abs() < 0.08 && dash) || parking || (bay && from_kerb > 6.0)))
}

fn repairs(seed: u32, at: Vec2) -> f32 {
    let scaled = at / Vec2::new(2.6, 4.2);
    let corner = scaled.floor();
    let hash = cell(seed ^ 0xa5, corner.x as i32, corner.y as i32);
    let within = scaled - corner;
    let size = Vec2::new(unit(mix(hash ^ 1)), unit(mix(hash ^ 2))) * 0.6 + Vec2::splat(0.2);
    if unit(hash) < 0.16 && within.cmplt(size).all() {
        return 0.6 + 0.5 * unit(mix(hash ^ 3));
    }
    // Manholes.
    let middle = (within - Vec2::splat(0.5)) * Vec2::new(2.6, 4.2);
    if unit(mix(hash ^ 4)) < 0.07 && middle.length() < 0.36 { 0.45 } else { 1.0 }
}

/// Gravel between and beside the rails, sleepers every 0.65 m; the track runs along y at `u = 0`.
pub(crate) fn rails_ground(touch: &Touch, _season: &Season) -> Paint {
    let Touch { spot, footprint, seed, .. } = *touch;
    let across = spot.uv.x - 0.5 * spot.extent.x;
    let along = spot.uv.y;
    let gravel = cloudy(seed, spot.uv * 9.0, 3, 9.0 * footprint);
    let broad = cloudy(seed ^ 8, spot.uv * 0.4, 3, 0.4 * footprint);
    let mut colour = rgb(128, 118, 108) * lerp(0.55, 1.35, gravel) * lerp(0.75, 1.2, broad);
    let sleeper = along.rem_euclid(0.65) < 0.26 && across.abs() < 1.3;
    if sleeper {
        let own = unit(cell(seed, (along / 0.65).floor() as i32, 1));
        let seen = step(0.5, 0.1, footprint);
        colour = colour.lerp(rgb(98, 86, 76) * (0.7 + 0.5 * own), seen);
    }
    Paint { albedo: colour, ..Paint::matt(Vec3::ZERO) }
}
