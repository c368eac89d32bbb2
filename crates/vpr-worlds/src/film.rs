//! From linear colours to bytes: lens, exposure, noise, and what age does to a print.

use std::sync::LazyLock;

use glam::Vec3;
use image::{Rgb, RgbImage};
use serde::{Deserialize, Serialize};

use crate::{
    material::Colour,
    noise::{lerp, step, value},
    refusal::{Refusal, between},
    seed::{Seed, cell, mix, normal, unit},
};

/// How a camera and its print differ from a clean one; shares are 0 to 1, 0 means "absent".
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Film {
    /// Standard deviation of the sensor's noise at gain one, in units of white.
    pub noise: f64,
    /// Standard deviation of the blur, pixels.
    pub blur_px: f64,
    /// Darkening of the corners.
    pub vignette: f64,
    /// 0 colour, 1 grey.
    pub grey: f64,
    /// Brown tone of an old print.
    pub sepia: f64,
    /// Strength of grain as coarse as two pixels.
    pub grain: f64,
    /// Scratches and spots.
    pub scratches: f64,
    /// Loss of contrast.
    pub faded: f64,
}

impl Default for Film {
    fn default() -> Self {
        Self {
            noise: 0.006,
            blur_px: 0.0,
            vignette: 0.12,
            grey: 0.0,
            sepia: 0.0,
            grain: 0.0,
            scratches: 0.0,
            faded: 0.0,
        }
    }
}

impl Film {
    pub(crate) fn check(&self) -> Result<(), Refusal> {
        for (name, value) in [
            ("noise", self.noise),
            ("vignette", self.vignette),
            ("grey", self.grey),
            ("sepia", self.sepia),
            ("grain", self.grain),
            ("scratches", self.scratches),
            ("faded", self.faded),
        ] {
            between(name, value, 0.0, 1.0)?;
        }
        between("blur_px", self.blur_px, 0.0, 20.0)
    }

    /// Develops an image of `width` pixels a row; `falling` is snow in the air.
    pub(crate) fn develop(
        &self,
        colours: &[Colour],
        width: usize,
        max_gain: f32,
        falling: f64,
        seed: Seed,
    ) -> RgbImage {
        let height = colours.len() / width;
        let blurred = blur(colours, width, self.blur_px as f32);
        let gain = gain(&blurred, max_gain);
        let noise = self.noise as f32;
        let key = seed.named("film").bits();
        let flakes = flakes(width, height, falling, seed);
        RgbImage::from_fn(width as u32, height as u32, |x, y| {
            let index = y as usize * width + x as usize;
            let across = x as f32 / width as f32 - 0.5;
            let down = y as f32 / height as f32 - 0.5;
            let corner = 1.0 - self.vignette as f32 * 2.0 * (across * across + down * down);
            let mut light = blurred[index] * gain * corner;
            light = light.lerp(Vec3::splat(0.8), flakes.get(index).copied().unwrap_or(0.0));
            let hash = cell(key, x as i32, y as i32);
            let draw = Vec3::new(normal(hash), normal(mix(hash ^ 1)), normal(mix(hash ^ 2)));
            let spread = noise * (gain.sqrt() + light.max_element().max(0.0).sqrt());
            let toned = tone(light + draw * spread);
            let aged = self.age(muted(toned), x, y, (across, down), key);
            Rgb([aged.x, aged.y, aged.z].map(|c| (c * 255.0 + 0.5).clamp(0.0, 255.0) as u8))
        })
    }

    fn age(&self, colour: Vec3, x: u32, y: u32, (across, down): (f32, f32), key: u32) -> Vec3 {
        let grey = colour.dot(Vec3::new(0.299, 0.587, 0.114));
        let mut print = colour.lerp(Vec3::splat(grey), self.grey as f32);
        print = print.lerp(Vec3::new(1.04, 0.9, 0.68) * grey, self.sepia as f32);
        let faded = self.faded as f32;
        print = print.lerp(Vec3::splat(0.55) + (print - Vec3::splat(0.5)) * 0.45, faded);
        if self.grain > 0.0 {
            let coarse = value(key ^ 3, glam::Vec2::new(x as f32, y as f32) * 0.6) - 0.5;
            let fine = unit(cell(key ^ 4, x as i32, y as i32)) - 0.5;
            print += Vec3::splat((coarse + 0.6 * fine) * 0.35 * self.grain as f32);
        }
        if self.scratches > 0.0 {
            print += Vec3::splat(scratch(key, across, down, self.scratches as f32));
        }
        print
    }
}

/// Automatic exposure: the mean of the logarithms comes to a middle grey.
fn gain(colours: &[Colour], max_gain: f32) -> f32 {
    let sum: f64 = colours
        .iter()
        .map(|c| f64::from(libm::logf(c.dot(Vec3::new(0.3, 0.59, 0.11)).max(1e-4))))
        .sum();
    let mean = libm::expf((sum / colours.len() as f64) as f32);
    (0.16 / mean).clamp(0.25, max_gain)
}

