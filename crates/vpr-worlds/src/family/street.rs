//! The drive along the avenues of a city: its route, its visits, and the views around it.

use glam::Vec3;

use super::{
    Plan, Shot,
    city::{AVENUES, City},
    drive, level_pose, two_traverses,
};
use crate::{
    light::Light,
    parts::{OUTDOORS, hide_behind},
    recipe::{Grid, Recipe, Street},
    seed::Seed,
    traverse::{Offset, Traverse},
};

/// Places from one slow stretch of an uneven drive to the next.
const SLOW_EVERY: f64 = 24.0;

impl Street {
    pub(crate) fn plan(&self, recipe: &Recipe, seed: Seed) -> Plan {
        let route = self.route(recipe);
        let last = recipe.steps(self.slowest_m()).last().copied().unwrap_or_default();
        let mut city = City::new(self, last + 1, seed);
        // New places may lie on avenues of their own.
        city.reach((last / self.per_avenue(recipe.places)) as i64);
        let (first, _) = city.build(&recipe.references, 0);
        let (second, kit) = city.build(&recipe.queries, 1);
        let (references, queries) = two_traverses(recipe, &route, seed, |pose, own| {
            let share = recipe.queries.condition.occlusion;
            hide_behind(&kit, (pose, &recipe.camera), share, OUTDOORS, own)
        });
        let lights = vec![
            Light::new(&recipe.references.condition, seed.named("first light")),
            Light::new(&recipe.queries.condition, seed.named("second light")),
        ];
        let grid = self.views(recipe, seed);
        Plan {
            scenes: vec![first, second],
            lights,
            references,
            queries,
            grid,
            world_from_scene: vpr_core::Pose::identity(),
        }
    }

    /// One shot per place and visit, place by place; every visit has a scene and a light.
    pub(crate) fn tour(&self, recipe: &Recipe, visits: &[Traverse], seed: Seed) -> Plan {
        let route = self.route(recipe);
        let city = City::new(self, recipe.places, seed);
        let (mut scenes, mut lights, mut drives) = (Vec::new(), Vec::new(), Vec::new());
        for (number, visit) in (0_i64..).zip(visits) {
            let own = seed.named("visit").at(number);
            let (scene, kit) = city.build(visit, number);
            let mut shots = drive(recipe, visit, &route[..recipe.places], scenes.len(), own);
            for shot in &mut shots {
                let share = visit.condition.occlusion;
                let view = (&shot.pose, &recipe.camera);
                shot.foreground = hide_behind(&kit, view, share, OUTDOORS, shot.seed);
            }
            scenes.push(scene);
            lights.push(Light::new(&visit.condition, own.named("light")));
            drives.push(shots.into_iter());
        }
        let place_by_place = (0..recipe.places)
            .flat_map(|_| drives.iter_mut().filter_map(Iterator::next).collect::<Vec<_>>());
        Plan {
            references: place_by_place.collect(),
            scenes,
            lights,
            queries: Vec::new(),
            grid: Vec::new(),
            world_from_scene: vpr_core::Pose::identity(),
        }
    }

    /// Views of the first traverse on the grid, looking as the references do.
    fn views(&self, recipe: &Recipe, seed: Seed) -> Vec<Shot> {
        let Some(Grid { rows, columns, step_m }) = self.grid else { return Vec::new() };
        let heading = (90.0 + self.heading_deg).to_radians();
        let route: Vec<_> = (0..rows * columns)
            .map(|k| {
                let x = 1.7 + step_m * ((k / columns) as f64 - 0.5 * (rows - 1) as f64);
                let y = 3.0 + step_m * (k % columns) as f64;
                level_pose(Vec3::new(x as f32, y as f32, self.eye_m as f32), heading)
            })
            .collect();
        let level = Traverse { offset: Offset::default(), ..recipe.references };
        drive(recipe, &level, &route, 0, seed.named("grid"))
    }

    /// Level poses in the middle of the right lane.
    fn route(&self, recipe: &Recipe) -> Vec<vpr_core::Pose> {
        let per_avenue = self.per_avenue(recipe.places);
        let heading = (90.0 + self.heading_deg).to_radians();
        recipe
            .steps(self.slowest_m())
            .into_iter()
            .map(|place| {
                let (avenue, along) = (place / per_avenue, place % per_avenue);
                let x = avenue as f32 * AVENUES + 1.7;
                let y = self.along(along) + 3.0;
                level_pose(Vec3::new(x, y as f32, self.eye_m as f32), heading)
            })
            .collect()
    }

    /// Metres along an avenue at which a place lies.
    fn along(&self, place: usize) -> f64 {
        let even = place as f64 * self.spacing_m;
        if self.uneven == 0.0 {
            return even;
        }
        let turn = std::f64::consts::TAU / SLOW_EVERY;
        even + self.uneven * self.spacing_m * libm::sin(turn * place as f64) / turn
    }

    /// Smallest distance between places.
    fn slowest_m(&self) -> f64 {
        self.spacing_m * (1.0 - self.uneven)
    }

    /// Places along one avenue of a route with so many places.
    pub(crate) fn per_avenue(&self, places: usize) -> usize {
        places.div_ceil(self.avenues)
    }
}
