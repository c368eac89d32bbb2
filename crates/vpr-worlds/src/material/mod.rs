//! What surfaces look like: colours, textures and relief as functions of a place on them.

mod facade;
mod ground;
mod lettering;
mod picture;
mod wall;

use glam::{Vec2, Vec3};

pub(crate) use facade::{Facade, Front, Opening};
pub(crate) use ground::{Roads, rails_ground, road_ground};
pub(crate) use picture::poster;
pub(crate) use wall::{Wall, wall};

use crate::{
    geometry::Spot,
    noise::{cloudy, lerp, step, value},
    seed::{cell, mix, unit},
};

/// A colour, linear, each channel 0 to 1 for what only reflects.
pub(crate) type Colour = Vec3;

/// A material; all colours linear.
#[derive(Clone, Debug)]
pub(crate) enum Material {
    /// One colour with a little dirt.
    Plain { colour: Colour, gloss: f32 },
    /// A lit surface.
    Lamp { colour: Colour, by_day: bool },
    /// The front of a building.
    Facade(Box<Facade>),
    /// A wall without openings.
    Wall { kind: Wall, colour: Colour },
    /// Roofing in rows.
    Tiles { colour: Colour, size: f32 },
    /// Leaves, or needles that stay in winter.
    Foliage { colour: Colour, evergreen: bool },
    /// Grass, fields, hillsides.
    Meadow { colour: Colour },
    /// A stream of cars, lanes and crossings on a grid.
    Roads(Roads),
    /// Slabs of the sidewalk.
    Pavement { colour: Colour },
    /// A railway's ballast around `x = centre`.
    Ballast,
    /// Square tiles in two colours.
    Checks { first: Colour, second: Colour, size: f32 },
    /// Boards along `u`.
    Boards { colour: Colour, width: f32 },
    /// A picture or poster, different for every seed.
    Picture,
    /// A shelf full of things.
    Shelf { colour: Colour },
    /// Words on a coloured ground.
    Sign { ground: Colour, ink: Colour, lit: bool },
    /// A door with panels and a handle.
    Door { colour: Colour },
    /// A window from inside: bright by day, black at night.
    Outlook,
    /// Car body with a dark band of windows in the upper part.
    Car { colour: Colour },
    /// Checked cloth, curtains, carpets.
    Cloth { colour: Colour, other: Colour, size: f32 },
}

/// Where a material is looked up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Touch {
    /// The surface there.
    pub(crate) spot: Spot,
    /// The point, world frame.
    pub(crate) point: Vec3,
    /// The viewing ray's direction in the frame `(u, v, normal)`; the last is negative.
    pub(crate) view: Vec3,
    /// Width of a pixel there, in metres: detail finer than it is left out.
    pub(crate) footprint: f32,
    /// The shape's own number.
    pub(crate) seed: u32,
}

/// The time of year and day as far as materials change with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Season {
    /// 0 in June, 1 in October.
    pub(crate) autumn: f32,
    /// 0 with leaves, 1 bare.
    pub(crate) bare: f32,
    /// Share of the ground under snow.
    pub(crate) snow: f32,
    /// 0 by day, 1 at night.
    pub(crate) night: f32,
    /// Which evening: other windows are lit.
    pub(crate) evening: u32,
}

/// What the material says about a place on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Paint {
    /// Reflected share.
    pub(crate) albedo: Colour,
    /// Own light.
    pub(crate) glow: Colour,
    /// Share of the mirror image, 0 to 1.
    pub(crate) gloss: f32,
    /// How far the normal leans towards `u` and `v`.
    pub(crate) tilt: Vec2,
    /// How far behind the face the surface lies, along the viewing ray.
    pub(crate) sunk: f32,
    /// Share of the sky's light that reaches it.
    pub(crate) open: f32,
}

impl Paint {
    pub(crate) fn matt(albedo: Colour) -> Self {
        let dull = Vec2::ZERO;
        Self { albedo, glow: Vec3::ZERO, gloss: 0.0, tilt: dull, sunk: 0.0, open: 1.0 }
    }

    pub(crate) fn glossy(albedo: Colour, gloss: f32) -> Self {
        Self { gloss, ..Self::matt(albedo) }
    }
}

/// A colour as the eye names it: sRGB bytes made linear (with a power of two, near enough).
pub(crate) fn rgb(red: u8, green: u8, blue: u8) -> Colour {
    let eye = Vec3::new(f32::from(red), f32::from(green), f32::from(blue)) / 255.0;
    eye * eye
}

