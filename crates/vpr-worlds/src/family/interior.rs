//! Corridors, rows of rooms, and a station's escalators.

use glam::{Vec2, Vec3};

use super::{Plan, beside, level_pose, looking_at, two_traverses};
use crate::{
    geometry::Geometry,
    light::Light,
    material::{Material, rgb},
    parts::{Furnisher, INDOORS, Room, StreetKit, hide_behind, shell},
    recipe::{Interior, Kind, Recipe},
    scene::{Draft, Lamp, Scene},
    seed::Seed,
    traverse::{Offset, Traverse},
};

/// Length of a stretch of corridor with one look.
const SECTION: f32 = 9.5;
/// Distance between the middles of the two escalators.
const LANES: f32 = 1.8;
/// Rise of an escalator per metre forward.
const RISE: f32 = 0.577;

impl Interior {
    pub(crate) fn plan(&self, recipe: &Recipe, seed: Seed) -> Plan {
        let steps = recipe.steps(self.spacing_m);
        let n = steps.last().map_or(0, |last| last + 1);
        let route: Vec<_> = steps.into_iter().map(|place| self.pose(place, seed)).collect();
        let build = |traverse: &Traverse, number: i64| {
            let mut draft = Draft::default();
            let furnisher = Furnisher::new(&mut draft, seed.named("furnisher"));
            let kit = StreetKit::new(&mut draft, seed.named("kit"));
            let visit = Visit { interior: self, furnisher, seed, number, traverse };
            match self.kind {
                Kind::Corridor => visit.corridor(&mut draft, n),
                Kind::Rooms => visit.rooms(&mut draft, n),
                Kind::Escalator => visit.escalator(&mut draft, n),
            }
            (Scene::new(draft), kit)
        };
        let (first, _) = build(&recipe.references, 0);
        let (second, kit) = build(&recipe.queries, 1);
        let lights = vec![
            Light::indoors(&recipe.references.condition, seed.named("first light")),
            Light::indoors(&recipe.queries.condition, seed.named("second light")),
        ];
        let share = recipe.queries.condition.occlusion;
        let (references, queries) = two_traverses(recipe, &route, seed, |pose, own| {
            hide_behind(&kit, (pose, &recipe.camera), share, INDOORS, own)
        });
        Plan {
            scenes: vec![first, second],
            lights,
            references,
            queries,
            grid: Vec::new(),
            world_from_scene: vpr_core::Pose::identity(),
        }
    }

    fn pose(&self, place: usize, seed: Seed) -> vpr_core::Pose {
        let along = (place as f64 * self.spacing_m) as f32;
        let eye = self.eye_m as f32;
        let north = std::f64::consts::FRAC_PI_2;
        match self.kind {
            Kind::Corridor => level_pose(Vec3::new(0.0, along + 1.0, eye), north),
            Kind::Escalator => {
                let level = level_pose(Vec3::new(0.0, along, eye + RISE * along), north);
                beside(&level, &Offset { pitch_deg: 18.0, ..Offset::default() }, seed)
            }
            Kind::Rooms => {
                let (number, within) = (place / self.places_per_room, place % self.places_per_room);
                let room = room(number, seed);
                let size = room.high - room.low;
                let share = within as f32 / (self.places_per_room - 1) as f32;
                // From one corner towards the next one, looking across the room.
                let at = room.low + Vec3::new(0.2 + 0.25 * share, 0.2 + 0.45 * share, 0.0) * size;
                let turn = share * 1.6 - 0.6;
                let look = room.low
                    + Vec3::new(0.5 + 0.4 * libm::cosf(turn), 0.5 + 0.4 * libm::sinf(turn), 0.0)
                        * size;
                let wide = |v: Vec3| {
                    nalgebra::Vector3::new(f64::from(v.x), f64::from(v.y), f64::from(v.z))
                };
                let (at, look) = (at + Vec3::Z * eye, look + Vec3::Z * (eye - 0.25));
                looking_at(wide(at), wide(look))
            }
        }
    }
}

/// Where a room of a row lies and how large it is.
fn room(number: usize, seed: Seed) -> Room {
    let own = seed.named("room").at(number as i64);
    let low = Vec3::new(20.0 * number as f32, 0.0, 0.0);
    let size =
        Vec3::new(own.at(0).range(4.5, 7.5), own.at(1).range(4.5, 8.5), own.at(2).range(2.5, 3.2));
    Room { low, high: low + size }
}

