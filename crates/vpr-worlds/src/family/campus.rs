//! A footpath between buildings, lawns and trees, walked left and right of its middle.

use glam::{Vec2, Vec3};

use super::{Plan, level_pose, two_traverses};
use crate::{
    geometry::Geometry,
    light::Light,
    material::{Facade, Front, Material, Opening, Wall, hue, rgb},
    parts::{Grove, OUTDOORS, Species, StreetKit, hide_behind},
    recipe::{Campus, Recipe},
    scene::{Draft, Lamp, Scene},
    seed::Seed,
    traverse::Traverse,
};

/// Length of a stretch of path with one thing on each side.
const STRETCH: f32 = 22.0;

impl Campus {
    pub(crate) fn plan(&self, recipe: &Recipe, seed: Seed) -> Plan {
        let steps = recipe.steps(self.spacing_m);
        let n = steps.last().map_or(0, |last| last + 1);
        let route: Vec<_> = steps
            .into_iter()
            .map(|place| {
                let y = (place as f64 * self.spacing_m) as f32 + 4.0;
                level_pose(Vec3::new(0.0, y, self.eye_m as f32), std::f64::consts::FRAC_PI_2)
            })
            .collect();
        let length = n as f32 * self.spacing_m as f32;
        let walk = Walk { campus: self, length, seed };
        let (first, _) = walk.build(&recipe.references, 0);
        let (second, kit) = walk.build(&recipe.queries, 1);
        let lights = vec![
            Light::new(&recipe.references.condition, seed.named("first light")),
            Light::new(&recipe.queries.condition, seed.named("second light")),
        ];
        let share = recipe.queries.condition.occlusion;
        let (references, queries) = two_traverses(recipe, &route, seed, |pose, own| {
            hide_behind(&kit, (pose, &recipe.camera), share, OUTDOORS, own)
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
}

struct Walk<'a> {
    campus: &'a Campus,
    length: f32,
    seed: Seed,
}

/// Shared materials of a campus.
struct Ground {
    slabs: u32,
    concrete: u32,
    glass_roof: u32,
    poster: u32,
}

impl Walk<'_> {
    fn build(&self, traverse: &Traverse, number: i64) -> (Scene, StreetKit) {
        let mut draft = Draft::default();
        let kit = StreetKit::new(&mut draft, self.seed.named("kit"));
        let grove =
            Grove::new(&mut draft, self.seed.named("grove"), traverse.condition.bare as f32);
        let lawn = draft.material(Material::Meadow { colour: rgb(84, 120, 54) });
        let ground = Ground {
            slabs: draft.material(Material::Pavement { colour: rgb(168, 160, 148) }),
            concrete: draft
                .material(Material::Wall { kind: Wall::Concrete, colour: rgb(168, 166, 160) }),
            glass_roof: draft.material(Material::Plain { colour: rgb(150, 158, 160), gloss: 0.2 }),
            poster: draft.material(Material::Picture),
        };
        let far = Vec3::new(-3_000.0, -3_000.0, -0.05);
        draft.add(
            Geometry::Patch { corner: far, u: Vec3::X * 6_000.0, v: Vec3::Y * 6_600.0 },
            lawn,
            3,
        );
        let half = 0.5 * self.campus.path_m as f32;
        let n = (self.length / STRETCH).ceil() as i64 + 6;
        for stretch in -1..n {
            let look = self.seed.named("stretch").at(stretch);
            let y = stretch as f32 * STRETCH;
            let corner = Vec3::new(-half, y, 0.0);
            draft.add(
                Geometry::Patch { corner, u: Vec3::X * 2.0 * half, v: Vec3::Y * STRETCH },
                ground.slabs,
                look.bits(),
            );
            for side in [-1.0, 1.0] {
                let own = look.at(if side < 0.0 { 1 } else { 2 });
                if own.at(0).chance(0.62) {
                    self.building(&mut draft, &ground, side, y, own);
                } else {
                    garden(&mut draft, &grove, &kit, (side, half, y), own);
                }
                if own.at(40).chance(0.5) {
                    let foot = Vec3::new(side * (half + 0.4), y + own.at(41).range(2.0, 18.0), 0.0);
                    kit.small_thing(&mut draft, foot, own.at(42));
                }
            }
            if look.at(3).chance(self.campus.arcades as f32) {
                arcade(&mut draft, &ground, half, y, look);
            } else {
                let side = if stretch % 2 == 0 { -1.0 } else { 1.0 };
                let foot = Vec3::new(side * (half + 0.3), y + 3.0, 0.0);
                kit.lamp(&mut draft, foot, Vec2::new(-side * 0.8, 0.0), look.at(4));
            }
            let now = self.seed.named("people").at(number).at(stretch);
            people(&mut draft, &kit, (half, y), traverse, now);
        }
        (Scene::new(draft), kit)
    }

    fn building(&self, draft: &mut Draft, ground: &Ground, side: f32, y: f32, own: Seed) {
        let model = if own.at(1).chance(self.campus.aliasing as f32) {
            self.seed.named("model").at(own.at(2).index(2) as i64)
        } else {
            own.named("model")
        };
        let facade = front(model, own.at(12).bits());
        let (floor, n_floors) = (facade.floor, 1 + model.at(2).index(5));
        let facade = draft.material(Material::Facade(Box::new(facade)));
        let away = 0.5 * self.campus.path_m as f32 + own.at(20).range(0.6, 9.0);
        let (near, far) = (side * away, side * (away + 16.0));
        let high = 4.2 + floor * n_floors as f32;
        let gap = own.at(21).range(0.0, 3.0);
        let low = Vec3::new(near.min(far), y + gap, -0.1);
        draft.add(
            Geometry::span(low, Vec3::new(near.max(far), y + STRETCH - 0.5, high)),
            facade,
            model.at(22).bits(),
        );
        if model.at(23).chance(0.5) {
            // A ledge or a canopy over the door.
            let out = side * (away - model.at(24).range(0.5, 1.8));
            let z = model.at(25).range(3.0, 4.0);
            let low = Vec3::new(out.min(near), y + gap + 2.0, z);
            draft.add(
                Geometry::span(low, Vec3::new(out.max(near), y + STRETCH - 2.5, z + 0.3)),
                ground.concrete,
                own.bits(),
            );
        }
        if own.at(26).chance(0.6) {
            panels(draft, ground, (near - side * 0.06, y), own);
        }
    }
}

/// Posters and boards along a front.
fn panels(draft: &mut Draft, ground: &Ground, (x, y): (f32, f32), own: Seed) {
    for panel in 0..=own.at(27).index(3) as i64 {
        let at = Vec3::new(x, y + 4.0 + 4.5 * panel as f32, own.at(28).range(1.5, 2.0));
        let sheet = Vec3::new(0.05, own.at(29).range(0.8, 2.0), own.at(30).range(0.8, 1.6));
        draft.add(Geometry::block(at, sheet, 0.0), ground.poster, own.at(31 + panel).bits());
    }
}

/// How a building of this model looks; `shop` names the shop, if it has one.
fn front(model: Seed, shop: u32) -> Facade {
    let wall = model.at(0).pick(&[
        Wall::Brick,
        Wall::Concrete,
        Wall::Concrete,
        Wall::Plaster,
        Wall::Stone,
    ]);
    let floor = model.at(1).range(3.2, 4.0);
    let opening = Opening {
        share: model.at(3).range(0.5, 0.95),
        sill: model.at(4).range(0.5, 1.1),
        height: model.at(5).range(1.4, 2.1),
        arched: false,
        panes: model.at(6).pick(&[(1, 1), (2, 1), (3, 1), (4, 2)]),
        shutters: None,
        inset: model.at(7).range(0.1, 0.35),
    };
    let colour = if wall == Wall::Brick {
        rgb(156, 92, 70)
    } else {
        hue(
            model.at(8).range(0.02, 0.16),
            model.at(9).range(0.0, 0.25),
            model.at(10).range(0.6, 0.9),
        )
    };
    let front = if model.at(11).chance(0.4) {
        Front::Shop { ground: hue(model.at(13).unit(), 0.4, 0.35), ink: rgb(240, 240, 230), shop }
    } else {
        Front::Home { door: hue(model.at(14).unit(), 0.5, 0.4) }
    };
    let trim = hue(model.at(15).unit(), 0.15, 0.7);
    Facade {
        wall,
        colour,
        trim,
        frame: Vec3::splat(model.at(16).range(0.02, 0.7)),
        floor,
        ground: 4.0,
        bay: model.at(17).range(2.4, 5.0),
        opening,
        front,
        face: 255,
        bands: model.at(18).chance(0.6),
        quoins: false,
    }
}

/// Up to three people on a stretch of the path.
fn people(
    draft: &mut Draft,
    kit: &StreetKit,
    (half, y): (f32, f32),
    traverse: &Traverse,
    seed: Seed,
) {
    for person in 0..3 {
        let now = seed.at(person);
        if now.at(0).chance(0.6 * traverse.condition.traffic as f32) {
            let across = now.at(1).range(-half, half);
            let at = Vec3::new(across, y + now.at(2).range(0.0, STRETCH), 0.0);
            kit.person(draft, at, now.at(3));
        }
    }
}

fn garden(
    draft: &mut Draft,
    grove: &Grove,
    kit: &StreetKit,
    (side, half, y): (f32, f32, f32),
    own: Seed,
) {
    for plant in 0..5 {
        let tree = own.at(50 + plant);
        let foot = Vec3::new(
            side * (half + tree.at(0).range(1.2, 14.0)),
            y + tree.at(1).range(0.0, STRETCH),
            0.0,
        );
        let species = tree.at(2).pick(&[
            Species::Broad,
            Species::Bush,
            Species::Poplar,
            Species::Broad,
            Species::Conifer,
        ]);
        let height = if species == Species::Bush {
            tree.at(3).range(0.9, 1.8)
        } else {
            tree.at(3).range(4.0, 10.0)
        };
        grove.plant(draft, species, foot, height, tree);
    }
    if own.at(60).chance(0.4) {
        kit.sign(draft, Vec3::new(side * (half + 0.5), y + 9.0, 0.0), -1.571, own.at(61));
    }
}

/// Columns and a roof over the path, with lamps that burn at night.
fn arcade(draft: &mut Draft, ground: &Ground, half: f32, y: f32, look: Seed) {
    let high = look.at(10).range(2.9, 3.8);
    let low = Vec3::new(-half - 0.6, y, high);
    draft.add(
        Geometry::span(low, Vec3::new(half + 0.6, y + STRETCH, high + 0.35)),
        ground.glass_roof,
        look.bits(),
    );
    let step = look.at(11).range(3.0, 5.5);
    for column in 0..(STRETCH / step) as i32 {
        for side in [-1.0, 1.0] {
            let base = Vec3::new(side * (half + 0.3), y + step * column as f32, 0.0);
            if look.at(12).chance(0.5) {
                draft.add(
                    Geometry::Pillar { base, height: high, bottom: 0.22, top: 0.2 },
                    ground.concrete,
                    look.bits(),
                );
            } else {
                let size = Vec3::new(0.4, 0.4, high);
                draft.add(
                    Geometry::block(base + Vec3::Z * (0.5 * high), size, 0.0),
                    ground.concrete,
                    look.bits(),
                );
            }
        }
    }
    for lamp in 0..2_u8 {
        let position = Vec3::new(0.0, y + 5.0 + 11.0 * f32::from(lamp), high - 0.15);
        draft.lamps.push(Lamp {
            position,
            colour: Vec3::new(1.0, 0.93, 0.8) * 3.0,
            reach: 13.0,
            by_day: false,
        });
    }
}
