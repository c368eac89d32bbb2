//! Fronts of buildings: floors and bays of recessed windows over a ground floor of shops or doors.

use glam::{Vec2, Vec3};

use super::{Colour, Paint, Season, Touch, Wall, hue, lettering, rgb, wall};
use crate::{
    noise::{cloudy, lerp, step},
    seed::{Seed, cell, mix, unit},
};

/// One window of a facade, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Opening {
    /// Width as a share of its bay.
    pub(crate) share: f32,
    /// Height of the lower edge above the floor.
    pub(crate) sill: f32,
    /// Height of the opening.
    pub(crate) height: f32,
    /// Round at the top.
    pub(crate) arched: bool,
    /// Panes beside and above each other.
    pub(crate) panes: (u8, u8),
    /// Shutters of this colour on both sides.
    pub(crate) shutters: Option<Colour>,
    /// How far the glass lies behind the wall.
    pub(crate) inset: f32,
}

/// What the ground floor is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Front {
    /// Display windows below a sign.
    Shop { ground: Colour, ink: Colour, shop: u32 },
    /// A door among windows.
    Home { door: Colour },
    /// Roller doors.
    Garage { colour: Colour },
}

/// The front of one building.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Facade {
    /// What the wall is made of.
    pub(crate) wall: Wall,
    /// Its colour.
    pub(crate) colour: Colour,
    /// Colour of sills, surrounds and bands.
    pub(crate) trim: Colour,
    /// Colour of window frames.
    pub(crate) frame: Colour,
    /// Height of an upper floor.
    pub(crate) floor: f32,
    /// Height of the ground floor.
    pub(crate) ground: f32,
    /// Wanted width of a bay.
    pub(crate) bay: f32,
    /// The windows.
    pub(crate) opening: Opening,
    /// The ground floor, on the face that looks at the street.
    pub(crate) front: Front,
    /// That face; 255 if all do.
    pub(crate) face: u8,
    /// Stone bands between the floors.
    pub(crate) bands: bool,
    /// Corner stones.
    pub(crate) quoins: bool,
}

/// A place on the facade in its own frame.
struct Place<'a> {
    touch: &'a Touch,
    season: &'a Season,
    /// Shift of a plane per metre that it lies behind the wall.
    slide: Vec2,
    /// Length of the ray per metre of depth.
    stretch: f32,
}

impl Facade {
    pub(crate) fn paint(&self, touch: &Touch, season: &Season) -> Paint {
        let spot = &touch.spot;
        if spot.face >= 4 {
            let gravel = cloudy(touch.seed, spot.uv * 0.8, 3, 0.8 * touch.footprint);
            return Paint::matt(rgb(120, 116, 110) * lerp(0.7, 1.2, gravel));
        }
        let deep = (-touch.view.z).max(0.08);
        let slide = Vec2::new(touch.view.x, touch.view.y) / deep;
        let place = Place { touch, season, slide, stretch: 1.0 / deep };
        let (u, v) = (spot.uv.x, spot.uv.y);
        let is_front = self.face == spot.face || self.face == 255;
        if v < self.ground {
            return if is_front { self.ground_floor(&place) } else { self.bare(&place) };
        }
        let n_floors = ((spot.extent.y - self.ground) / self.floor).floor();
        let level = ((v - self.ground) / self.floor).floor();
        if level >= n_floors || (!is_front && touch.seed.is_multiple_of(3)) {
            return self.bare(&place);
        }
        let n_bays = (spot.extent.x / self.bay).round().max(1.0);
        let width = spot.extent.x / n_bays;
        let bay = (u / width).floor();
        let up = v - self.ground - level * self.floor;
        let at = Vec2::new(u - (bay + 0.5) * width, up);
        self.window_bay(at, width, (bay as i32, level as i32), &place)
    }

    fn bare(&self, place: &Place<'_>) -> Paint {
        let mut paint = wall(self.wall, self.colour, place.touch);
        let Touch { spot, .. } = place.touch;
        let corner = spot.uv.x.min(spot.extent.x - spot.uv.x);
        let long = (spot.uv.y / 0.35).floor() as i32 % 2 == 0;
        if self.quoins && corner < if long { 0.55 } else { 0.35 } {
            paint.albedo = self.trim * 0.9;
        }
        paint
    }

