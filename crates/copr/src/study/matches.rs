//! Where queries are found, by how far off that is: figures 6.8, 6.9 and 6.13.

use serde::Deserialize;
use vpr_core::{
    Definition, Map, Poses, Provenance,
    metrics::bootstrap::{Z_95, wilson_interval},
    retrieve,
};
use vpr_report::{
    figure::{Curve, Figure, Panel, Shape},
    table::{Cell, Table},
};

use super::{
    Context, Method, Paths, Place, Rooms, Scene,
    dense::{densified, selected},
    encoder,
    lanes::Opened,
};
use crate::{Anchors, Grid, PoseErrors, Result, Targets, oracle, sequences};
use vpr_study::technique::Found;

/// What is looked at.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Looked {
    /// Scenes, extrapolated around the sequence that stays.
    Rooms {
        /// The scenes.
        scenes: Vec<Scene>,
        /// Distance between targets, metres.
        step_m: f64,
        /// The generated rooms.
        rooms: Rooms,
    },
    /// Scenes whose sequences are interpolated.
    Interpolated {
        /// The scenes.
        scenes: Vec<Scene>,
        /// The generated rooms.
        rooms: Rooms,
    },
    /// A place that is made denser to the side.
    Place(Place),
}

impl Looked {
    /// Scenes and generated rooms, if it has any.
    pub(super) fn rooms(&self) -> Option<(&[Scene], &Rooms)> {
        match self {
            Self::Rooms { scenes, rooms, .. } | Self::Interpolated { scenes, rooms } => {
                Some((scenes, rooms))
            }
            Self::Place(_) => None,
        }
    }
}

/// Upper ends of the classes of a match, metres.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Classes {
    /// Near: green in the thesis.
    pub near_m: f64,
    /// Neither near nor far: orange.
    pub middle_m: f64,
}

pub(super) fn run(
    table: &mut Table,
    looked: &Looked,
    (classes, methods): (Classes, &[Method]),
    context: Context<'_>,
) -> Result<Figure> {
    let mut figure = Figure::default();
    match looked {
        Looked::Rooms { scenes, rooms, .. } | Looked::Interpolated { scenes, rooms } => {
            let step_m = match looked {
                Looked::Rooms { step_m, .. } => Some(*step_m),
                _ => None,
            };
            for scene in scenes {
                for encoder in &rooms.encoders {
                    for &paths in &rooms.paths {
                        let of = (scene, encoder.as_str(), paths);
                        let plan = (rooms, step_m, methods, classes);
                        in_room((table, &mut figure), of, plan, context)?;
                    }
                }
            }
        }
        Looked::Place(place) => {
            beside((table, &mut figure), place, (methods, classes), context)?;
        }
    }
    Ok(figure)
}

fn in_room(
    (table, figure): (&mut Table, &mut Figure),
    (scene, encoder, paths): (&Scene, &str, Paths),
    (rooms, step_m, methods, classes): (&Rooms, Option<f64>, &[Method], Classes),
    context: Context<'_>,
) -> Result<()> {
    let label = format!("{}, {}", scene.name, Rooms::label(encoder, paths));
    let room = match rooms.open(scene, encoder, paths, context)? {
        Ok(room) => room,
        Err(why) => {
            table.push(Cell::absent(&label, "sparse map", why));
            return Ok(());
        }
    };
    let shown = Shown { label, queries: &room.queries.map, classes };
    let methods: Vec<Method> = methods.iter().map(|it| it.at(encoder)).collect();
    let Some(step_m) = step_m else {
        let all = &room.references.map;
        let poses = all.poses().six_dof()?;
        let best = retrieve(shown.queries.descriptors(), all.descriptors(), 1)?.best();
        let found = (&best[..], all.poses());
        shown.push((table, figure), "ground-truth map", found, all.poses())?;
        let anchors = Anchors::every_and_last(poses, &room.references.sequences, rooms.every)?;
        let left_out: Vec<usize> =
            (0..all.len()).filter(|it| anchors.rows().binary_search(it).is_err()).collect();
        let targets = Targets::frames(&anchors, poses, &left_out)?;
        let sparse = selected(all, anchors.rows())?;
        return shown.all((table, figure), (&sparse, all, &targets), &methods, context);
    };
    let sparse = selected(&room.references.map, &room.kept.clone().collect::<Vec<_>>())?;
    let poses = sparse.poses().six_dof()?;
    let anchors = Anchors::every(poses, &sequences(None, sparse.len()), rooms.every)?;
    let grid = Grid::new(scene.span_m, step_m, Definition::Corrected)?;
    let targets = Targets::around(&anchors, &grid)?;
    shown.all((table, figure), (&sparse, &sparse, &targets), &methods, context)
}

