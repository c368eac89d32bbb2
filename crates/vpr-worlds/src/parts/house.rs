//! Houses: a facade, a roof, and what sticks out of them.

use glam::{Vec2, Vec3};

use crate::{
    geometry::Geometry,
    material::{Colour, Facade, Front, Material, Opening, Wall, hue, rgb},
    scene::Draft,
    seed::Seed,
};

/// The shape of a roof.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Roof {
    Flat,
    /// Ridge along the street.
    Saddle,
    /// Gable towards the street.
    Gable,
    Hip,
}

/// How the houses of one kind look; a city has a few kinds.
#[derive(Clone, Debug)]
pub(crate) struct Style {
    facade: Facade,
    roof: Roof,
    tiles: Colour,
    floors: (usize, usize),
    cornice: bool,
    balconies: bool,
    bay_window: bool,
    shops: f32,
}

/// The ground a house stands on: its front runs along y.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lot {
    /// x of the front.
    pub(crate) front: f32,
    /// Lowest and highest y.
    pub(crate) span: (f32, f32),
    /// How far the house reaches back.
    pub(crate) depth: f32,
    /// +1 if the house looks towards +x, -1 if towards -x.
    pub(crate) side: f32,
    /// Height of the sidewalk.
    pub(crate) level: f32,
}

impl Lot {
    /// The block from `out` metres before the front to `back` behind it, between two heights, and
    /// with `margin` left at both neighbours.
    fn block(&self, out: f32, back: f32, low: f32, high: f32, margin: f32) -> Geometry {
        let (a, b) = (self.front + self.side * out, self.front - self.side * back);
        Geometry::span(
            Vec3::new(a.min(b), self.span.0 + margin, self.level + low),
            Vec3::new(a.max(b), self.span.1 - margin, self.level + high),
        )
    }

    fn width(&self) -> f32 {
        self.span.1 - self.span.0
    }

    fn at(&self, out: f32, along: f32, z: f32) -> Vec3 {
        Vec3::new(self.front + self.side * out, self.span.0 + along, self.level + z)
    }
}

impl Style {
    /// A kind of house for a city with this seed.
    pub(crate) fn new(seed: Seed) -> Self {
        let wall = seed.at(0).pick(&[
            Wall::Brick,
            Wall::Brick,
            Wall::Plaster,
            Wall::Plaster,
            Wall::Stone,
            Wall::Concrete,
            Wall::Clapboard,
        ]);
        let floor = seed.at(3).range(2.8, 3.7);
        let opening = opening(wall, floor, seed);
        let trim = if seed.at(11).chance(0.7) {
            rgb(214, 206, 190)
        } else {
            wall_colour(wall, seed.at(12)) * 0.6
        };
        let frame = if seed.at(13).chance(0.7) {
            rgb(228, 226, 220)
        } else {
            hue(seed.at(14).unit(), 0.5, 0.3)
        };
        let facade = Facade {
            wall,
            colour: wall_colour(wall, seed.at(15)),
            trim,
            frame,
            floor,
            ground: seed.at(16).range(3.3, 4.3),
            bay: seed.at(17).range(1.9, 3.6),
            opening,
            front: Front::Home { door: rgb(80, 40, 30) },
            face: 0,
            bands: seed.at(18).chance(0.35),
            quoins: seed.at(19).chance(0.25),
        };
        let low = 1 + seed.at(20).index(3);
        Self {
            facade,
            roof: seed.at(21).pick(&[Roof::Flat, Roof::Flat, Roof::Saddle, Roof::Gable, Roof::Hip]),
            tiles: seed.at(22).pick(&[
                rgb(140, 72, 52),
                rgb(88, 84, 86),
                rgb(112, 92, 76),
                rgb(70, 76, 88),
            ]),
            floors: (low, low + 1 + seed.at(23).index(3)),
            cornice: seed.at(24).chance(0.6),
            balconies: seed.at(25).chance(0.25),
            bay_window: seed.at(26).chance(0.22),
            shops: seed.at(27).range(0.1, 0.8),
        }
    }
}