/// A film-like curve, then the eye's.
fn tone(light: Vec3) -> Vec3 {
    let curve = |x: f32| {
        let x = x.max(0.0);
        let print = x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14);
        eye(print.min(1.0))
    };
    Vec3::new(curve(light.x), curve(light.y), curve(light.z))
}

/// Colours as lenses and sensors give them: paler than paint, the more so the stronger they are.
fn muted(colour: Vec3) -> Vec3 {
    let grey = colour.dot(Vec3::new(0.299, 0.587, 0.114));
    let strength = (colour.max_element() - colour.min_element()).clamp(0.0, 1.0);
    colour.lerp(Vec3::splat(grey), 0.15 + 0.35 * strength)
}

/// Steps of the table in [`eye`].
const STEPS: usize = 512;

/// `x` to the power 1 / 2.2 for `x` in 0 to 1, off by less than 10⁻⁴: a table over the square root,
/// of which it is nearly a straight line.
fn eye(x: f32) -> f32 {
    static TABLE: LazyLock<Vec<f32>> = LazyLock::new(|| {
        (0..=STEPS + 1).map(|k| libm::powf(k as f32 / STEPS as f32, 2.0 / 2.2)).collect()
    });
    let at = x.sqrt() * STEPS as f32;
    let step = at as usize;
    lerp(TABLE[step], TABLE[step + 1], at - step as f32)
}

fn blur(colours: &[Colour], width: usize, sigma: f32) -> Vec<Colour> {
    if sigma < 0.05 {
        return colours.to_vec();
    }
    let reach = (3.0 * sigma).ceil() as i32;
    let weights: Vec<f32> =
        (-reach..=reach).map(|k| libm::expf(-0.5 * (k as f32 / sigma).powi(2))).collect();
    let total: f32 = weights.iter().sum();
    let height = colours.len() / width;
    let pass = |source: &[Colour], along_row: bool| -> Vec<Colour> {
        (0..source.len())
            .map(|index| {
                let (row, column) = ((index / width) as i32, (index % width) as i32);
                let mut sum = Vec3::ZERO;
                for (weight, k) in weights.iter().zip(-reach..) {
                    let (r, c) = if along_row { (row, column + k) } else { (row + k, column) };
                    let r = r.clamp(0, height as i32 - 1) as usize;
                    let c = c.clamp(0, width as i32 - 1) as usize;
                    sum += source[r * width + c] * *weight;
                }
                sum / total
            })
            .collect()
    };
    pass(&pass(colours, true), false)
}

/// Cover of snowflakes per pixel; empty if none fall.
fn flakes(width: usize, height: usize, falling: f64, seed: Seed) -> Vec<f32> {
    if falling <= 0.0 {
        return Vec::new();
    }
    let mut cover = vec![0.0_f32; width * height];
    let seed = seed.named("flakes");
    let n = (falling * 0.012 * (width * height) as f64) as i64;
    for flake in 0..n {
        let own = seed.at(flake);
        let (x, y) = (own.at(0).range(0.0, width as f32), own.at(1).range(0.0, height as f32));
        let size = lerp(0.5, 2.4, own.at(2).unit().powi(4)) * width as f32 / 320.0;
        for row in (y - size).max(0.0) as usize..((y + size + 1.0) as usize).min(height) {
            for column in (x - size).max(0.0) as usize..((x + size + 1.0) as usize).min(width) {
                let (dx, dy) = (column as f32 + 0.5 - x, row as f32 + 0.5 - y);
                let near = step(size, 0.3 * size, libm::sqrtf(dx * dx + 0.6 * dy * dy));
                let pixel = &mut cover[row * width + column];
                *pixel = pixel.max(0.75 * near);
            }
        }
    }
    cover
}

/// Brightness that scratches and spots of an old print add at a place.
fn scratch(key: u32, across: f32, down: f32, strength: f32) -> f32 {
    let seed = Seed::new(u64::from(key)).named("scratch");
    let mut sum = 0.0;
    for line in 0..(10.0 * strength) as i64 {
        let own = seed.at(line);
        let middle = own.at(0).range(-0.5, 0.5) + own.at(1).range(-0.15, 0.15) * down;
        let span = own.at(2).range(-0.5, 0.3)..own.at(3).range(-0.1, 0.5);
        if (across - middle).abs() < 0.0022 && span.contains(&down) {
            sum += own.at(4).range(-0.3, 0.5);
        }
    }
    for spot in 0..(14.0 * strength) as i64 {
        let own = seed.at(1_000 + spot);
        let (dx, dy) = (across - own.at(0).range(-0.5, 0.5), down - own.at(1).range(-0.5, 0.5));
        if dx * dx + dy * dy < own.at(2).range(0.003, 0.014).powi(2) {
            sum += own.at(3).range(-0.35, 0.35);
        }
    }
    sum
}
