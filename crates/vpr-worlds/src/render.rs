//! From a scene, a light and a camera to colours, depth and moving things, pixel by pixel.

use glam::{Vec2, Vec3};

use crate::{
    camera::Camera,
    geometry::{Ray, Spot},
    light::Light,
    material::{Colour, Paint, Touch},
    noise::{cloudy, lerp, step},
    scene::{Lamp, Scene, Shape},
};

/// What a camera looks at.
pub(crate) struct View<'a> {
    pub(crate) scene: &'a Scene,
    /// Things that only this image has, right in front of the camera.
    pub(crate) foreground: &'a [Shape],
    pub(crate) light: &'a Light,
    /// A lamp that only this image has.
    pub(crate) lamp: Option<Lamp>,
    pub(crate) camera: &'a Camera,
    pub(crate) pose: &'a vpr_core::Pose,
}

/// A rendered image before it is developed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Exposure {
    /// Linear colour, row by row.
    pub(crate) colours: Vec<Colour>,
    /// Depth along the optical axis in metres; infinite where there is sky.
    pub(crate) depth: Vec<f32>,
    /// Whether a pixel shows something that moves.
    pub(crate) moving: Vec<bool>,
}

/// What one ray sees.
#[derive(Clone, Copy)]
struct Sample {
    colour: Colour,
    /// Distance along the ray.
    distance: f32,
    shape: u32,
    normal: Vec3,
    moving: bool,
}

/// Nothing further away is seen.
const FAR: f32 = 2_000.0;
/// Offsets of the extra rays of a pixel that holds an edge.
const EXTRA: [(f64, f64); 2] = [(-0.3, 0.16), (0.3, -0.16)];

/// Renders one image; every pixel depends on its own ray only.
pub(crate) fn render(view: &View<'_>) -> Exposure {
    let camera = view.camera;
    let (width, height) = (camera.width as usize, camera.height as usize);
    let mut first = Vec::with_capacity(width * height);
    let mut depth = Vec::with_capacity(width * height);
    for row in 0..height {
        for column in 0..width {
            let (ray, forward) = ray_through(view, column as f64 + 0.5, row as f64 + 0.5);
            let sample = trace(view, &ray);
            depth.push(sample.distance * forward);
            first.push(sample);
        }
    }
    let colours = (0..width * height)
        .map(|index| {
            let (row, column) = (index / width, index % width);
            if !is_edge(&first, row, column, width, height) {
                return first[index].colour.min(Vec3::splat(8.0));
            }
            let mut sum = first[index].colour.min(Vec3::splat(8.0));
            for (dx, dy) in EXTRA {
                let (ray, _) = ray_through(view, column as f64 + 0.5 + dx, row as f64 + 0.5 + dy);
                sum += trace(view, &ray).colour.min(Vec3::splat(8.0));
            }
            sum / (1 + EXTRA.len()) as f32
        })
        .collect();
    Exposure { colours, depth, moving: first.iter().map(|sample| sample.moving).collect() }
}

/// The ray through an image point, and its share along the optical axis.
fn ray_through(view: &View<'_>, x: f64, y: f64) -> (Ray, f32) {
    let direction = view.camera.direction(x, y);
    let world = view.pose.rotation * direction;
    let origin = &view.pose.translation.vector;
    let narrow = |v: f64| v as f32;
    let ray = Ray {
        origin: Vec3::new(narrow(origin.x), narrow(origin.y), narrow(origin.z)),
        direction: Vec3::new(narrow(world.x), narrow(world.y), narrow(world.z)).normalize(),
    };
    (ray, narrow(direction.z))
}

/// Whether a pixel differs so much from its neighbours that one ray is not enough.
fn is_edge(samples: &[Sample], row: usize, column: usize, width: usize, height: usize) -> bool {
    let here = &samples[row * width + column];
    let differs = |other: &Sample| {
        let contrast = (here.colour - other.colour).abs().max_element();
        let bright = here.colour.max_element().max(other.colour.max_element()).max(0.02);
        (here.shape != other.shape && here.normal.dot(other.normal) < 0.99)
            || (here.distance - other.distance).abs() > 0.1 * here.distance.min(other.distance)
            || contrast > 0.25 * bright
    };
    (column > 0 && differs(&samples[row * width + column - 1]))
        || (column + 1 < width && differs(&samples[row * width + column + 1]))
        || (row > 0 && differs(&samples[(row - 1) * width + column]))
        || (row + 1 < height && differs(&samples[(row + 1) * width + column]))
}

