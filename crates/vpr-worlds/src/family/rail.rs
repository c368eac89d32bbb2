//! One railway track through hills: the train's route, and what is built along it.

use glam::Vec3;

use super::{
    Plan, level_pose,
    lineside::{STATION, TUNNEL, station, tunnel},
    track::{Line, bend, slope},
    two_traverses,
};
use crate::{
    light::Light,
    parts::{Grove, OUTDOORS, StreetKit, hide_behind},
    recipe::{Rail, Recipe},
    scene::{Draft, Scene},
    seed::Seed,
    traverse::Traverse,
};

impl Rail {
    pub(crate) fn plan(&self, recipe: &Recipe, seed: Seed) -> Plan {
        let steps = recipe.steps(self.spacing_m);
        let n = steps.last().map_or(0, |last| last + 1);
        let line = Line { rail: self, length: n as f32 * self.spacing_m as f32, seed };
        let route: Vec<_> = steps
            .into_iter()
            .map(|place| {
                let y = (place as f64 * self.spacing_m) as f32 + 2.0;
                let heading = std::f64::consts::FRAC_PI_2 - f64::from(libm::atanf(slope(y)));
                level_pose(Vec3::new(bend(y), y, self.eye_m as f32), heading)
            })
            .collect();
        let (first, _) = line.build(&recipe.references, 0);
        let (second, kit) = line.build(&recipe.queries, 1);
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

impl Line<'_> {
    /// The line as the traverse with this number finds it, and what stands in front of cameras.
    fn build(&self, traverse: &Traverse, number: i64) -> (Scene, StreetKit) {
        let mut draft = Draft::default();
        let kit = StreetKit::new(&mut draft, self.seed.named("kit"));
        let grove =
            Grove::new(&mut draft, self.seed.named("grove"), traverse.condition.bare as f32);
        let tunnels = self.along("tunnels", self.rail.tunnels_per_km, TUNNEL);
        let stations: Vec<f32> = self
            .along("stations", self.rail.stations_per_km, STATION)
            .into_iter()
            .filter(|s| tunnels.iter().all(|t| (t - s).abs() > 120.0))
            .collect();
        let inside = |y: f32| tunnels.iter().any(|t| (*t..t + TUNNEL).contains(&y));
        let beside = |y: f32| stations.iter().any(|s| (*s - 12.0..s + STATION + 12.0).contains(&y));
        self.ground(&mut draft, &inside);
        self.track(&mut draft);
        self.woods(&mut draft, &grove, &inside, &beside);
        for (k, &start) in (0..).zip(&tunnels) {
            tunnel(&mut draft, start, self.seed.named("tunnel").at(k));
        }
        for (k, &start) in (0..).zip(&stations) {
            let people = self.seed.named("people").at(number).at(k);
            station(&mut draft, &kit, start, self.seed.named("station").at(k), (people, traverse));
        }
        self.farms(&mut draft, &beside);
        (Scene::new(draft), kit)
    }
}