/// The windows of a kind of house.
fn opening(wall: Wall, floor: f32, seed: Seed) -> Opening {
    let tall = seed.at(1).chance(0.5);
    let share = if tall { seed.at(2).range(0.32, 0.5) } else { seed.at(2).range(0.45, 0.78) };
    let sill = if tall { seed.at(4).range(0.3, 0.7) } else { seed.at(4).range(0.8, 1.0) };
    Opening {
        share,
        sill,
        height: floor - sill - seed.at(5).range(0.45, 0.8),
        arched: wall != Wall::Concrete && seed.at(6).chance(0.18),
        panes: seed.at(7).pick(&[(1, 1), (2, 1), (2, 2), (2, 3), (3, 2), (1, 2)]),
        shutters: seed.at(8).chance(0.25).then(|| hue(seed.at(9).unit(), 0.5, 0.45)),
        inset: seed.at(10).range(0.08, 0.28),
    }
}

fn wall_colour(wall: Wall, seed: Seed) -> Colour {
    match wall {
        Wall::Brick => seed.at(0).pick(&[
            rgb(150, 82, 62),
            rgb(128, 66, 52),
            rgb(176, 128, 88),
            rgb(110, 74, 64),
            rgb(190, 160, 120),
        ]),
        Wall::Plaster => hue(
            seed.at(0).range(0.0, 0.2),
            seed.at(1).range(0.05, 0.4),
            seed.at(2).range(0.65, 0.95),
        ),
        Wall::Stone => rgb(176, 166, 148) * seed.at(0).range(0.7, 1.15),
        Wall::Concrete => rgb(150, 150, 148) * seed.at(0).range(0.6, 1.15),
        Wall::Clapboard => {
            hue(seed.at(0).unit(), seed.at(1).range(0.03, 0.22), seed.at(2).range(0.6, 0.95))
        }
    }
}

/// Builds one house; `look` decides everything that lasts, `shop` who keeps shop at the moment.
pub(crate) fn house(draft: &mut Draft, lot: &Lot, style: &Style, look: Seed, shop: Seed) {
    let mut facade = style.facade.clone();
    facade.face = u8::from(lot.side <= 0.0);
    facade.colour = (facade.colour * look.at(0).range(0.8, 1.2))
        .lerp(wall_colour(facade.wall, look.at(1)), 0.45);
    facade.bay *= look.at(2).range(0.85, 1.2);
    if look.at(3).chance(0.3) {
        facade.opening.shutters = Some(hue(look.at(4).unit(), 0.45, 0.4));
    }
    let is_shop = look.at(5).chance(style.shops);
    facade.front = if is_shop {
        let ground =
            hue(shop.at(1).unit(), shop.at(2).range(0.2, 0.8), shop.at(3).range(0.15, 0.6));
        let ink = if shop.at(4).chance(0.6) {
            rgb(240, 236, 220)
        } else {
            hue(shop.at(5).unit(), 0.7, 0.9)
        };
        Front::Shop { ground, ink, shop: shop.bits() }
    } else if look.at(6).chance(0.15) {
        Front::Garage { colour: hue(look.at(7).unit(), 0.3, 0.5) }
    } else {
        Front::Home { door: hue(look.at(8).unit(), 0.6, look.at(9).range(0.2, 0.55)) }
    };
    let n_floors = style.floors.0 + look.at(10).index(style.floors.1 - style.floors.0 + 1);
    let eaves = facade.ground + facade.floor * n_floors as f32 + 0.25;
    let trim = draft.material(Material::Wall { kind: Wall::Plaster, colour: facade.trim });
    let (floor, ground) = (facade.floor, facade.ground);
    let jut = style.bay_window && look.at(11).chance(0.7);
    let front = draft.material(Material::Facade(Box::new(facade.clone())));
    draft.add(lot.block(0.0, lot.depth, 0.0, eaves, 0.0), front, look.bits());
    roof(draft, lot, style, &facade, eaves, look);
    if style.cornice {
        draft.add(lot.block(0.35, 0.1, eaves - 0.35, eaves, 0.0), trim, look.at(12).bits());
        draft.add(lot.block(0.15, 0.1, eaves - 0.6, eaves - 0.35, 0.0), trim, look.at(12).bits());
    }
    if is_shop && shop.at(6).chance(0.5) {
        awning(draft, lot, ground, shop);
    }
    if jut && n_floors > 0 {
        let middle = lot.span.0 + lot.width() * look.at(13).range(0.3, 0.7);
        let narrow = Lot { span: (middle - 1.3, middle + 1.3), ..*lot };
        let bay = Facade {
            bay: 2.6,
            opening: Opening { share: 0.8, ..facade.opening },
            face: 255,
            ..facade
        };
        let bay = draft.material(Material::Facade(Box::new(bay)));
        // Its lower edge is where the ground floor would end: windows line up with the house's.
        let block = narrow.block(0.9, 0.1, ground - 0.05, eaves - 0.6, 0.0);
        draft.add(block, bay, look.at(14).bits() & !1);
    } else if style.balconies {
        balconies(draft, lot, (ground, floor, n_floors), look);
    }
}

