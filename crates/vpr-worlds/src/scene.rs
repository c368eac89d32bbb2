//! A scene: shapes with materials in a hierarchy of bounds, lamps, and what a ray meets.

use glam::{Vec2, Vec3, Vec3A};
use obvhs::{
    BvhBuildParams,
    aabb::Aabb,
    bvh2::reinsertion::ReinsertionOptimizer,
    cwbvh::{CwBvh, bvh2_to_cwbvh::bvh2_to_cwbvh},
    ploc::PlocBuilder,
    ray::{Ray as Probe, RayHit},
};

use crate::{
    geometry::{Geometry, Ray},
    material::{Colour, Material},
};

/// Something that can be seen.
#[derive(Clone, Debug)]
pub(crate) struct Shape {
    pub(crate) geometry: Geometry,
    /// Index into the scene's materials.
    pub(crate) material: u32,
    /// Its own number: two shapes with the same one look the same.
    pub(crate) seed: u32,
    /// Whether it is elsewhere at another time (cars, people).
    pub(crate) moving: bool,
}

/// A lamp that shines in all directions, or in a cone around `direction`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lamp {
    pub(crate) position: Vec3,
    /// Radiance times square metre: a white wall one metre away has this colour over π.
    pub(crate) colour: Colour,
    /// No light arrives beyond this distance.
    pub(crate) reach: f32,
    /// On by day too.
    pub(crate) by_day: bool,
}

/// Where a ray meets a shape.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hit {
    pub(crate) t: f32,
    pub(crate) shape: u32,
}

/// What is built before it is seen: shapes, materials and lamps in the making.
#[derive(Clone, Debug, Default)]
pub(crate) struct Draft {
    pub(crate) shapes: Vec<Shape>,
    pub(crate) materials: Vec<Material>,
    pub(crate) lamps: Vec<Lamp>,
}

impl Draft {
    /// Adds a material and gives its number.
    pub(crate) fn material(&mut self, material: Material) -> u32 {
        self.materials.push(material);
        u32::try_from(self.materials.len() - 1).expect("fewer materials than four billion")
    }

    pub(crate) fn add(&mut self, geometry: Geometry, material: u32, seed: u32) {
        self.shapes.push(Shape { geometry, material, seed, moving: false });
    }

    pub(crate) fn add_moving(&mut self, geometry: Geometry, material: u32, seed: u32) {
        self.shapes.push(Shape { geometry, material, seed, moving: true });
    }
}

/// A finished scene.
pub(crate) struct Scene {
    pub(crate) shapes: Vec<Shape>,
    pub(crate) materials: Vec<Material>,
    pub(crate) lamps: Vec<Lamp>,
    /// Height above which nothing is.
    top: f32,
    /// Shapes wider than [`WIDE`], tried first: they limit how far a ray is followed.
    wide: Vec<u32>,
    hierarchy: CwBvh,
    grid: LampGrid,
}

/// Boxes are this much larger than their shapes: more than an f32 is off 4 km from the origin.
const SLACK: Vec3 = Vec3::splat(1e-3);

/// Shapes of this extent would blow up every box of the hierarchy that holds them.
const WIDE: f32 = 500.0;

impl Scene {
    pub(crate) fn new(draft: Draft) -> Self {
        let Draft { shapes, materials, lamps } = draft;
        // Wide shapes come last, so that the others keep their numbers in the hierarchy.
        let (mut shapes, wide): (Vec<Shape>, Vec<Shape>) =
            shapes.into_iter().partition(|shape| extent(&shape.geometry).max_element() < WIDE);
        let bounds: Vec<Aabb> = shapes
            .iter()
            .map(|shape| {
                let (low, high) = shape.geometry.bounds();
                Aabb::new(Vec3A::from(low - SLACK), Vec3A::from(high + SLACK))
            })
            .collect();
        let mut hierarchy = hierarchy(&bounds);
        // Shapes in the order in which rays meet them: those of one box lie side by side.
        let order = std::mem::take(&mut hierarchy.primitive_indices);
        let mut places: Vec<Option<Shape>> = shapes.into_iter().map(Some).collect();
        let in_order = order.iter().map(|&index| places[index as usize].take());
        shapes = in_order.map(|shape| shape.expect("each shape is in one box")).collect();
        let grid = LampGrid::new(&lamps);
        let n_narrow = shapes.len() as u32;
        shapes.extend(wide);
        let wide = (n_narrow..shapes.len() as u32).collect();
        let top = shapes.iter().map(|shape| shape.geometry.bounds().1.z).fold(0.0, f32::max);
        Self { shapes, materials, lamps, top, wide, hierarchy, grid }
    }

