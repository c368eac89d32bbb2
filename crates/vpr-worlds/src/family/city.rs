//! City blocks along avenues: houses, shops, trees, cars, people.

use glam::{Vec2, Vec3};

use crate::{
    geometry::Geometry,
    material::{Material, Roads, rgb},
    parts::{Grove, Lot, Species, StreetKit, Style, house},
    recipe::Street,
    scene::{Draft, Scene},
    seed::Seed,
    traverse::Traverse,
};

/// Distance between avenues, metres.
pub(super) const AVENUES: f32 = 68.0;
const SIDEWALK: f32 = 3.2;
const KERB: f32 = 0.13;
/// Blocks beyond the route on all sides.
const MARGIN: i64 = 2;

/// What lasts in a city, whoever drives through it.
pub(super) struct City<'a> {
    street: &'a Street,
    avenues: i64,
    blocks: i64,
    /// Blocks along an avenue until the look repeats.
    cycle: i64,
    styles: Vec<Style>,
    seed: Seed,
}

impl<'a> City<'a> {
    pub(super) fn new(street: &'a Street, places: usize, seed: Seed) -> Self {
        let per_avenue = street.per_avenue(places);
        let length = per_avenue as f64 * street.spacing_m;
        let blocks = (length / street.block_m).ceil() as i64;
        let cycle = (blocks / street.look_alikes as i64).max(1);
        let styles =
            (0..street.styles as i64).map(|k| Style::new(seed.named("style").at(k))).collect();
        Self { street, avenues: street.avenues as i64 + 1, blocks, cycle, styles, seed }
    }

    /// Goes on as far as this avenue, if it did not yet.
    pub(super) fn reach(&mut self, avenue: i64) {
        self.avenues = self.avenues.max(avenue + 1 - MARGIN);
    }

    fn period(&self) -> Vec2 {
        Vec2::new(AVENUES, self.street.block_m as f32)
    }

    /// The seed of a thing in a block: its own, or the one that all look-alikes share.
    fn look(&self, avenue: i64, block: i64, thing: i64) -> Seed {
        let own = self.seed.named("look").at(avenue).at(block).at(thing);
        let repeats =
            self.street.look_alikes > 1 && own.named("repeats").chance(self.street.aliasing as f32);
        if !repeats {
            return own;
        }
        self.seed.named("look").at(avenue).at(block.rem_euclid(self.cycle)).at(thing)
    }

    /// Blocks before and after the route: look-alikes must not be told apart by the city's end.
    fn beyond(&self) -> i64 {
        if self.street.look_alikes > 1 { 6 } else { MARGIN }
    }

    /// The city as the traverse with this number finds it, and what stands in front of cameras.
    pub(super) fn build(&self, traverse: &Traverse, number: i64) -> (Scene, StreetKit) {
        let mut draft = Draft::default();
        let kit = StreetKit::new(&mut draft, self.seed.named("kit"));
        let grove =
            Grove::new(&mut draft, self.seed.named("grove"), traverse.condition.bare as f32);
        let (period, road) = (self.period(), 0.5 * self.street.road_m as f32);
        let roads = draft.material(Material::Roads(Roads { period, half_width: road }));
        let pavement = draft.material(Material::Pavement { colour: rgb(150, 147, 140) });
        let meadow = draft.material(Material::Meadow { colour: rgb(86, 112, 52) });
        let far = Vec3::new(-3_000.0, -3_000.0, -0.06);
        let plain = Geometry::Patch { corner: far, u: Vec3::X * 6_500.0, v: Vec3::Y * 6_500.0 };
        draft.add(plain, meadow, 1);
        let builder =
            Block { city: self, kit: &kit, grove: &grove, traverse, number, pavement, meadow };
        for avenue in -MARGIN..self.avenues + MARGIN {
            for block in -self.beyond()..self.blocks + self.beyond() {
                let corner = Vec2::new(avenue as f32, block as f32) * period;
                let low = (corner - Vec2::splat(road + 30.0)).extend(0.0);
                let road =
                    Geometry::Patch { corner: low, u: Vec3::X * period.x, v: Vec3::Y * period.y };
                draft.add(road, roads, self.look(avenue, block, 0).bits());
                builder.build(&mut draft, avenue, block);
            }
        }
        (Scene::new(draft), kit)
    }
}

/// Builds the block to the north-east of a crossing.
struct Block<'a> {
    city: &'a City<'a>,
    kit: &'a StreetKit,
    grove: &'a Grove,
    traverse: &'a Traverse,
    number: i64,
    pavement: u32,
    meadow: u32,
}