/// A colour from hue 0 to 1, saturation and brightness.
pub(crate) fn hue(hue: f32, saturation: f32, brightness: f32) -> Colour {
    let sector = hue.rem_euclid(1.0) * 6.0;
    let pure = Vec3::new(
        (sector - 3.0).abs() - 1.0,
        2.0 - (sector - 2.0).abs(),
        2.0 - (sector - 4.0).abs(),
    )
    .clamp(Vec3::ZERO, Vec3::ONE);
    let eye = (Vec3::ONE + (pure - Vec3::ONE) * saturation) * brightness;
    eye * eye
}

impl Material {
    /// How far the material can lie behind its face; the renderer asks no further.
    pub(crate) fn paint(&self, touch: &Touch, season: &Season) -> Paint {
        let Touch { spot, point, footprint, seed, .. } = *touch;
        match self {
            Self::Plain { colour, gloss } => {
                let dirt = cloudy(seed, spot.uv * 2.3, 3, 2.3 * footprint);
                Paint::glossy(*colour * lerp(0.85, 1.1, dirt), *gloss)
            }
            Self::Lamp { colour, by_day } => {
                let lit = if *by_day { 1.0 } else { step(0.4, 0.7, season.night) };
                Paint { glow: *colour * lit, ..Paint::matt(Vec3::splat(0.7)) }
            }
            Self::Facade(facade) => facade.paint(touch, season),
            Self::Wall { kind, colour } => wall(*kind, *colour, touch),
            Self::Tiles { colour, size } => tiles(*colour, *size, touch),
            Self::Foliage { colour, evergreen } => foliage(*colour, *evergreen, touch, season),
            Self::Meadow { colour } => meadow(*colour, touch, season),
            Self::Roads(roads) => road_ground(roads, touch, season),
            Self::Pavement { colour } => pavement(*colour, touch),
            Self::Ballast => rails_ground(touch, season),
            Self::Checks { first, second, size } => checks(*first, *second, *size, touch),
            Self::Boards { colour, width } => boards(*colour, *width, touch),
            Self::Picture => Paint::matt(poster(seed, spot.uv / spot.extent, footprint)),
            Self::Shelf { colour } => shelf(*colour, touch),
            Self::Sign { ground, ink, lit } => {
                let (u, v) = (spot.uv.x / spot.extent.x, spot.uv.y / spot.extent.y);
                let aspect = spot.extent.x / spot.extent.y;
                let ink_here = lettering::line(seed, Vec2::new(u, v), aspect);
                let colour = ground.lerp(*ink, ink_here);
                let glow =
                    if *lit { colour * 0.9 * step(0.4, 0.7, season.night) } else { Vec3::ZERO };
                Paint { glow, ..Paint::matt(colour) }
            }
            Self::Door { colour } => door(*colour, touch),
            Self::Outlook => outlook(touch, season),
            Self::Car { colour } => car(*colour, touch),
            Self::Cloth { colour, other, size } => {
                let at =
                    if spot.normal.z.abs() > 0.7 { Vec2::new(point.x, point.y) } else { spot.uv };
                let band = ((at / *size).floor().element_sum() as i32).rem_euclid(2) == 0;
                let fuzz = cloudy(seed, at * 20.0, 2, 20.0 * footprint);
                Paint::matt((if band { *colour } else { *other }) * lerp(0.8, 1.15, fuzz))
            }
        }
    }
}

fn tiles(colour: Colour, size: f32, touch: &Touch) -> Paint {
    let at = touch.spot.uv / size;
    let row = at.y.floor();
    let column = (at.x + 0.5 * (row as i32).rem_euclid(2) as f32).floor();
    let own = unit(cell(touch.seed, column as i32, row as i32));
    let edge = 1.0 - step(0.0, 0.25, at.y - row);
    let seen = step(1.5 * size, 0.3 * size, touch.footprint);
    let wear = cloudy(touch.seed ^ 9, touch.spot.uv * 0.6, 3, 0.6 * touch.footprint);
    Paint::matt(colour * lerp(0.75, 1.2, wear) * (1.0 + seen * (0.3 * (own - 0.5) - 0.35 * edge)))
}

