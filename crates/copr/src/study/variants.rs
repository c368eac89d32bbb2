//! Other ways beside the plain one, on the same queries: H that learned elsewhere, fewer targets.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;
use vpr_core::{Definition, Map, Pose, Provenance};
use vpr_report::table::{Cell, Table};
use vpr_worlds::{Depth, Side, depths, named_recipe};

use super::{
    Context, Method, Paths, Rooms, Scene,
    dense::{Ready, joined, localize, selected},
    rows::MTE,
};
use crate::{
    Anchors, GaussianParams, GaussianProcess, Grid, PoseErrors, Regressor, Result, Targets,
    regressed,
    regression::{Anchor, Request},
    sequences,
    targets::{DepthView, behind, disagreement},
};

/// One way to make a map denser.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Variant {
    /// What it is called in tables.
    pub name: String,
    /// How descriptors are regressed.
    pub method: Method,
    /// Which targets get a row; without it all.
    #[serde(default)]
    pub keep: Option<Keep>,
}

/// A share of the targets.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Keep {
    /// From 0 to 1.
    pub share: f64,
    /// Those with more of it get no row, whatever the share.
    #[serde(default)]
    pub at_most: Option<f64>,
    /// Those of which there is the least.
    pub least: Doubt,
}

/// What speaks against a target.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Doubt {
    /// What is regressed from the nearest other anchor is something else.
    Disagreement,
    /// A Gaussian process over poses knows little of it.
    Variance,
    /// It is outside of the box in which cameras stood: walls are.
    Outside,
    /// It lies behind what the cameras of the anchors see, by their depth.
    Behind,
    /// Nothing: numbers drawn from the experiment's seed, to compare with.
    Drawn,
}

/// What is compared.
#[derive(Clone, Copy)]
pub(super) struct Plan<'a> {
    pub(super) step_m: f64,
    pub(super) plain: &'a Variant,
    pub(super) variants: &'a [Variant],
    pub(super) rooms: &'a Rooms,
}

const PAIRED: &str = "paired bootstrap over queries";

pub(super) fn run(
    table: &mut Table,
    scenes: &[Scene],
    plan: Plan<'_>,
    context: Context<'_>,
) -> Result<()> {
    for encoder in &plan.rooms.encoders {
        for &paths in &plan.rooms.paths {
            for scene in scenes {
                in_room(table, scene, (encoder, paths), plan, context)?;
            }
        }
    }
    Ok(())
}

fn in_room(
    table: &mut Table,
    scene: &Scene,
    (encoder, paths): (&str, Paths),
    plan: Plan<'_>,
    context: Context<'_>,
) -> Result<()> {
    let label = Rooms::label(encoder, paths);
    let row = |what: &str| format!("{what} / {label}");
    let room = match plan.rooms.open(scene, encoder, paths, context)? {
        Ok(room) => room,
        Err(why) => {
            table.push(Cell::absent(row(&format!("{MTE}: sparse map")), &scene.name, why));
            return Ok(());
        }
    };
    let queries = &room.queries.map;
    let sparse = selected(&room.references.map, &room.kept.clone().collect::<Vec<_>>())?;
    let poses = sparse.poses().six_dof()?;
    let anchors = Anchors::every(poses, &sequences(None, sparse.len()), plan.rooms.every)?;
    let grid = Grid::new(scene.span_m, plan.step_m, Definition::Corrected)?;
    let targets = Targets::around(&anchors, &grid)?;
    let mut push = |what: &str, errors: &PoseErrors, note: Option<String>| -> Result<()> {
        let mte = errors.accuracy(&context.resampling())?.mte_m;
        let row = row(&format!("{MTE}: {what}"));
        let cell = Cell::new(row, &scene.name, mte.estimate, Provenance::Generated, errors.len());
        let cell = cell.within(mte.low, mte.high, "bootstrap over queries");
        table.push(Cell { note, ..cell });
        Ok(())
    };
    let sparse_errors = localize(&sparse, queries)?;
    push("sparse map", &sparse_errors, None)?;
    let mut found: Vec<(&Variant, Result<PoseErrors, String>)> = Vec::new();
    for variant in std::iter::once(plan.plain).chain(plan.variants) {
        let errors = match variant.method.at(encoder).ready(context)? {
            Ok(ready) => {
                let sources = (&sparse, &targets, room.kept.start);
                let targets = variant.chosen(sources, &ready, (plan.rooms, scene), context)?;
                let (rows, _) = regressed(&sparse, &targets, &*ready.regressor, ready.options)?;
                let errors = localize(&joined(&sparse, &rows)?, queries)?;
                push(&variant.name, &errors, Some(format!("{} regressed rows", targets.len())))?;
                Ok(errors)
            }
            Err(why) => Err(why),
        };
        found.push((variant, errors));
    }
    let compared = Compared { row: &row, scene, sparse: &sparse_errors, context };
    compared.push(table, plan.plain, found)
}

/// What stands beside each other in a room.
struct Compared<'a> {
    /// The row of a metric.
    row: &'a dyn Fn(&str) -> String,
    scene: &'a Scene,
    sparse: &'a PoseErrors,
    context: Context<'a>,
}