    /// `at` is measured from the middle of the bay and the floor's level.
    fn window_bay(
        &self,
        at: Vec2,
        width: f32,
        (bay, level): (i32, i32),
        place: &Place<'_>,
    ) -> Paint {
        let Opening { share, sill, height, arched, shutters, inset, .. } = self.opening;
        let half = 0.5 * share * width;
        let top = sill + height;
        let inside = |at: Vec2| {
            let below_arch = !arched || {
                let from = Vec2::new(at.x, (at.y - (top - half)).max(0.0));
                from.length() < half
            };
            at.x.abs() < half && at.y > sill && at.y < top && below_arch
        };
        if inside(at) {
            let behind = at + place.slide * inset;
            if inside(behind) {
                let own = cell(place.touch.seed ^ 0x77, bay, level);
                let within =
                    Vec2::new((behind.x + half) / (2.0 * half), (behind.y - sill) / height);
                let size = Vec2::new(2.0 * half, height);
                return Paint {
                    sunk: inset * place.stretch,
                    ..self.glass(own, within, size, place)
                };
            }
            // The reveal: somewhere between the face and the glass.
            return Paint {
                open: 0.5,
                sunk: 0.5 * inset * place.stretch,
                ..Paint::matt(self.trim * 0.7)
            };
        }
        if self.bands && at.y < 0.22 {
            return Paint::matt(self.trim * if at.y < 0.05 { 0.55 } else { 0.95 });
        }
        let beside = at.x.abs() - half;
        if let Some(colour) = shutters
            && beside > 0.03
            && beside < half.min(0.5 * (width - 2.0 * half)) - 0.04
            && at.y > sill
            && at.y < top
        {
            let slat = (at.y * 14.0).rem_euclid(1.0) < 0.3 && place.touch.footprint < 0.05;
            return Paint::matt(colour * if slat { 0.6 } else { 1.0 });
        }
        if beside < 0.16 && at.y > sill - 0.14 && at.y < sill {
            return Paint::matt(self.trim * if at.y < sill - 0.1 { 0.5 } else { 1.05 });
        }
        if !arched && beside < 0.1 && at.y > top && at.y < top + 0.2 {
            return Paint::matt(self.trim * 0.95);
        }
        if beside < 0.07 && at.y > sill && at.y < top {
            return Paint::matt(self.trim);
        }
        self.bare(place)
    }

    /// Frame, panes and what is behind them; `within` is 0 to 1.
    fn glass(&self, own: u32, within: Vec2, size: Vec2, place: &Place<'_>) -> Paint {
        let (columns, rows) = self.opening.panes;
        let bar = |x: f32, n: u8, length: f32| {
            let scaled = x * f32::from(n);
            (scaled - scaled.round()).abs() / f32::from(n) * length
        };
        if bar(within.x, columns, size.x) < 0.035 || bar(within.y, rows, size.y) < 0.04 {
            return Paint::matt(self.frame);
        }
        let lit = Self::lit(own, place.season);
        let blind = unit(mix(own ^ 1)) * 0.8;
        let drawn = unit(mix(own ^ 2)) < 0.45 && 1.0 - within.y < blind;
        let gathered =
            unit(mix(own ^ 3)) < 0.5 && (within.x - 0.5).abs() > 0.5 - 0.22 * unit(mix(own ^ 4));
        let cloth = hue(unit(mix(own ^ 5)), 0.15, lerp(0.6, 0.95, unit(mix(own ^ 6))));
        let behind = if drawn || gathered { cloth * 0.55 } else { Vec3::splat(0.02) };
        let glow = if drawn || gathered { cloth } else { Vec3::new(1.0, 0.8, 0.5) } * lit;
        Paint { glow, open: 0.6, ..Paint::glossy(behind, 0.32) }
    }

    /// Light in a room: warm, in a third of the rooms, other rooms every evening.
    fn lit(own: u32, season: &Season) -> Vec3 {
        let on = unit(mix(own ^ season.evening)) < 0.33;
        let strength = lerp(0.25, 0.9, unit(mix(own ^ 8))) * step(0.35, 0.75, season.night);
        if on { Vec3::new(1.0, 0.78, 0.48) * strength } else { Vec3::ZERO }
    }

    fn ground_floor(&self, place: &Place<'_>) -> Paint {
        match self.front {
            Front::Shop { ground, ink, shop } => self.shop(ground, ink, shop, place),
            Front::Home { door } => self.home(door, place),
            Front::Garage { colour } => {
                let Touch { spot, .. } = place.touch;
                let n = (spot.extent.x / 3.6).floor().max(1.0);
                let x = (spot.uv.x / spot.extent.x * n).fract() * spot.extent.x / n;
                let margin = 0.5 * (spot.extent.x / n - 2.7);
                if x > margin && x < margin + 2.7 && spot.uv.y < 2.5 {
                    let slat = (spot.uv.y * 6.0).rem_euclid(1.0) < 0.12;
                    return Paint {
                        sunk: 0.15 * place.stretch,
                        ..Paint::matt(colour * if slat { 0.55 } else { 0.9 })
                    };
                }
                self.bare(place)
            }
        }
    }