fn foliage(colour: Colour, evergreen: bool, touch: &Touch, season: &Season) -> Paint {
    let clump = value(touch.seed, touch.spot.uv * 2.4);
    let fine =
        if touch.footprint < 0.12 { value(touch.seed ^ 5, touch.spot.uv * 9.0) } else { 0.5 };
    let gold = rgb(196, 120, 38).lerp(rgb(150, 60, 30), unit(mix(touch.seed)));
    let turned = if evergreen { colour } else { colour.lerp(gold, season.autumn) };
    let bare = if evergreen { 0.0 } else { season.bare };
    let leaf = turned.lerp(rgb(82, 70, 60), bare);
    let tilt = Vec2::new(clump - 0.5, fine - 0.5) * 1.4;
    let open = lerp(0.35, 1.0, clump);
    Paint { tilt, open, ..Paint::matt(leaf * lerp(0.45, 1.35, 0.5 * (clump + fine))) }
}

fn meadow(colour: Colour, touch: &Touch, season: &Season) -> Paint {
    let at = touch.spot.uv;
    let broad = cloudy(touch.seed, at * 0.05, 4, 0.05 * touch.footprint);
    let fine = cloudy(touch.seed ^ 3, at * 3.0, 3, 3.0 * touch.footprint);
    let dry = colour.lerp(rgb(150, 132, 80), (0.3 + 0.5 * season.autumn) * step(0.4, 0.7, broad));
    let bald = dry.lerp(rgb(110, 92, 70), step(0.62, 0.75, broad));
    Paint { tilt: Vec2::splat(fine - 0.5) * 0.3, ..Paint::matt(bald * lerp(0.55, 1.3, fine)) }
}

fn pavement(colour: Colour, touch: &Touch) -> Paint {
    let at = touch.spot.uv / 0.9;
    let joint = (at - at.floor() - Vec2::splat(0.5)).abs().max_element();
    let seen = step(0.5, 0.05, touch.footprint);
    let slab = unit(cell(touch.seed, at.x.floor() as i32, at.y.floor() as i32));
    let stain = cloudy(touch.seed ^ 1, at * 0.7, 4, touch.footprint);
    let shade = lerp(0.75, 1.15, stain) * (1.0 + seen * 0.18 * (slab - 0.5));
    Paint::matt(colour * shade * (1.0 - 0.45 * seen * step(0.465, 0.49, joint)))
}

fn checks(first: Colour, second: Colour, size: f32, touch: &Touch) -> Paint {
    let at = touch.spot.uv / size;
    let floor = at.floor();
    let odd = (floor.x as i32 + floor.y as i32).rem_euclid(2) == 0;
    let joint = (at - floor - Vec2::splat(0.5)).abs().max_element();
    let own = unit(cell(touch.seed, floor.x as i32, floor.y as i32));
    let seen = step(0.6 * size, 0.1 * size, touch.footprint);
    let colour = (if odd { first } else { second }) * (1.0 + 0.2 * (own - 0.5));
    Paint::glossy(colour * (1.0 - 0.5 * seen * step(0.47, 0.49, joint)), 0.12)
}

fn boards(colour: Colour, width: f32, touch: &Touch) -> Paint {
    let row = (touch.spot.uv.y / width).floor();
    let own = unit(cell(touch.seed, row as i32, 3));
    let along = touch.spot.uv.x + 9.0 * own;
    let grain = cloudy(
        touch.seed,
        Vec2::new(along * 1.2, touch.spot.uv.y * 24.0),
        3,
        24.0 * touch.footprint,
    );
    let joint = (touch.spot.uv.y / width - row - 0.5).abs();
    let seen = step(0.5 * width, 0.1 * width, touch.footprint);
    let line = 1.0 - 0.55 * seen * step(0.45, 0.49, joint);
    Paint::glossy(colour * lerp(0.7, 1.25, grain) * (0.85 + 0.3 * own) * line, 0.06)
}

fn shelf(colour: Colour, touch: &Touch) -> Paint {
    if touch.spot.face >= 4 {
        return Paint::matt(colour);
    }
    let row = (touch.spot.uv.y / 0.38).floor();
    let up = touch.spot.uv.y / 0.38 - row;
    if !(0.07..=0.97).contains(&up)
        || touch.spot.uv.x < 0.04
        || touch.spot.uv.x > touch.spot.extent.x - 0.04
    {
        return Paint::matt(colour);
    }
    // Books of varied width: a walk over hashed cells of 0.24 m, each split in hashed parts.
    let block = (touch.spot.uv.x / 0.24).floor();
    let hash = cell(touch.seed, block as i32, row as i32);
    if unit(hash) < 0.15 {
        return Paint { open: 0.3, ..Paint::matt(colour * 0.35) };
    }
    let parts = 2 + (hash % 4) as i32;
    let part = ((touch.spot.uv.x / 0.24 - block) * parts as f32) as i32;
    let book = cell(hash, part, row as i32);
    if up > 0.6 + 0.35 * unit(mix(book)) {
        return Paint { open: 0.3, ..Paint::matt(colour * 0.3) };
    }
    Paint::matt(hue(unit(book), 0.2 + 0.6 * unit(mix(book ^ 7)), 0.25 + 0.6 * unit(mix(book ^ 3))))
}