    /// The nearest shape on the ray within `limit` metres.
    pub(crate) fn nearest(&self, ray: &Ray, mut limit: f32) -> Option<Hit> {
        let mut nearest = None;
        for &shape in &self.wide {
            if let Some(t) = self.shapes[shape as usize].geometry.hit(ray, limit) {
                limit = t;
                nearest = Some(Hit { t, shape });
            }
        }
        let mut hit = RayHit::none();
        let probe = probe(ray, limit.min(self.way_out(ray)));
        self.hierarchy.ray_traverse(probe, &mut hit, |probe, id| {
            self.shapes[id].geometry.hit(ray, probe.tmax).unwrap_or(f32::INFINITY)
        });
        if hit.t < limit {
            return Some(Hit { t: hit.t, shape: hit.primitive_id });
        }
        nearest
    }

    /// Whether nothing is on the ray within `limit` metres; wide shapes cast no shadows.
    pub(crate) fn is_free(&self, ray: &Ray, limit: f32) -> bool {
        self.hierarchy.ray_traverse_miss(probe(ray, limit.min(self.way_out(ray))), |probe, id| {
            self.shapes[id].geometry.hit(ray, probe.tmax).unwrap_or(f32::INFINITY)
        })
    }

    /// Distance at which a ray has climbed above everything.
    fn way_out(&self, ray: &Ray) -> f32 {
        if ray.direction.z > 1e-3 {
            ((self.top - ray.origin.z) / ray.direction.z).max(0.0) + 0.01
        } else {
            f32::INFINITY
        }
    }

    /// Numbers of the lamps that may reach `point`.
    pub(crate) fn lamps_near(&self, point: Vec3) -> &[u32] {
        self.grid.near(point)
    }
}

/// What `obvhs::cwbvh::builder::build_cwbvh` does, without its check of the result in builds with
/// debug assertions: that one holds boxes to 10⁻⁵ m, which an f32 cannot keep beyond 100 m.
fn hierarchy(bounds: &[Aabb]) -> CwBvh {
    let params = BvhBuildParams::medium_build();
    let indices = (0..bounds.len() as u32).collect();
    let mut boxes = PlocBuilder::with_capacity(bounds.len()).build(
        params.ploc_search_distance,
        bounds,
        indices,
        params.sort_precision,
        params.search_depth_threshold,
    );
    ReinsertionOptimizer::default().run(&mut boxes, params.reinsertion_batch_ratio, None);
    bvh2_to_cwbvh(&boxes, params.max_prims_per_leaf.clamp(1, 3), true, false)
}

fn extent(geometry: &Geometry) -> Vec3 {
    let (low, high) = geometry.bounds();
    high - low
}

fn probe(ray: &Ray, limit: f32) -> Probe {
    Probe::new(Vec3A::from(ray.origin), Vec3A::from(ray.direction), 0.0, limit)
}

/// Lamps by the squares of the plan they reach.
struct LampGrid {
    low: Vec2,
    columns: usize,
    rows: usize,
    cells: Vec<Vec<u32>>,
}

/// Side of a square, metres.
const SQUARE: f32 = 12.0;