    fn home(&self, door: Colour, place: &Place<'_>) -> Paint {
        let Touch { spot, seed, .. } = place.touch;
        let n_bays = (spot.extent.x / self.bay).round().max(1.0);
        let width = spot.extent.x / n_bays;
        let bay = (spot.uv.x / width).floor();
        let entrance = (mix(*seed ^ 0xd0) % n_bays as u32) as f32;
        let x = spot.uv.x - (bay + 0.5) * width;
        let base = 0.45;
        if spot.uv.y < base && (bay - entrance).abs() > 0.1 {
            return Paint::matt(self.trim * 0.55);
        }
        if (bay - entrance).abs() > 0.1 {
            return self.window_bay(Vec2::new(x, spot.uv.y - base), width, (bay as i32, -1), place);
        }
        let behind = Vec2::new(x, spot.uv.y) + place.slide * 0.25;
        if x.abs() < 0.6 && spot.uv.y < 2.75 {
            if behind.x.abs() > 0.6 || behind.y > 2.75 {
                return Paint {
                    open: 0.5,
                    sunk: 0.12 * place.stretch,
                    ..Paint::matt(self.trim * 0.6)
                };
            }
            let sunk = 0.25 * place.stretch;
            if behind.y > 2.2 {
                let own = mix(*seed ^ 0xd1);
                return Paint {
                    sunk,
                    glow: Self::lit(own, place.season),
                    ..Paint::glossy(Vec3::splat(0.04), 0.3)
                };
            }
            let panel = (behind.x.abs() - 0.4).abs() < 0.03 || (behind.y - 1.05).abs() < 0.05;
            return Paint { sunk, ..Paint::glossy(door * if panel { 0.5 } else { 1.0 }, 0.08) };
        }
        if x.abs() < 0.82 && spot.uv.y < 3.0 {
            return Paint::matt(self.trim);
        }
        self.bare(place)
    }

    fn shop(&self, ground: Colour, ink: Colour, shop: u32, place: &Place<'_>) -> Paint {
        let Touch { spot, .. } = place.touch;
        let (u, v) = (spot.uv.x, spot.uv.y);
        let night = step(0.35, 0.75, place.season.night);
        if v > self.ground - 0.85 {
            let up = (v - (self.ground - 0.85)) / 0.75;
            let across = u / spot.extent.x;
            if !(0.03..=0.97).contains(&across) || up > 1.0 {
                return self.bare(place);
            }
            let colour = ground
                .lerp(ink, lettering::line(shop, Vec2::new(across, up), spot.extent.x / 0.75));
            let lit = if unit(mix(shop ^ 2)) < 0.7 { 0.6 * night } else { 0.0 };
            return Paint { glow: colour * lit, ..Paint::matt(colour) };
        }
        let edge = u.min(spot.extent.x - u);
        if edge < 0.4 {
            return Paint::matt(self.trim * 0.8);
        }
        let seed = Seed::new(u64::from(shop));
        let door = seed.at(1).range(0.25, 0.75) * spot.extent.x;
        if (u - door).abs() < 0.5 {
            let at = Vec2::new(u - door, v) + place.slide * 0.5;
            if at.x.abs() > 0.5 {
                return Paint {
                    open: 0.4,
                    sunk: 0.25 * place.stretch,
                    ..Paint::matt(ground * 0.5)
                };
            }
            let rail = at.x.abs() > 0.42 || (at.y - 1.0).abs() < 0.06 || at.y < 0.25 || at.y > 2.1;
            let paint = if rail {
                Paint::matt(ground * 0.7)
            } else {
                Paint::glossy(Vec3::splat(0.04), 0.35)
            };
            return Paint { sunk: 0.5 * place.stretch, ..paint };
        }
        let riser = seed.at(2).range(0.2, 0.7);
        if v < riser {
            return Paint::matt(ground * 0.75);
        }
        let pane = seed.at(3).range(1.2, 2.2);
        if (u / pane - (u / pane).round()).abs() * pane < 0.05 || v - riser < 0.06 {
            return Paint::matt(self.frame);
        }
        // Goods on show behind the glass.
        let at = Vec2::new(u, v) + place.slide * 0.6;
        let block = (at / Vec2::new(0.55, 0.5)).floor();
        let own = cell(shop ^ 0x60, block.x as i32, block.y as i32);
        let middle = (at / Vec2::new(0.55, 0.5)) - block - Vec2::splat(0.5);
        let reach = 0.15 + 0.33 * unit(mix(own ^ 1));
        let thing = unit(own) < 0.6 && middle.abs().max_element() < reach;
        let colour = if thing {
            hue(unit(mix(own ^ 2)), 0.15 + 0.45 * unit(mix(own ^ 3)), 0.75)
        } else {
            ground * 0.12 + Vec3::splat(0.03)
        };
        Paint { glow: colour * 0.7 * night, open: 0.6, ..Paint::glossy(colour * 0.4, 0.3) }
    }
}
