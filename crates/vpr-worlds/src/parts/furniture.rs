//! Rooms with doors, windows, pictures and furniture along their walls.

use glam::{Vec2, Vec3};

use crate::{
    geometry::Geometry,
    material::{Material, Wall, hue, rgb},
    scene::{Draft, Lamp},
    seed::Seed,
};

/// The inside of a room, from its lowest to its highest corner.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Room {
    pub(crate) low: Vec3,
    pub(crate) high: Vec3,
}

/// Shared materials of interiors.
pub(crate) struct Furnisher {
    wood: [u32; 3],
    plain: [u32; 8],
    doors: [u32; 4],
    picture: u32,
    outlook: u32,
    shelf: [u32; 2],
    metal: u32,
    black: u32,
    leaves: u32,
    bulb: u32,
    sign: u32,
    white: u32,
}

/// A place on a wall: its foot, the direction along the wall, and into the room.
#[derive(Clone, Copy)]
struct Niche {
    foot: Vec3,
    along: Vec3,
    inward: Vec3,
    width: f32,
}

impl Niche {
    /// A block `out` metres deep from the wall, `wide` along it, between two heights.
    fn block(&self, shift: f32, out: (f32, f32), wide: f32, z: (f32, f32)) -> Geometry {
        let middle = self.foot + self.along * shift + self.inward * (0.5 * (out.0 + out.1));
        let size = self.along.abs() * wide + self.inward.abs() * (out.1 - out.0);
        let center = middle + Vec3::Z * (0.5 * (z.0 + z.1));
        let angle = 0.0;
        Geometry::block(center, size + Vec3::Z * (z.1 - z.0), angle)
    }
}

/// Floor, ceiling and four walls.
pub(crate) fn shell(draft: &mut Draft, room: &Room, seed: Seed) {
    let Room { low, high } = *room;
    let tone = hue(seed.at(0).unit(), seed.at(1).range(0.02, 0.14), seed.at(2).range(0.7, 0.95));
    let kind = seed.at(3).pick(&[
        Wall::Plaster,
        Wall::Plaster,
        Wall::Plaster,
        Wall::Brick,
        Wall::Concrete,
    ]);
    let wall = draft.material(Material::Wall { kind, colour: tone });
    let floor = draft.material(match seed.at(4).index(4) {
        0 => Material::Checks {
            first: rgb(190, 186, 176),
            second: rgb(150, 140, 128),
            size: seed.at(5).range(0.25, 0.6),
        },
        1 => Material::Boards { colour: rgb(150, 104, 64), width: 0.14 },
        2 => Material::Cloth {
            colour: hue(seed.at(6).unit(), 0.4, 0.4),
            other: hue(seed.at(6).unit(), 0.35, 0.5),
            size: 0.5,
        },
        _ => Material::Checks { first: rgb(120, 122, 124), second: rgb(114, 118, 120), size: 0.5 },
    });
    let ceiling = draft.material(Material::Checks {
        first: rgb(222, 222, 218),
        second: rgb(220, 220, 216),
        size: 0.6,
    });
    let size = high - low;
    let flat = |z: f32| Vec3::new(low.x, low.y, z);
    draft.add(
        Geometry::Patch { corner: flat(low.z), u: Vec3::X * size.x, v: Vec3::Y * size.y },
        floor,
        seed.bits(),
    );
    draft.add(
        Geometry::Patch { corner: flat(high.z), u: Vec3::X * size.x, v: Vec3::Y * size.y },
        ceiling,
        seed.bits(),
    );
    for (corner, u) in [
        (low, Vec3::X * size.x),
        (low, Vec3::Y * size.y),
        (Vec3::new(low.x, high.y, low.z), Vec3::X * size.x),
        (Vec3::new(high.x, low.y, low.z), Vec3::Y * size.y),
    ] {
        draft.add(Geometry::Patch { corner, u, v: Vec3::Z * size.z }, wall, seed.bits());
    }
}