fn trace(view: &View<'_>, ray: &Ray) -> Sample {
    let mut limit = FAR;
    let mut near: Option<&Shape> = None;
    for shape in view.foreground {
        if let Some(t) = shape.geometry.hit(ray, limit) {
            (limit, near) = (t, Some(shape));
        }
    }
    let (shape, number, t) = if let Some(hit) = view.scene.nearest(ray, limit) {
        (&view.scene.shapes[hit.shape as usize], hit.shape, hit.t)
    } else if let Some(shape) = near {
        (shape, u32::MAX - 1, limit)
    } else {
        return Sample {
            colour: view.light.sky(ray.direction),
            distance: f32::INFINITY,
            shape: u32::MAX,
            normal: -ray.direction,
            moving: false,
        };
    };
    let point = ray.at(t);
    let spot = shape.geometry.spot(point, ray.direction);
    let toward = -ray.direction.dot(spot.normal).min(-0.02);
    let touch = Touch {
        spot,
        point,
        view: Vec3::new(ray.direction.dot(spot.u), ray.direction.dot(spot.v), -toward),
        footprint: t / view.camera.focal as f32 / libm::sqrtf(toward),
        seed: shape.seed,
    };
    let material = &view.scene.materials[shape.material as usize];
    let covered = material.paint(&touch, &view.light.season);
    let sunk = covered.sunk;
    let colour = shade(view, ray, &touch, covered);
    let clear = view.light.clear(t);
    Sample {
        colour: view.light.horizon.lerp(colour, clear),
        distance: t + sunk,
        shape: number,
        normal: spot.normal,
        moving: shape.moving,
    }
}

fn shade(view: &View<'_>, ray: &Ray, touch: &Touch, mut paint: Paint) -> Colour {
    let Spot { normal: face, u, v, .. } = touch.spot;
    let normal = (face + u * paint.tilt.x + v * paint.tilt.y).normalize_or(face);
    let light = view.light;
    if light.season.snow > 0.0 {
        cover_with_snow(&mut paint, touch, normal, light.season.snow);
    }
    let start = touch.point + face * 0.004;
    let mut arriving = ambient(light, normal, touch.point.z) * paint.open;
    let facing = normal.dot(light.sun);
    if facing > 0.0 && light.sunlight.x > 1e-4 && face.dot(light.sun) > 0.0 {
        let shadow = Ray { origin: start, direction: light.sun };
        if view.scene.is_free(&shadow, 400.0) {
            arriving += light.sunlight * facing * paint.open.max(0.5);
        }
    }
    arriving += lamplight(view, start, normal);
    if light.headlight > 0.0 {
        let d2 = (ray.origin - touch.point).length_squared().max(1.0);
        arriving += Vec3::new(1.0, 0.95, 0.85)
            * (light.headlight * normal.dot(-ray.direction).max(0.0) / d2);
    }
    let mut colour = paint.albedo * arriving + paint.glow;
    if paint.gloss > 0.0 {
        let away = ray.direction - 2.0 * ray.direction.dot(face) * face;
        let grazing = 1.0 - (-ray.direction.dot(face)).clamp(0.0, 1.0);
        let share = paint.gloss * (0.35 + 0.65 * grazing * grazing * grazing);
        // Houses across the street stand in the mirror image below a third of the way up.
        let houses = light.ambient * 0.25;
        let mirrored = houses.lerp(light.sky(away), step(0.18, 0.36, away.z));
        colour = colour * (1.0 - share) + mirrored * share;
    }
    colour
}

/// Skylight from above, and what the ground gives back from below.
fn ambient(light: &Light, normal: Vec3, height: f32) -> Colour {
    let up = 0.5 + 0.5 * normal.z;
    let open = 0.72 + 0.28 * (height / 6.0).clamp(0.0, 1.0);
    let below = (light.sunlight * 0.12 + light.ambient * 0.3) * (1.0 - up);
    light.ambient * (up * open) + below
}

fn lamplight(view: &View<'_>, start: Vec3, normal: Vec3) -> Colour {
    let mut sum = Vec3::ZERO;
    let near =
        view.scene.lamps_near(start).iter().map(|&number| &view.scene.lamps[number as usize]);
    for lamp in near.chain(&view.lamp) {
        let on = if lamp.by_day { 1.0 } else { view.light.lamps };
        let offset = lamp.position - start;
        let d2 = offset.length_squared();
        let facing = offset.dot(normal);
        if on <= 0.0 || facing <= 0.0 || d2 >= lamp.reach * lamp.reach {
            continue;
        }
        let distance = libm::sqrtf(d2);
        let fade = 1.0 - step(0.6 * lamp.reach, lamp.reach, distance);
        let arriving = lamp.colour * (on * fade * facing / (distance * d2.max(0.05)));
        let shadow = Ray { origin: start, direction: offset / distance };
        if arriving.max_element() > 1e-4 && view.scene.is_free(&shadow, distance - 0.3) {
            sum += arriving;
        }
    }
    sum
}

fn cover_with_snow(paint: &mut Paint, touch: &Touch, normal: Vec3, snow: f32) {
    let at = Vec2::new(touch.point.x, touch.point.y);
    let patchy = cloudy(touch.seed ^ 0x51, at * 0.8, 4, 0.8 * touch.footprint);
    // The noise lies between about 0.2 and 0.8; from afar patches run together to their share.
    let bare = lerp(0.82, 0.18, snow);
    let near = step(bare - 0.07, bare + 0.07, patchy);
    let lies = step(0.25, 0.6, normal.z) * lerp(near, snow, step(0.3, 1.5, touch.footprint));
    paint.albedo = paint.albedo.lerp(Vec3::new(0.86, 0.88, 0.92), lies);
    paint.gloss *= 1.0 - lies;
}