impl LampGrid {
    fn new(lamps: &[Lamp]) -> Self {
        let plan = |lamp: &Lamp| Vec2::new(lamp.position.x, lamp.position.y);
        let low = lamps.iter().fold(Vec2::INFINITY, |low, l| low.min(plan(l) - l.reach));
        let high = lamps.iter().fold(Vec2::NEG_INFINITY, |high, l| high.max(plan(l) + l.reach));
        if lamps.is_empty() {
            return Self { low: Vec2::ZERO, columns: 0, rows: 0, cells: Vec::new() };
        }
        let size = ((high - low) / SQUARE).ceil();
        let (columns, rows) = (size.x as usize + 1, size.y as usize + 1);
        let mut cells = vec![Vec::new(); columns * rows];
        for (number, lamp) in (0_u32..).zip(lamps) {
            let first = (plan(lamp) - lamp.reach - low) / SQUARE;
            let last = (plan(lamp) + lamp.reach - low) / SQUARE;
            for row in first.y as usize..=(last.y as usize).min(rows - 1) {
                for column in first.x as usize..=(last.x as usize).min(columns - 1) {
                    cells[row * columns + column].push(number);
                }
            }
        }
        Self { low, columns, rows, cells }
    }

    fn near(&self, point: Vec3) -> &[u32] {
        let at = (Vec2::new(point.x, point.y) - self.low) / SQUARE;
        if at.x < 0.0 || at.y < 0.0 {
            return &[];
        }
        let (column, row) = (at.x as usize, at.y as usize);
        if column >= self.columns || row >= self.rows {
            return &[];
        }
        &self.cells[row * self.columns + column]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;

    #[test]
    fn the_hierarchy_finds_what_a_search_of_all_shapes_finds() {
        for away in [0.0, 3_000.0] {
            agree(Vec3::new(0.3 * away, away, 0.0));
        }
    }

    fn some_shape(kind: i64, center: Vec3, size: Vec3, seed: Seed) -> Geometry {
        match kind % 5 {
            0 => Geometry::block(center, size, seed.unit() * 6.0),
            1 => Geometry::ball(center, size),
            2 => {
                Geometry::Pillar { base: center, height: size.z, bottom: size.x, top: 0.5 * size.y }
            }
            3 => Geometry::Patch { corner: center, u: size, v: Vec3::new(-size.y, size.x, 0.3) },
            _ => Geometry::triangle(center, center + size, center + Vec3::new(0.0, -1.0, 1.0)),
        }
    }

    fn agree(origin: Vec3) {
        let seed = Seed::new(4);
        let mut draft = Draft::default();
        for k in 0..300 {
            let own = seed.at(k);
            let center = origin
                + Vec3::new(
                    own.at(0).range(-9.0, 9.0),
                    own.at(1).range(-9.0, 9.0),
                    own.at(2).range(-3.0, 3.0),
                );
            let size = Vec3::new(
                own.at(3).range(0.2, 1.5),
                own.at(4).range(0.2, 1.5),
                own.at(5).range(0.2, 1.5),
            );
            draft.add(some_shape(k, center, size, own.at(6)), 0, 0);
        }
        let scene = Scene::new(draft);
        let mut n_hits = 0;
        for k in 0..2_000 {
            let own = seed.named("ray").at(k);
            let direction = Vec3::new(
                own.at(0).range(-1.0, 1.0),
                own.at(1).range(-1.0, 1.0),
                own.at(2).range(-0.4, 0.4),
            );
            let ray = Ray {
                origin: origin + Vec3::new(0.01, 0.02, own.at(3).unit()),
                direction: direction.normalize(),
            };
            let found = scene.nearest(&ray, 50.0).map(|hit| hit.t);
            let searched = scene.shapes.iter().filter_map(|shape| shape.geometry.hit(&ray, 50.0));
            let searched = searched.min_by(f32::total_cmp);
            assert_eq!(found, searched, "ray {k}");
            assert_eq!(scene.is_free(&ray, 50.0), found.is_none());
            n_hits += usize::from(found.is_some());
        }
        assert!(n_hits > 500, "{n_hits}");
    }
}
