//! Posters and pictures, one per seed.

use glam::{Vec2, Vec3};

use super::{Colour, hue, lettering};
use crate::{
    noise::{cloudy, step, value},
    seed::Seed,
};

/// The colour at `at` (0 to 1 each way) of the picture with this seed.
pub(crate) fn poster(seed: u32, at: Vec2, footprint: f32) -> Colour {
    let random = Seed::new(u64::from(seed)).named("poster");
    let edge = at.min(Vec2::ONE - at).min_element();
    let frame = hue(random.at(1).unit(), 0.4 * random.at(2).unit(), random.at(3).range(0.1, 0.9));
    if edge < 0.035 {
        return frame;
    }
    let ground =
        hue(random.at(4).unit(), random.at(5).range(0.1, 0.7), random.at(6).range(0.35, 0.95));
    let ink = hue(random.at(7).unit(), random.at(8).range(0.3, 0.9), random.at(9).range(0.1, 0.9));
    match random.at(10).index(4) {
        0 => landscape(random, at, ground, ink),
        1 => shapes(random, at, ground, ink),
        2 => notice(seed, at, ground, ink),
        _ => {
            let blots = cloudy(seed, at * random.at(11).range(2.0, 7.0), 3, footprint);
            let third = hue(random.at(12).unit(), 0.8, 0.8);
            ground.lerp(ink, step(0.42, 0.5, blots)).lerp(third, step(0.6, 0.64, blots))
        }
    }
}

fn landscape(random: Seed, at: Vec2, ground: Colour, ink: Colour) -> Colour {
    let mut colour = Vec3::new(0.45, 0.6, 0.8).lerp(ground, at.y);
    if (at - Vec2::new(random.at(20).unit(), 0.75)).length() < 0.09 {
        colour = Vec3::new(0.9, 0.8, 0.4);
    }
    for ridge in 0..3_u8 {
        let seed = random.at(21 + i64::from(ridge)).bits();
        let height =
            0.65 - 0.2 * f32::from(ridge) + 0.25 * (value(seed, Vec2::new(at.x * 4.0, 0.5)) - 0.5);
        if at.y < height {
            colour = ink * (0.4 + 0.25 * f32::from(ridge));
        }
    }
    colour
}

fn shapes(random: Seed, at: Vec2, ground: Colour, ink: Colour) -> Colour {
    let mut colour = ground;
    for shape in 0..6 {
        let own = random.at(40 + shape);
        let center = Vec2::new(own.at(0).range(0.15, 0.85), own.at(1).range(0.15, 0.85));
        let size = own.at(2).range(0.06, 0.28);
        let away = (at - center).abs();
        let inside = match own.at(3).index(3) {
            0 => away.length() < size,
            1 => away.max_element() < size,
            _ => away.element_sum() < size,
        };
        if inside {
            colour = if shape % 2 == 0 { ink } else { hue(own.at(4).unit(), 0.7, 0.8) };
        }
    }
    colour
}

fn notice(seed: u32, at: Vec2, ground: Colour, ink: Colour) -> Colour {
    if at.y > 0.72 {
        let line = lettering::line(seed, Vec2::new(at.x, (at.y - 0.72) / 0.24), 3.5);
        return ink.lerp(ground, line);
    }
    let row = (at.y * 22.0).floor();
    let end = 0.5 + 0.4 * Seed::new(u64::from(seed)).at(row as i64).unit();
    let text = at.y * 22.0 - row < 0.5 && at.x > 0.1 && at.x < end;
    if text { ink } else { ground }
}
