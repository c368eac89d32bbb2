//! Sun, sky, lamps of the camera, and haze, from the numbers of a condition.

use glam::{Vec2, Vec3};

use crate::{
    condition::Condition,
    material::{Colour, Season},
    noise::{cloudy, lerp, step},
    seed::{Seed, cell, unit},
};

/// What lights an image.
#[derive(Clone, Debug)]
pub(crate) struct Light {
    /// Towards the sun.
    pub(crate) sun: Vec3,
    /// Irradiance of the sun over π, before shadows.
    pub(crate) sunlight: Colour,
    /// Irradiance of the whole sky over π.
    pub(crate) ambient: Colour,
    /// Strength of the lamp beside the camera: irradiance over π at one metre.
    pub(crate) headlight: f32,
    /// Share of lamps' light that is on.
    pub(crate) lamps: f32,
    /// Extinction per metre.
    pub(crate) haze: f32,
    /// Colour of the haze and of the horizon.
    pub(crate) horizon: Colour,
    /// Highest gain of the camera's automatic exposure.
    pub(crate) max_gain: f32,
    /// How materials look.
    pub(crate) season: Season,
    zenith: Colour,
    cloud: f32,
    seed: u32,
}

impl Light {
    pub(crate) fn new(condition: &Condition, seed: Seed) -> Self {
        let [darkness, cloud, snow] =
            [condition.darkness, condition.cloud, condition.snow].map(narrow);
        let azimuth = narrow(condition.sun_azimuth_deg).to_radians();
        let elevation = narrow(condition.sun_elevation_deg).to_radians();
        let level = libm::cosf(elevation);
        let sun = Vec3::new(
            libm::sinf(azimuth) * level,
            libm::cosf(azimuth) * level,
            libm::sinf(elevation),
        );
        // Three powers of ten between noon and a moonlit night.
        let day = libm::powf(10.0, -3.0 * darkness);
        let low = 1.0 - step(0.05, 0.5, sun.z);
        let warm = Vec3::new(1.0, 0.95, 0.88).lerp(Vec3::new(1.0, 0.62, 0.35), low);
        let clear = 1.0 - cloud;
        let blue = Vec3::new(0.26, 0.45, 0.85).lerp(Vec3::splat(0.72), 0.9 * cloud);
        let pale =
            Vec3::new(0.78, 0.86, 0.95).lerp(Vec3::splat(0.8), cloud).lerp(warm, 0.4 * low * clear);
        let town = Vec3::new(0.006, 0.005, 0.004) * step(0.3, 0.8, darkness);
        let horizon = pale * 0.95 * day + town * 2.0;
        Self {
            sun,
            sunlight: warm * (2.4 * clear * day),
            ambient: (blue.lerp(pale, 0.5) * lerp(0.55, 1.0, cloud) + Vec3::splat(0.12 * snow))
                * day
                + town,
            headlight: narrow(condition.headlights) * step(0.3, 0.7, darkness),
            lamps: step(0.3, 0.7, darkness),
            haze: 3.9 / narrow(condition.visibility_m),
            horizon,
            max_gain: narrow(condition.max_gain),
            season: Season {
                autumn: narrow(condition.autumn),
                bare: narrow(condition.bare),
                snow,
                night: darkness,
                evening: seed.named("evening").bits(),
            },
            zenith: blue * 0.9 * day + town,
            cloud,
            seed: seed.named("clouds").bits(),
        }
    }

    /// A closed room: lamps only, and a little light from everywhere.
    pub(crate) fn indoors(condition: &Condition, seed: Seed) -> Self {
        let mut light = Self::new(condition, seed);
        let day = 1.0 - step(0.3, 0.9, light.season.night);
        light.sunlight = Vec3::ZERO;
        light.ambient = Vec3::new(0.20, 0.205, 0.22) * lerp(0.25, 1.0, day);
        light.haze = 0.0;
        light.lamps = 1.0;
        light
    }

    /// The sky in a direction.
    pub(crate) fn sky(&self, direction: Vec3) -> Colour {
        let up = direction.z.max(0.0);
        let base = self.horizon.lerp(self.zenith, libm::sqrtf(up));
        let day = base.element_sum() / 3.0;
        let mut colour = base;
        if direction.z > 0.01 {
            let plane = Vec2::new(direction.x, direction.y) / (direction.z + 0.12);
            let cover = cloudy(self.seed, plane * 1.3, 5, 0.02);
            let threshold = lerp(0.72, 0.25, self.cloud);
            let share = step(threshold, threshold + 0.2, cover) * step(0.0, 0.15, direction.z);
            let white = Vec3::splat(lerp(1.25, 0.62, self.cloud * cover))
                * day.max(self.zenith.z * 0.8)
                * 1.1;
            colour = colour.lerp(white, share * 0.85);
            let at = direction * 180.0;
            let star = cell(self.seed, (at.x + at.z) as i32, (at.y - at.z) as i32);
            if self.season.night > 0.8 && unit(star) < 0.002 && share < 0.2 {
                colour += Vec3::splat(0.03);
            }
        }
        let glare = direction.dot(self.sun).max(0.0);
        let disc = if glare > 0.9995 { 6.0 } else { 0.0 };
        colour + self.sunlight * (0.6 * halo(glare) + disc) * (1.0 - self.cloud)
    }

    /// Share of light left after `distance` metres of haze.
    pub(crate) fn clear(&self, distance: f32) -> f32 {
        libm::expf(-self.haze * distance)
    }
}

/// The sixtieth power: the bright sky around the sun.
fn halo(x: f32) -> f32 {
    let fourth = (x * x) * (x * x);
    let twelfth = fourth * fourth * fourth;
    let thirtieth = twelfth * twelfth * fourth * (x * x);
    thirtieth * thirtieth
}

#[expect(clippy::cast_possible_truncation, reason = "recipes are f64, rendering is f32")]
fn narrow(value: f64) -> f32 {
    value as f32
}