impl Compared<'_> {
    /// Differences from the sparse map, and of all but the first from the first, which is plain.
    fn push(
        &self,
        table: &mut Table,
        plain: &Variant,
        found: Vec<(&Variant, Result<PoseErrors, String>)>,
    ) -> Result<()> {
        let first = found.first().and_then(|it| it.1.clone().ok());
        for (number, (variant, errors)) in found.into_iter().enumerate() {
            let errors = match errors {
                Ok(errors) => errors,
                Err(why) => {
                    let row = (self.row)(&format!("{MTE}: {}", variant.name));
                    table.push(Cell::absent(row, &self.scene.name, why));
                    continue;
                }
            };
            let against = [
                (Some(self.sparse), "the sparse map"),
                (first.as_ref().filter(|_| number > 0), plain.name.as_str()),
            ];
            for (other, name) in against {
                let Some(other) = other else { continue };
                let gain = errors.mte_against(other, &self.context.resampling())?;
                let row = (self.row)(&format!("{MTE}, minus that of {name}: {}", variant.name));
                let (column, n) = (&self.scene.name, errors.len());
                let cell = Cell::new(row, column, gain.estimate, Provenance::Generated, n);
                table.push(cell.within(gain.low, gain.high, PAIRED));
            }
        }
        Ok(())
    }
}

impl Variant {
    /// The targets that get a row.
    fn chosen<'a>(
        &self,
        (sparse, targets, first): (&Map, &Targets<'a>, usize),
        ready: &Ready,
        (rooms, scene): (&Rooms, &Scene),
        context: Context<'_>,
    ) -> Result<Targets<'a>> {
        let Some(Keep { share, at_most, least }) = self.keep else { return Ok(targets.clone()) };
        let doubts = match least {
            Doubt::Disagreement => disagreement(sparse, targets, &*ready.regressor, ready.options)?,
            Doubt::Variance => variances(sparse, targets)?,
            Doubt::Outside => outside(sparse, targets)?,
            Doubt::Behind => {
                // The anchors are rows of the sparse map, which begins at `first` in the room.
                let (anchors, poses) = (targets.anchors().rows(), sparse.poses().six_dof()?);
                let images: Vec<usize> = anchors.iter().map(|row| first + row).collect();
                let recipe = named_recipe(&rooms.world(scene))?;
                let seen = depths(&recipe, Side::References, &images)?;
                let views = seen.iter().zip(anchors).map(|(depth, &row)| view(depth, poses[row]));
                behind(targets, &views.collect::<Vec<_>>())
            }
            Doubt::Drawn => {
                let mut random = ChaCha8Rng::seed_from_u64(context.resampling().seed);
                targets.iter().map(|_| random.random()).collect()
            }
        };
        let share = match at_most {
            Some(limit) => {
                let n = doubts.iter().filter(|it| **it <= limit).count();
                share.min(n as f64 / doubts.len().max(1) as f64)
            }
            None => share,
        };
        targets.least_doubtful(&doubts, share)
    }
}

/// What a generated camera measures.
fn view(depth: &Depth, pose: Pose) -> DepthView<'_> {
    let camera = &depth.camera;
    DepthView {
        pose,
        focal: [camera.focal; 2],
        centre: [0.5 * f64::from(camera.width), 0.5 * f64::from(camera.height)],
        metres: depth.metres.view(),
    }
}

/// What a Gaussian process says of every target.
fn variances(sparse: &Map, targets: &Targets<'_>) -> Result<Vec<f64>> {
    let process = GaussianProcess::new(GaussianParams::default())?;
    let (poses, values) = (sparse.poses().six_dof()?, sparse.descriptors().as_slice());
    let (dim, anchors) = (sparse.descriptors().dim(), targets.anchors());
    let one = |(target, it): (usize, crate::Target)| {
        let place = (target, it.home, &it.pose);
        let chosen = anchors.select(process.selection(), place, process.name())?;
        let of = |anchor: usize| {
            let row = anchors.rows()[anchor];
            Anchor { pose: &poses[row], descriptor: &values[row * dim..][..dim] }
        };
        let anchors = chosen.into_iter().map(of).collect();
        Ok(process.variances(&[Request { target, pose: it.pose, anchors }])?[0])
    };
    targets.iter().enumerate().map(one).collect()
}

/// How far every target is outside of the box in which cameras stood, metres.
fn outside(sparse: &Map, targets: &Targets<'_>) -> Result<Vec<f64>> {
    let poses = sparse.poses().six_dof()?;
    let side = |axis: usize| {
        let values = || poses.iter().map(move |it| it.translation.vector[axis]);
        (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max))
    };
    let sides = [side(0), side(1), side(2)];
    let of = |target: crate::Target| {
        let at = target.pose.translation.vector;
        let beyond = (0..3).map(|axis| (sides[axis].0 - at[axis]).max(at[axis] - sides[axis].1));
        beyond.map(|it| it.max(0.0).powi(2)).sum::<f64>().sqrt()
    };
    Ok(targets.iter().map(of).collect())
}