impl Furnisher {
    pub(crate) fn new(draft: &mut Draft, seed: Seed) -> Self {
        let wood = [rgb(166, 120, 78), rgb(110, 74, 48), rgb(206, 178, 140)]
            .map(|colour| draft.material(Material::Boards { colour, width: 0.4 }));
        let plain = std::array::from_fn(|k| {
            let own = seed.named("plain").at(k as i64);
            let colour =
                hue(own.at(0).unit(), own.at(1).range(0.05, 0.55), own.at(2).range(0.2, 0.85));
            draft.material(Material::Plain { colour, gloss: 0.03 })
        });
        let doors = std::array::from_fn(|k| {
            let own = seed.named("doors").at(k as i64);
            let colour =
                hue(own.at(0).unit(), own.at(1).range(0.1, 0.6), own.at(2).range(0.3, 0.85));
            draft.material(Material::Door { colour })
        });
        Self {
            wood,
            plain,
            doors,
            picture: draft.material(Material::Picture),
            outlook: draft.material(Material::Outlook),
            shelf: [rgb(150, 112, 76), rgb(215, 212, 205)]
                .map(|colour| draft.material(Material::Shelf { colour })),
            metal: draft.material(Material::Plain { colour: rgb(150, 152, 155), gloss: 0.3 }),
            black: draft.material(Material::Plain { colour: rgb(28, 30, 34), gloss: 0.25 }),
            leaves: draft.material(Material::Foliage { colour: rgb(58, 110, 50), evergreen: true }),
            bulb: draft.material(Material::Lamp { colour: Vec3::splat(2.4), by_day: true }),
            sign: draft.material(Material::Sign {
                ground: hue(seed.at(9).unit(), 0.5, 0.4),
                ink: Vec3::splat(0.9),
                lit: false,
            }),
            white: draft.material(Material::Plain { colour: rgb(225, 224, 220), gloss: 0.05 }),
        }
    }

    /// Lamps in a grid under the ceiling; `lit` is the share that burns.
    pub(crate) fn lights(
        &self,
        draft: &mut Draft,
        room: &Room,
        spacing: f32,
        lit: f32,
        seed: Seed,
    ) {
        let size = room.high - room.low;
        let (columns, rows) =
            ((size.x / spacing).ceil().max(1.0), (size.y / spacing).ceil().max(1.0));
        for row in 0..rows as i64 {
            for column in 0..columns as i64 {
                let x = room.low.x + size.x * (column as f32 + 0.5) / columns;
                let y = room.low.y + size.y * (row as f32 + 0.5) / rows;
                let center = Vec3::new(x, y, room.high.z - 0.03);
                let on = seed.at(row * 100 + column).chance(lit);
                let material = if on { self.bulb } else { self.white };
                draft.add(Geometry::block(center, Vec3::new(0.3, 1.2, 0.05), 0.0), material, 0);
                if on {
                    let position = center - Vec3::Z * 0.3;
                    draft.lamps.push(Lamp {
                        position,
                        colour: Vec3::new(1.0, 0.96, 0.9) * 1.5,
                        reach: 2.2 * spacing + 2.0,
                        by_day: true,
                    });
                }
            }
        }
    }

    /// Fills all four walls; `blank` is the share of places that stay empty, `change` the seed of
    /// what moves between visits and its share.
    pub(crate) fn furnish(
        &self,
        draft: &mut Draft,
        room: &Room,
        blank: f32,
        seed: Seed,
        change: (Seed, f32),
    ) {
        let Room { low, high } = *room;
        let walls = [
            (Vec3::new(low.x, low.y, low.z), Vec3::Y, Vec3::X, high.y - low.y),
            (Vec3::new(high.x, low.y, low.z), Vec3::Y, -Vec3::X, high.y - low.y),
            (Vec3::new(low.x, low.y, low.z), Vec3::X, Vec3::Y, high.x - low.x),
            (Vec3::new(low.x, high.y, low.z), Vec3::X, -Vec3::Y, high.x - low.x),
        ];
        for (number, (corner, along, inward, length)) in (0..).zip(walls) {
            self.wall(draft, (corner, along, inward, length), blank, seed.at(number), change);
        }
    }

    /// Fills one wall from left to right.
    pub(crate) fn wall(
        &self,
        draft: &mut Draft,
        (corner, along, inward, length): (Vec3, Vec3, Vec3, f32),
        blank: f32,
        seed: Seed,
        (visit, changed): (Seed, f32),
    ) {
        let n = (length / 1.9).floor().max(1.0);
        for slot in 0..n as i64 {
            let mut own = seed.at(slot);
            if own.at(99).chance(changed) {
                own = visit.at(slot).at(i64::from(own.bits()));
            }
            let foot = corner + along * (length * (slot as f32 + 0.5) / n);
            let niche = Niche { foot, along, inward, width: length / n };
            if !own.at(98).chance(blank) {
                self.thing(draft, &niche, own);
            }
        }
    }

