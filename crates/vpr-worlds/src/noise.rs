//! Value noise on hashed lattices, for textures, clouds, hills and leaves.

use glam::{Vec2, Vec3};

use crate::seed::{cell, mix, unit};

/// Smooth noise in the plane, `0 .. 1`, with features of size one.
pub(crate) fn value(seed: u32, at: Vec2) -> f32 {
    let floor = at.floor();
    let (x, y) = (floor.x as i32, floor.y as i32);
    let t = smooth(at - floor);
    let corner = |dx: i32, dy: i32| unit(cell(seed, x.wrapping_add(dx), y.wrapping_add(dy)));
    let low = lerp(corner(0, 0), corner(1, 0), t.x);
    let high = lerp(corner(0, 1), corner(1, 1), t.x);
    lerp(low, high, t.y)
}

/// Smooth noise in space, `0 .. 1`, with features of size one.
pub(crate) fn value3(seed: u32, at: Vec3) -> f32 {
    let floor = at.z.floor();
    let layer = floor as i32;
    let t = at.z - floor;
    let t = t * t * (3.0 - 2.0 * t);
    let low = value(mix(seed ^ layer as u32), Vec2::new(at.x, at.y));
    let high = value(mix(seed ^ layer.wrapping_add(1) as u32), Vec2::new(at.x, at.y));
    lerp(low, high, t)
}

/// Noise of several sizes, `0 .. 1`; octaves finer than `footprint` are left out, so that
/// textures do not flicker with distance.
pub(crate) fn cloudy(seed: u32, at: Vec2, octaves: u32, footprint: f32) -> f32 {
    let (mut sum, mut weight, mut frequency, mut total) = (0.0, 0.5, 1.0_f32, 0.0);
    for octave in 0..octaves {
        total += weight;
        sum += weight
            * if frequency * footprint < 0.7 {
                value(seed.wrapping_add(octave), at * frequency)
            } else {
                0.5
            };
        weight *= 0.5;
        frequency *= 2.03;
    }
    sum / total
}

pub(crate) fn lerp(low: f32, high: f32, t: f32) -> f32 {
    low + (high - low) * t
}

/// 0 below `low`, 1 above `high`, smooth between.
pub(crate) fn step(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn smooth(t: Vec2) -> Vec2 {
    t * t * (Vec2::splat(3.0) - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_continuous_and_within_its_range() {
        let mut previous = value(3, Vec2::new(-5.0, 0.3));
        for k in 1..4_000 {
            let next = value(3, Vec2::new(-5.0 + k as f32 * 0.005, 0.3));
            assert!((0.0..=1.0).contains(&next) && (next - previous).abs() < 0.02, "{k}");
            previous = next;
        }
    }

    #[test]
    fn far_away_only_the_mean_is_left() {
        assert!((cloudy(1, Vec2::new(0.4, 9.1), 5, 100.0) - 0.5).abs() < 1e-6);
    }
}