fn beside(
    (table, figure): (&mut Table, &mut Figure),
    place: &Place,
    (methods, classes): (&[Method], Classes),
    context: Context<'_>,
) -> Result<()> {
    let label = format!("{}, {}, generated", place.name, place.encoder);
    let runner = match encoder::find(&place.encoder, context.sources)? {
        Found::Runs(runner) => runner,
        Found::Absent(why) => {
            table.push(Cell::absent(&label, "sparse map", why));
            return Ok(());
        }
    };
    let opened = Opened::new((&place.world, &place.name), &runner, context)?;
    let poses = opened.references.poses().six_dof()?;
    let anchors = Anchors::every(poses, &sequences(None, poses.len()), 1)?;
    let targets = opened.targets(place.targets, &anchors)?;
    let methods: Vec<Method> = methods.iter().map(|it| it.at(&place.key)).collect();
    let shown = Shown { label, queries: &opened.queries, classes };
    let map = &opened.references;
    shown.all((table, figure), (map, map, &targets), &methods, context)
}

/// Queries whose matches are shown.
struct Shown<'a> {
    label: String,
    queries: &'a Map,
    classes: Classes,
}

impl Shown<'_> {
    /// The sparse map, every method on rows of `source`, and what a perfect retrieval would find in the dense map.
    fn all(
        &self,
        (table, figure): (&mut Table, &mut Figure),
        (sparse, source, targets): (&Map, &Map, &Targets<'_>),
        methods: &[Method],
        context: Context<'_>,
    ) -> Result<()> {
        let best = |map: &Map| -> Result<Vec<usize>> {
            Ok(retrieve(self.queries.descriptors(), map.descriptors(), 1)?.best())
        };
        self.push((table, figure), "sparse map", (&best(sparse)?, sparse.poses()), sparse.poses())?;
        for method in methods {
            let name = method.map();
            let ready = match method.ready(context)? {
                Ok(ready) => ready,
                Err(why) => {
                    table.push(Cell::absent(&self.label, &name, why));
                    continue;
                }
            };
            match densified(sparse, source, targets, &ready)? {
                Ok((dense, _)) => {
                    let found = (best(&dense)?, dense.poses());
                    self.push((table, figure), &name, (&found.0, found.1), sparse.poses())?;
                }
                Err(why) => table.push(Cell::absent(&self.label, &name, why)),
            }
        }
        let mut dense = sparse.poses().clone();
        dense.extend(&Poses::SixDof(targets.iter().map(|it| it.pose).collect()))?;
        let nearest = oracle(self.queries.poses(), &dense)?;
        self.push((table, figure), "dense map, oracle", (&nearest, &dense), sparse.poses())
    }

    fn push(
        &self,
        (table, figure): (&mut Table, &mut Figure),
        map: &str,
        (best, references): (&[usize], &Poses),
        images: &Poses,
    ) -> Result<()> {
        let errors = PoseErrors::of_retrieval(best, references, self.queries.poses())?;
        let Classes { near_m, middle_m } = self.classes;
        let class = |far: f64| usize::from(far > near_m) + usize::from(far > middle_m);
        let names = [
            format!("within {near_m} m"),
            format!("{near_m} to {middle_m} m"),
            format!("beyond {middle_m} m"),
        ];
        let planar = |poses: &Poses, row: usize| {
            let at = poses.position(row);
            (at.x, at.y)
        };
        let mut curves = Vec::new();
        for (number, name) in names.iter().enumerate() {
            let members: Vec<usize> =
                (0..errors.len()).filter(|&it| class(errors.translation_m[it]) == number).collect();
            let share = wilson_interval(members.len(), errors.len(), Z_95)?;
            let row = format!("{}: {name}", self.label);
            let cell = Cell::new(row, map, share.estimate, Provenance::Generated, errors.len());
            table.push(cell.within(share.low, share.high, "Wilson"));
            // From the query to where it was found, and a gap.
            let line = |&query: &usize| {
                let (from, to) =
                    (planar(self.queries.poses(), query), planar(references, best[query]));
                [from, to, (f64::NAN, f64::NAN)]
            };
            let points: Vec<(f64, f64)> = members.iter().flat_map(line).collect();
            curves.push(Curve::new(name, points).of(Provenance::Generated));
        }
        let images = (0..images.len()).map(|row| planar(images, row)).collect();
        let images = Curve::new("images of the map", images).of(Provenance::Generated);
        curves.push(images.shaped(Shape::Points));
        figure.panels.push(Panel {
            title: format!("{}: {map}", self.label),
            x_label: "x, m".to_owned(),
            y_label: "y, m".to_owned(),
            curves,
            ..Panel::default()
        });
        Ok(())
    }
}