    fn thing(&self, draft: &mut Draft, niche: &Niche, seed: Seed) {
        let wood = self.wood[seed.at(1).index(3)];
        let plain = self.plain[seed.at(2).index(8)];
        let bits = seed.bits();
        let wide = (niche.width * 0.9).min(seed.at(3).range(0.9, 1.9));
        match seed.at(0).index(9) {
            0 => draft.add(
                niche.block(0.0, (0.0, 0.04), 0.95, (0.0, 2.1)),
                self.doors[seed.at(4).index(4)],
                bits,
            ),
            1 => draft.add(
                niche.block(0.0, (0.0, 0.35), wide, (0.0, seed.at(4).range(1.1, 2.2))),
                self.shelf[seed.at(5).index(2)],
                bits,
            ),
            2 => self.desk(draft, niche, (wide, wood, plain), seed),
            3 => self.window(draft, niche, wide, seed),
            4 => self.sofa(draft, niche, (wide, plain), seed),
            5 => {
                let high = seed.at(4).range(0.8, 1.9);
                draft.add(niche.block(0.0, (0.0, 0.5), wide * 0.7, (0.0, high)), plain, bits);
                let handle = niche.block(0.12, (0.5, 0.53), 0.03, (high * 0.5, high * 0.5 + 0.2));
                draft.add(handle, self.metal, bits);
            }
            6 => self.pot_plant(draft, niche, plain, seed),
            7 => {
                draft.add(niche.block(0.0, (0.0, 0.03), wide * 0.5, (1.3, 1.6)), self.sign, bits);
                self.hang(draft, niche, seed.named("beside"));
            }
            _ => self.hang(draft, niche, seed),
        }
    }

    /// A window to the outside with its sill, a radiator below it.
    fn window(&self, draft: &mut Draft, niche: &Niche, wide: f32, seed: Seed) {
        let bits = seed.bits();
        let z = seed.at(4).range(0.8, 1.0);
        let pane = niche.block(0.0, (0.0, 0.03), wide, (z, z + seed.at(5).range(1.0, 1.4)));
        draft.add(pane, self.outlook, bits);
        draft.add(niche.block(0.0, (0.0, 0.2), wide + 0.1, (z - 0.05, z)), self.white, bits);
        draft.add(niche.block(0.0, (0.02, 0.14), wide * 0.9, (0.15, 0.7)), self.white, bits);
    }

    /// A sofa below a picture.
    fn sofa(&self, draft: &mut Draft, niche: &Niche, (wide, plain): (f32, u32), seed: Seed) {
        let bits = seed.bits();
        draft.add(niche.block(0.0, (0.1, 0.9), wide, (0.12, 0.42)), plain, bits);
        draft.add(niche.block(0.0, (0.02, 0.25), wide, (0.4, 0.85)), plain, bits);
        for end in [-0.5, 0.5] {
            draft.add(niche.block(end * wide, (0.05, 0.9), 0.18, (0.1, 0.6)), plain, bits);
        }
        self.hang(draft, niche, seed.named("above"));
    }

    fn pot_plant(&self, draft: &mut Draft, niche: &Niche, plain: u32, seed: Seed) {
        let base = niche.foot + niche.inward * 0.4;
        let pot = Geometry::Pillar { base, height: 0.4, bottom: 0.16, top: 0.22 };
        draft.add(pot, plain, seed.bits());
        for part in 0..4 {
            let own = seed.at(20 + part);
            let shift = Vec3::new(
                own.at(0).range(-0.15, 0.15),
                own.at(1).range(-0.15, 0.15),
                own.at(2).range(0.6, 1.3),
            );
            let crown = Geometry::Ellipsoid {
                center: base + shift,
                radii: Vec3::splat(own.at(3).range(0.15, 0.32)),
                holes: 0.45,
                grain: 0.07,
                seed: own.bits(),
            };
            draft.add(crown, self.leaves, own.bits());
        }
    }