/// One visit: the walls last, some things have changed.
struct Visit<'a> {
    interior: &'a Interior,
    furnisher: Furnisher,
    seed: Seed,
    number: i64,
    traverse: &'a Traverse,
}

impl Visit<'_> {
    fn change(&self) -> (Seed, f32) {
        (self.seed.named("visit").at(self.number), self.traverse.condition.changed as f32)
    }

    /// Share of lamps that burn: by night every third.
    fn lit(&self) -> f32 {
        1.0 - 0.67 * self.traverse.condition.darkness as f32
    }

    fn look(&self, section: i64) -> Seed {
        let own = self.seed.named("section").at(section);
        if own.at(1).chance(self.interior.aliasing as f32) {
            return self.seed.named("model").at(own.at(2).index(2) as i64);
        }
        own
    }

    fn corridor(&self, draft: &mut Draft, n: usize) {
        let length = n as f32 * self.interior.spacing_m as f32;
        let half = 0.5 * self.interior.width_m as f32;
        for section in 0..(length / SECTION).ceil() as i64 + 2 {
            let look = self.look(section);
            let low = Vec3::new(-half, section as f32 * SECTION, 0.0);
            let room = Room {
                low,
                high: low + Vec3::new(2.0 * half, SECTION, look.at(3).range(2.5, 3.1)),
            };
            sides(draft, &room, look);
            for (corner, inward, key) in
                [(low, Vec3::X, 0), (low + Vec3::X * 2.0 * half, -Vec3::X, 1)]
            {
                let wall = (corner, Vec3::Y, inward, SECTION);
                let blank = self.interior.blank as f32;
                self.furnisher.wall(draft, wall, blank, look.named("wall").at(key), self.change());
            }
            self.furnisher.lights(
                draft,
                &room,
                3.4,
                self.lit(),
                self.seed.named("lamps").at(section),
            );
        }
        // The far end.
        let end = draft.material(Material::Door { colour: rgb(150, 60, 50) });
        let y = (length / SECTION).ceil().max(0.0) * SECTION + 2.0 * SECTION;
        draft.add(Geometry::span(Vec3::new(-half, y - 0.1, 0.0), Vec3::new(half, y, 3.1)), end, 0);
    }

    fn rooms(&self, draft: &mut Draft, n: usize) {
        for number in 0..n.div_ceil(self.interior.places_per_room) {
            let room = room(number, self.seed);
            let look = self.look(number as i64);
            shell(draft, &room, look);
            self.furnisher.furnish(
                draft,
                &room,
                self.interior.blank as f32,
                look.named("things"),
                self.change(),
            );
            self.furnisher.lights(
                draft,
                &room,
                3.0,
                self.lit(),
                self.seed.named("lamps").at(number as i64),
            );
            let center = (room.low + room.high) * 0.5;
            let size = Vec2::new(look.at(7).range(0.8, 1.5), look.at(8).range(0.7, 1.2));
            let shift = Vec3::new(0.9, 0.6, 0.0);
            self.furnisher.table(
                draft,
                Vec3::new(center.x, center.y, room.low.z) + shift,
                size,
                look.named("table"),
            );
        }
    }

    fn escalator(&self, draft: &mut Draft, n: usize) {
        let length = n as f32 * self.interior.spacing_m as f32 + 14.0;
        let metal = draft.material(Material::Plain { colour: rgb(140, 142, 145), gloss: 0.3 });
        let black = draft.material(Material::Plain { colour: rgb(24, 24, 26), gloss: 0.15 });
        let tile = draft.material(Material::Checks {
            first: rgb(216, 214, 205),
            second: rgb(206, 205, 198),
            size: 0.3,
        });
        let band = draft.material(Material::Checks {
            first: rgb(40, 80, 130),
            second: rgb(46, 88, 140),
            size: 0.3,
        });
        let picture = draft.material(Material::Picture);
        let (left, right) = (-1.7, LANES + 1.7);
        let up = |y: f32| RISE * y;
        for (x, key) in [(left, 0), (right, 1)] {
            let corner = Vec3::new(x, -6.0, up(-6.0) - 1.0);
            let v = Vec3::Z;
            let u = Vec3::new(0.0, length + 12.0, RISE * (length + 12.0));
            draft.add(Geometry::Patch { corner, u, v: v * 2.0 }, band, 1);
            draft.add(Geometry::Patch { corner: corner + v * 2.0, u, v: v * 3.6 }, tile, 2);
            self.posters(draft, length, (x, key), picture);
        }
        let corner = Vec3::new(left, -6.0, up(-6.0) + 4.4);
        let roof = Vec3::new(0.0, length + 12.0, RISE * (length + 12.0));
        draft.add(Geometry::Patch { corner, u: Vec3::X * (right - left), v: roof }, tile, 3);
        for step in -12..(length / 0.4) as i32 {
            let y = step as f32 * 0.4;
            for lane in [0.0, LANES] {
                let low = Vec3::new(lane - 0.55, y, up(y) - 0.6);
                draft.add(
                    Geometry::span(low, Vec3::new(lane + 0.55, y + 0.4, up(y))),
                    metal,
                    step as u32 % 4,
                );
            }
        }
        for x in [-0.75, 0.75, LANES - 0.75, LANES + 0.75] {
            let corner = Vec3::new(x, -6.0, up(-6.0) - 0.8);
            let u = Vec3::new(0.0, length + 12.0, RISE * (length + 12.0));
            draft.add(Geometry::Patch { corner, u, v: Vec3::Z * 1.75 }, metal, 4);
            draft.add(
                Geometry::Patch {
                    corner: corner + Vec3::new(-0.06, 0.0, 1.76),
                    u,
                    v: Vec3::X * 0.12,
                },
                black,
                4,
            );
        }
        self.shaft_lamps(draft, length);
    }

    /// Posters along one wall of the escalators' shaft.
    fn posters(&self, draft: &mut Draft, length: f32, (x, key): (f32, i64), picture: u32) {
        for poster in 0..(length / 2.2) as i64 {
            let own = self.seed.named("poster").at(key).at(poster);
            let (visit, changed) = self.change();
            let own = if own.at(5).chance(changed) { visit.at(poster) } else { own };
            let y = poster as f32 * 2.2 + own.at(0).range(0.0, 0.8);
            let size = Vec3::new(0.06, own.at(1).range(0.5, 1.1), own.at(2).range(0.7, 1.4));
            let sheet = Geometry::block(Vec3::new(x, y, RISE * y + 1.7), size, 0.0);
            draft.add(sheet, picture, own.bits());
        }
    }

    fn shaft_lamps(&self, draft: &mut Draft, length: f32) {
        for lamp in 0..(length / 3.5) as i64 {
            let y = lamp as f32 * 3.5;
            let position = Vec3::new(0.5 * LANES, y, RISE * y + 4.0);
            if self.seed.named("lamps").at(lamp).chance(self.lit()) {
                draft.lamps.push(Lamp {
                    position,
                    colour: Vec3::new(1.0, 0.95, 0.86) * 2.2,
                    reach: 9.0,
                    by_day: true,
                });
            }
        }
    }
}

/// Floor, ceiling and the two walls along y, without the ends.
fn sides(draft: &mut Draft, room: &Room, look: Seed) {
    let mut whole = Draft::default();
    std::mem::swap(&mut whole.materials, &mut draft.materials);
    shell(&mut whole, room, look);
    std::mem::swap(&mut whole.materials, &mut draft.materials);
    // A shell is floor, ceiling, and the walls at low y, low x, high y, high x.
    let keep = [0, 1, 3, 5];
    draft.shapes.extend(keep.map(|index| whole.shapes[index].clone()));
    let beam = draft.material(Material::Plain { colour: rgb(120, 118, 112), gloss: 0.0 });
    let (low, high) = (room.low, room.high);
    for x in [low.x, high.x - 0.12] {
        let low = Vec3::new(x, low.y - 0.15, 0.0);
        draft.add(Geometry::span(low, Vec3::new(x + 0.12, low.y + 0.3, high.z)), beam, look.bits());
    }
    draft.add(
        Geometry::span(
            Vec3::new(low.x, low.y - 0.15, high.z - 0.25),
            Vec3::new(high.x, low.y + 0.15, 3.4),
        ),
        beam,
        look.bits(),
    );
}