fn balconies(
    draft: &mut Draft,
    lot: &Lot,
    (ground, floor, n_floors): (f32, f32, usize),
    look: Seed,
) {
    let slab = draft.material(Material::Plain { colour: rgb(150, 146, 140), gloss: 0.0 });
    let rail =
        draft.material(Material::Plain { colour: hue(look.at(30).unit(), 0.3, 0.3), gloss: 0.1 });
    let margin = lot.width() * look.at(31).range(0.1, 0.32);
    for level in 0..n_floors {
        let z = ground + floor * level as f32;
        draft.add(lot.block(1.1, 0.0, z - 0.12, z + 0.03, margin), slab, look.bits());
        if look.at(32).chance(0.4) {
            draft.add(lot.block(1.1, -1.05, z, z + 0.95, margin), rail, look.bits());
        } else {
            draft.add(lot.block(1.1, -1.06, z + 0.9, z + 0.96, margin), rail, look.bits());
            let n = (lot.width() - 2.0 * margin) / 0.45;
            for post in 0..=n as usize {
                let foot = lot.at(1.08, margin + post as f32 * 0.45, z);
                draft.add(
                    Geometry::Pillar { base: foot, height: 0.92, bottom: 0.025, top: 0.025 },
                    rail,
                    0,
                );
            }
        }
    }
}

fn awning(draft: &mut Draft, lot: &Lot, ground: f32, shop: Seed) {
    let first = hue(shop.at(7).unit(), 0.7, 0.6);
    let cloth = draft.material(Material::Cloth {
        colour: first,
        other: rgb(235, 232, 225),
        size: shop.at(8).range(0.3, 0.8),
    });
    let width = lot.width() - 0.6;
    let corner = lot.at(0.02, 0.3, ground - 0.85);
    let v = Vec3::new(lot.side * 1.4, 0.0, -0.6);
    draft.add(
        Geometry::Patch { corner, u: Vec3::new(0.0, width, 0.0), v },
        cloth,
        shop.at(9).bits(),
    );
}

fn roof(draft: &mut Draft, lot: &Lot, style: &Style, facade: &Facade, eaves: f32, look: Seed) {
    let tiles = draft.material(Material::Tiles {
        colour: style.tiles * look.at(40).range(0.8, 1.25),
        size: 0.32,
    });
    let gable = draft.material(Material::Wall { kind: facade.wall, colour: facade.colour });
    let rise = look.at(41).range(0.35, 0.65);
    let mut slopes = Slopes { draft, lot, eaves, tiles, gable, seed: look.at(42).bits() };
    let top = match style.roof {
        Roof::Saddle => slopes.saddle(rise),
        Roof::Gable => slopes.gable(rise + 0.25),
        Roof::Hip => slopes.hip(rise),
        Roof::Flat => {
            let parapet = lot.block(0.0, 0.3, eaves, eaves + 0.5, 0.0);
            draft.add(parapet, gable, look.at(43).bits());
            0.4
        }
    };
    chimneys(draft, lot, eaves, top, gable, look);
}

/// The surfaces of a roof in the making; all give the height of the ridge above the eaves.
struct Slopes<'a> {
    draft: &'a mut Draft,
    lot: &'a Lot,
    eaves: f32,
    tiles: u32,
    gable: u32,
    seed: u32,
}