    /// A picture or two.
    fn hang(&self, draft: &mut Draft, niche: &Niche, seed: Seed) {
        let n = 1 + seed.at(10).index(2);
        for k in 0..n as i64 {
            let own = seed.at(11 + k);
            let size = Vec2::new(own.at(0).range(0.3, 0.9), own.at(1).range(0.3, 0.9));
            let shift = if n == 1 { 0.0 } else { (k as f32 - 0.5) * niche.width * 0.5 };
            let z = own.at(2).range(1.2, 1.5);
            draft.add(
                niche.block(shift, (0.0, 0.025), size.x, (z, z + size.y)),
                self.picture,
                own.bits(),
            );
        }
    }

    fn desk(
        &self,
        draft: &mut Draft,
        niche: &Niche,
        (wide, wood, plain): (f32, u32, u32),
        seed: Seed,
    ) {
        let bits = seed.bits();
        draft.add(niche.block(0.0, (0.0, 0.75), wide, (0.7, 0.74)), wood, bits);
        for end in [-0.47, 0.47] {
            draft.add(niche.block(end * wide, (0.03, 0.7), 0.04, (0.0, 0.7)), wood, bits);
        }
        let shift = seed.at(30).range(-0.25, 0.25);
        draft.add(niche.block(shift, (0.2, 0.24), 0.55, (0.84, 1.18)), self.black, bits);
        draft.add(niche.block(shift, (0.15, 0.3), 0.2, (0.74, 0.86)), self.black, bits);
        draft.add(
            niche.block(shift + 0.5, (0.2, 0.5), 0.2, (0.74, 0.74 + seed.at(31).range(0.03, 0.3))),
            plain,
            bits,
        );
        let seat = seed.at(32).range(0.7, 1.0);
        draft.add(niche.block(shift, (seat, seat + 0.42), 0.44, (0.42, 0.5)), plain, bits);
        draft.add(niche.block(shift, (seat + 0.4, seat + 0.45), 0.42, (0.5, 1.0)), plain, bits);
        let base = niche.foot + niche.along * shift + niche.inward * (seat + 0.2);
        draft.add(
            Geometry::Pillar { base, height: 0.42, bottom: 0.2, top: 0.03 },
            self.metal,
            bits,
        );
        self.hang(draft, niche, seed.named("above the desk"));
    }

    /// A table with things on it in the middle of a room.
    pub(crate) fn table(&self, draft: &mut Draft, center: Vec3, size: Vec2, seed: Seed) {
        let wood = self.wood[seed.at(1).index(3)];
        let top = Vec3::new(size.x, size.y, 0.05);
        draft.add(Geometry::block(center + Vec3::Z * 0.72, top, 0.0), wood, seed.bits());
        for (x, y) in [(-0.45, -0.45), (-0.45, 0.45), (0.45, -0.45), (0.45, 0.45)] {
            let base = center + Vec3::new(x * size.x, y * size.y, 0.0);
            draft.add(Geometry::Pillar { base, height: 0.7, bottom: 0.03, top: 0.04 }, wood, 0);
        }
        for thing in 0..9 {
            let own = seed.at(40 + thing);
            let at = center
                + Vec3::new(
                    own.at(0).range(-0.42, 0.42) * size.x,
                    own.at(1).range(-0.42, 0.42) * size.y,
                    0.745,
                );
            let material =
                if own.at(2).chance(0.3) { self.picture } else { self.plain[own.at(3).index(8)] };
            let r = own.at(4).range(0.04, 0.14);
            let high = own.at(5).range(0.03, 0.3);
            match own.at(6).index(3) {
                0 => draft.add(
                    Geometry::Pillar {
                        base: at,
                        height: high,
                        bottom: r,
                        top: r * own.at(7).range(0.3, 1.0),
                    },
                    material,
                    own.bits(),
                ),
                1 => draft.add(
                    Geometry::ball(at + Vec3::Z * r, Vec3::splat(r)),
                    material,
                    own.bits(),
                ),
                _ => draft.add(
                    Geometry::block(
                        at + Vec3::Z * (0.5 * high),
                        Vec3::new(2.0 * r, 1.4 * r, high),
                        own.at(8).range(0.0, 3.0),
                    ),
                    material,
                    own.bits(),
                ),
            }
        }
    }
}