impl Block<'_> {
    fn build(&self, draft: &mut Draft, avenue: i64, block: i64) {
        let (period, road) =
            (self.city.period(), Vec2::splat(0.5 * self.city.street.road_m as f32));
        let corner = Vec2::new(avenue as f32, block as f32) * period;
        let low = (corner + road).extend(-0.2);
        let high = (corner + period - road).extend(KERB);
        draft.add(
            Geometry::span(low, high),
            self.pavement,
            self.city.look(avenue, block, 1).bits(),
        );
        let inner_low = low + Vec3::new(SIDEWALK, SIDEWALK, 0.0);
        let inner_high = high - Vec3::new(SIDEWALK, SIDEWALK, -0.02);
        draft.add(
            Geometry::span(inner_low, inner_high),
            self.meadow,
            self.city.look(avenue, block, 2).bits(),
        );
        for (side, front) in [(-1.0, inner_low.x), (1.0, inner_high.x)] {
            self.row(draft, (avenue, block), side, front, (inner_low.y, inner_high.y));
            let kerb = if side < 0.0 { low.x } else { high.x };
            self.kerb(draft, (avenue, block), side, kerb, (low.y, high.y));
        }
        let yard = self.city.look(avenue, block, 3);
        for tree in 0..5 {
            let own = yard.at(tree);
            let foot = Vec3::new(
                own.at(0).range(inner_low.x + 16.0, inner_high.x - 16.0),
                own.at(1).range(inner_low.y + 3.0, inner_high.y - 3.0),
                KERB,
            );
            self.grove.plant(
                draft,
                own.at(2).pick(&[Species::Broad, Species::Conifer]),
                foot,
                own.at(3).range(6.0, 12.0),
                own,
            );
        }
    }

    /// One side of a block: lot after lot.
    fn row(
        &self,
        draft: &mut Draft,
        (avenue, block): (i64, i64),
        side: f32,
        front: f32,
        span: (f32, f32),
    ) {
        let key = if side < 0.0 { 100 } else { 200 };
        let cut = self.city.look(avenue, block, key);
        let n_lots = 5 + cut.at(0).index(3) as i64;
        let mut edge = span.0;
        for lot in 0..n_lots {
            let even = (span.1 - span.0) / n_lots as f32;
            let end = if lot + 1 == n_lots {
                span.1
            } else {
                span.0 + even * (lot as f32 + 1.0 + cut.at(lot + 1).range(-0.28, 0.28))
            };
            let look = self.city.look(avenue, block, key + 1 + lot);
            let ground = Lot {
                front,
                span: (edge, end),
                depth: look.at(60).range(10.0, 15.0),
                side,
                level: KERB,
            };
            edge = end;
            if look.at(61).chance(0.1) {
                self.garden(draft, &ground, look);
                continue;
            }
            let style = &self.city.styles[look.at(62).index(self.city.styles.len())];
            let changed = look.at(63).chance(self.traverse.condition.changed as f32);
            let shop = look.named("shop").at(if changed { self.number } else { 0 });
            house(draft, &ground, style, look, shop);
        }
    }

    /// A lot without a house: hedge or wall, trees.
    fn garden(&self, draft: &mut Draft, lot: &Lot, look: Seed) {
        let (a, b) = (lot.front, lot.front - lot.side * 0.35);
        let low = Vec3::new(a.min(b), lot.span.0, KERB);
        let high = Vec3::new(a.max(b), lot.span.1, KERB + look.at(1).range(0.7, 2.0));
        draft.add(Geometry::span(low, high), self.pavement, look.bits());
        for tree in 0..4 {
            let own = look.at(10 + tree);
            let foot = Vec3::new(
                lot.front - lot.side * own.at(0).range(1.0, 9.0),
                own.at(1).range(lot.span.0, lot.span.1),
                KERB,
            );
            let species =
                own.at(2).pick(&[Species::Broad, Species::Conifer, Species::Poplar, Species::Bush]);
            let height = if species == Species::Bush { 2.0 } else { own.at(3).range(4.0, 11.0) };
            self.grove.plant(draft, species, foot, height, own);
        }
    }

    /// Trees, lamps, signs, parked cars and people along one kerb.
    fn kerb(
        &self,
        draft: &mut Draft,
        (avenue, block): (i64, i64),
        side: f32,
        kerb: f32,
        span: (f32, f32),
    ) {
        let key = if side < 0.0 { 300 } else { 400 };
        let n_slots = ((span.1 - span.0 - 8.0) / 5.5) as i64;
        let inward = Vec2::new(-side, 0.0);
        for slot in 0..n_slots {
            let look = self.city.look(avenue, block, key + slot);
            let foot = Vec3::new(kerb + inward.x * 0.7, span.0 + 5.0 + 5.5 * slot as f32, KERB);
            if slot % 4 == 1 {
                self.kit.lamp(draft, foot, -inward * 1.6, look);
            } else if look.at(0).chance(self.city.street.trees as f32) {
                let species = look.at(1).pick(&[Species::Broad, Species::Broad, Species::Poplar]);
                let shift = Vec3::Y * look.at(2).range(-1.2, 1.2);
                self.grove.plant(draft, species, foot + shift, look.at(3).range(4.5, 9.5), look);
            } else if look.at(4).chance(0.3) {
                self.kit.sign(draft, foot, look.at(5).pick(&[0.0, 1.571, 0.4]), look);
            } else if look.at(6).chance(0.5) {
                self.kit.small_thing(draft, foot, look);
            }
            let now =
                self.city.seed.named("traffic").at(self.number).at(avenue).at(block).at(key + slot);
            let traffic = self.traverse.condition.traffic as f32;
            if now.at(0).chance(traffic) && slot > 0 {
                let at =
                    Vec3::new(kerb - inward.x * 1.05, foot.y + now.at(1).range(-0.5, 0.5), 0.0);
                let angle = std::f32::consts::FRAC_PI_2 * if side < 0.0 { -1.0 } else { 1.0 };
                self.kit.car(draft, at, angle, now);
            }
            if now.at(3).chance(0.3 * traffic) {
                let at = Vec3::new(
                    kerb + inward.x * now.at(4).range(1.0, 2.8),
                    foot.y + now.at(5).range(-2.5, 2.5),
                    KERB,
                );
                self.kit.person(draft, at, now.at(6));
            }
        }
    }
}