impl Slopes<'_> {
    /// A point before the front, along it, and above the eaves.
    fn corner(&self, out: f32, along: f32, z: f32) -> Vec3 {
        self.lot.at(out, along, self.eaves + z)
    }

    /// A triangle whose corners run around it as seen from outside.
    fn three(&mut self, corners: [Vec3; 3], material: u32) {
        let [first, second, third] = corners;
        self.draft.add(Geometry::triangle(first, second, third), material, self.seed);
    }

    /// Four corners likewise, tiled.
    fn four(&mut self, corners: [Vec3; 4]) {
        let [first, second, third, fourth] = corners;
        self.three([first, second, third], self.tiles);
        self.three([first, third, fourth], self.tiles);
    }

    fn saddle(&mut self, rise: f32) -> f32 {
        let (w, d) = (self.lot.width(), self.lot.depth);
        let z = rise * 0.5 * d;
        let ridge = [self.corner(-0.5 * d, 0.0, z), self.corner(-0.5 * d, w, z)];
        for out in [0.3, -d - 0.3] {
            let eave = [self.corner(out, 0.0, -0.2), self.corner(out, w, -0.2)];
            self.four([eave[0], eave[1], ridge[1], ridge[0]]);
        }
        for (along, peak) in [(0.0, ridge[0]), (w, ridge[1])] {
            let foot = [self.corner(0.0, along, 0.0), self.corner(-d, along, 0.0)];
            self.three([foot[0], foot[1], peak], self.gable);
        }
        z
    }

    fn gable(&mut self, rise: f32) -> f32 {
        let (w, d) = (self.lot.width(), self.lot.depth);
        let z = rise * 0.5 * w;
        let ridge = [self.corner(0.0, 0.5 * w, z), self.corner(-d, 0.5 * w, z)];
        let peak = self.corner(0.2, 0.5 * w, z);
        for along in [0.0, w] {
            let eave = [self.corner(0.2, along, -0.1), self.corner(-d, along, -0.1)];
            self.four([eave[0], eave[1], ridge[1], peak]);
        }
        for (out, peak) in [(0.0, ridge[0]), (-d, ridge[1])] {
            let foot = [self.corner(out, 0.0, 0.0), self.corner(out, w, 0.0)];
            self.three([foot[0], foot[1], peak], self.gable);
        }
        z
    }

    fn hip(&mut self, rise: f32) -> f32 {
        let (w, d) = (self.lot.width(), self.lot.depth);
        let z = rise * 0.5 * d.min(w);
        let inset = 0.5 * d.min(w);
        let ridge = [self.corner(-0.5 * d, inset, z), self.corner(-0.5 * d, w - inset, z)];
        let front = [self.corner(0.3, -0.2, -0.1), self.corner(0.3, w + 0.2, -0.1)];
        self.four([front[0], front[1], ridge[1], ridge[0]]);
        let back = [self.corner(-d, 0.0, 0.0), self.corner(-d, w, 0.0)];
        self.four([back[0], back[1], ridge[1], ridge[0]]);
        for (along, peak) in [(0.0, ridge[0]), (w, ridge[1])] {
            let foot = [self.corner(0.0, along, 0.0), self.corner(-d, along, 0.0)];
            self.three([foot[0], foot[1], peak], self.tiles);
        }
        z
    }
}

fn chimneys(draft: &mut Draft, lot: &Lot, eaves: f32, top: f32, wall: u32, look: Seed) {
    for number in 0..look.at(50).index(3) as i64 {
        let own = look.at(51 + number);
        let size = Vec2::new(own.at(0).range(0.4, 1.6), own.at(1).range(0.4, 1.2));
        let foot = lot.at(
            -lot.depth * own.at(2).range(0.2, 0.7),
            lot.width() * own.at(3).range(0.1, 0.9),
            eaves,
        );
        let high = top + own.at(4).range(0.6, 1.4);
        let low = foot - Vec3::new(0.5 * size.x, 0.5 * size.y, 0.0);
        draft.add(Geometry::span(low, low + Vec3::new(size.x, size.y, high)), wall, own.bits());
    }
}