fn door(colour: Colour, touch: &Touch) -> Paint {
    if touch.spot.face >= 4 {
        return Paint::matt(colour);
    }
    let at = touch.spot.uv / touch.spot.extent;
    let handle = (touch.spot.uv - Vec2::new(touch.spot.extent.x - 0.1, 1.05)).length() < 0.05;
    let panel = |low: f32, high: f32| {
        let x = (at.x - 0.5).abs();
        let edge = (x - 0.34).abs() < 0.02 && at.y > low && at.y < high;
        edge || (x < 0.34 && ((at.y - low).abs() < 0.012 || (at.y - high).abs() < 0.012))
    };
    let glazed =
        touch.seed.is_multiple_of(3) && (at.x - 0.5).abs() < 0.3 && (0.56..0.9).contains(&at.y);
    if handle {
        return Paint::glossy(Vec3::splat(0.6), 0.4);
    }
    if glazed {
        return Paint::glossy(rgb(90, 105, 110), 0.3);
    }
    let line = panel(0.08, 0.45) || panel(0.55, 0.92);
    Paint::glossy(if line { colour * 0.55 } else { colour }, 0.05)
}

fn outlook(touch: &Touch, season: &Season) -> Paint {
    let at = touch.spot.uv / touch.spot.extent;
    let panes = 1.0 + (touch.seed % 3) as f32;
    let bar = |x: f32, n: f32| (x * n - (x * n).round()).abs() / n;
    let frame = bar(at.x, panes) * touch.spot.extent.x < 0.04
        || bar(at.y, 1.0) * touch.spot.extent.y < 0.05;
    if frame {
        return Paint::matt(Vec3::splat(0.75));
    }
    // Trees and roofs outside, far away: seen through the window, not on the pane.
    let through = at + Vec2::new(touch.view.x, touch.view.y) / touch.view.z.min(-0.2) * -0.8;
    let line = 0.35 + 0.25 * value(touch.seed, Vec2::new(through.x * 4.0, 0.5));
    let sky = rgb(205, 222, 240) * 2.2;
    let far = if through.y > line {
        sky
    } else {
        rgb(80, 105, 70) * lerp(0.6, 1.6, value(touch.seed ^ 1, through * 14.0))
    };
    let day = 1.0 - step(0.3, 0.8, season.night);
    Paint { glow: far * day, ..Paint::glossy(Vec3::splat(0.02), 0.3) }
}

fn car(colour: Colour, touch: &Touch) -> Paint {
    let up = touch.spot.uv.y / touch.spot.extent.y;
    let across = (touch.spot.uv.x / touch.spot.extent.x - 0.5).abs();
    if touch.spot.face >= 4 {
        return Paint::glossy(colour, 0.15);
    }
    let is_end = touch.spot.face < 2;
    let is_van = touch.spot.extent.y > 1.5;
    if !is_end && up < if is_van { 0.2 } else { 0.35 } && (0.26..0.4).contains(&across) {
        return Paint::matt(Vec3::splat(0.03));
    }
    let lamp = if is_van { 0.22..0.32 } else { 0.5..0.72 };
    if is_end && lamp.contains(&up) && across > 0.34 {
        let red = if touch.spot.face == 1 { rgb(170, 20, 20) } else { rgb(235, 235, 220) };
        return Paint { glow: red * 0.1, ..Paint::glossy(red, 0.3) };
    }
    let pane = is_van && (0.55..0.85).contains(&up) && across < 0.43;
    if pane && (is_end || touch.spot.uv.x / touch.spot.extent.x > 0.68) {
        return Paint::glossy(rgb(40, 46, 52), 0.45);
    }
    let sill = !is_van && (up - 0.8).abs() < 0.03;
    Paint::glossy(if sill { colour * 0.5 } else { colour }, 0.2)
}
