//! Bricks, plaster, stone, concrete and boards.

use glam::{Vec2, Vec3};

use super::{Colour, Paint, Touch};
use crate::{
    noise::{cloudy, lerp, step},
    seed::{cell, unit},
};

/// What a wall is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wall {
    /// Red or yellow bricks with light joints.
    Brick,
    /// Painted plaster with stains.
    Plaster,
    /// Large dressed stones.
    Stone,
    /// Cast panels.
    Concrete,
    /// Horizontal boards.
    Clapboard,
}

/// A wall of this kind and colour, stained towards the ground and below its top.
pub(crate) fn wall(kind: Wall, colour: Colour, touch: &Touch) -> Paint {
    let at = touch.spot.uv;
    let stain = cloudy(touch.seed, at * Vec2::new(0.55, 0.3), 4, 0.5 * touch.footprint);
    let streak = cloudy(touch.seed ^ 0x4d, at * Vec2::new(2.2, 0.12), 2, 2.2 * touch.footprint);
    let damp = 1.0 - 0.3 * step(1.2, 0.0, at.y) * streak;
    let aged = colour * lerp(0.78, 1.14, 0.6 * stain + 0.4 * streak) * damp;
    let tone = match kind {
        Wall::Brick => bricks(at, Vec2::new(0.24, 0.08), 0.012, 0.45, touch),
        Wall::Stone => bricks(at, Vec2::new(0.9, 0.42), 0.02, 0.3, touch),
        Wall::Concrete => bricks(at, Vec2::new(2.4, 1.4), 0.02, 0.12, touch),
        Wall::Plaster => {
            1.0 + 0.06 * (cloudy(touch.seed ^ 5, at * 9.0, 2, 9.0 * touch.footprint) - 0.5)
        }
        Wall::Clapboard => {
            let up = at.y / 0.16 - (at.y / 0.16).floor();
            1.0 - 0.4 * step(0.08, 0.02, touch.footprint) * step(0.8, 0.98, up)
        }
    };
    let joint = if kind == Wall::Brick { Vec3::splat(0.35) } else { aged * 0.6 };
    Paint::matt(if tone < 0.0 { aged.lerp(joint, -tone) } else { aged * tone })
}

/// A tone around 1 for a brick of its own, minus the weight of the joint's colour for a joint.
fn bricks(at: Vec2, size: Vec2, joint: f32, spread: f32, touch: &Touch) -> f32 {
    let row = (at.y / size.y).floor();
    let shift = if (row as i32).rem_euclid(2) == 0 { 0.0 } else { 0.5 };
    let column = (at.x / size.x + shift).floor();
    let own = unit(cell(touch.seed, column as i32, row as i32)) - 0.5;
    let within = Vec2::new((at.x / size.x + shift - column) * size.x, at.y - row * size.y);
    let edge = within.min(size - within).min_element();
    let seen = step(size.y, 0.25 * size.y, touch.footprint);
    if edge < joint && seen > 0.05 {
        -0.7 * seen
    } else {
        1.0 + spread * own * step(size.x, 0.3 * size.x, touch.footprint)
    }
}
