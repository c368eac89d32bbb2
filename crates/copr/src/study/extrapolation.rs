//! Grids around every so many-th image of one sequence: table 6.1.

use vpr_core::{Definition, Pose, Poses, Provenance};
use vpr_report::table::Table;

use super::{
    Context, Method, Rooms, Scene, dense::selected, methods::Setting, real::RealScene, rows::Row,
};
use crate::{Anchors, Grid, PoseErrors, Result, Targets, oracle, sequences};

/// How targets are placed.
#[derive(Clone, Copy)]
pub(super) struct Plan<'a> {
    pub(super) every: usize,
    pub(super) step_m: f64,
    pub(super) methods: &'a [Method],
    pub(super) rooms: &'a Rooms,
}

/// Spans are not in the thesis.
const RECOVERED: &str = "spans are recovered from the thesis' oracle rows, not published";

pub(super) fn run(
    table: &mut Table,
    scenes: &[Scene],
    plan: Plan<'_>,
    context: Context<'_>,
) -> Result<()> {
    for scene in scenes {
        on_real_poses(table, scene, plan, context)?;
    }
    for scene in scenes {
        in_rooms(table, scene, plan, context)?;
    }
    Ok(())
}

/// What retrieval could at best reach, from real poses alone.
fn on_real_poses(
    table: &mut Table,
    scene: &Scene,
    plan: Plan<'_>,
    context: Context<'_>,
) -> Result<()> {
    let row = |map: &str, definition, note: Option<&str>| Row {
        map: map.to_owned(),
        column: &scene.name,
        provenance: Provenance::Measured,
        of: "",
        definition,
        note: note.map(str::to_owned),
    };
    let Some(real) = RealScene::open(scene, context.sources)? else {
        let why = context.sources.why_absent("7scenes-poses", "poses")?;
        row("dense map, oracle", None, None).push_absent(table, &why);
        return Ok(());
    };
    let queries = real.queries.all();
    let kept = real.references.sequence(&scene.kept)?;
    for (name, definition) in
        [("published", Definition::Published), ("corrected", Definition::Corrected)]
    {
        let grid = Grid::new(scene.span_m, plan.step_m, definition)?;
        let dense = dense_poses(kept, plan.every, &grid)?;
        let errors = PoseErrors::of_retrieval(&oracle(&queries, &dense)?, &dense, &queries)?;
        row("dense map, oracle", Some(name), Some(RECOVERED))
            .push_errors(table, &errors, context)?;
    }
    let sparse = Poses::SixDof(kept.to_vec());
    let errors = PoseErrors::of_retrieval(&oracle(&queries, &sparse)?, &sparse, &queries)?;
    row("sparse map, oracle", None, None).push_errors(table, &errors, context)
}

/// One sequence and the grids around every so many-th of its images.
fn dense_poses(sequence: &[Pose], every: usize, grid: &Grid) -> Result<Poses> {
    let anchors = Anchors::every(sequence, &sequences(None, sequence.len()), every)?;
    let targets = Targets::around(&anchors, grid)?;
    let all = sequence.iter().copied().chain(targets.iter().map(|it| it.pose));
    Ok(Poses::SixDof(all.collect()))
}

fn in_rooms(table: &mut Table, scene: &Scene, plan: Plan<'_>, context: Context<'_>) -> Result<()> {
    for encoder in &plan.rooms.encoders {
        let methods: Vec<Method> = plan.methods.iter().map(|it| it.at(encoder)).collect();
        for &paths in &plan.rooms.paths {
            let of = Rooms::label(encoder, paths);
            let row = |map: &str, definition, note| Row {
                map: map.to_owned(),
                column: &scene.name,
                provenance: Provenance::Generated,
                of: &of,
                definition,
                note,
            };
            let room = match plan.rooms.open(scene, encoder, paths, context)? {
                Ok(room) => room,
                Err(why) => {
                    row("sparse map", None, None).push_absent(table, &why);
                    continue;
                }
            };
            let sparse = selected(&room.references.map, &room.kept.clone().collect::<Vec<_>>())?;
            let anchors = Anchors::every(
                sparse.poses().six_dof()?,
                &sequences(None, sparse.len()),
                plan.rooms.every,
            )?;
            let grid = Grid::new(scene.span_m, plan.step_m, Definition::Corrected)?;
            let targets = Targets::around(&anchors, &grid)?;
            let (queries, targets) = (&room.queries.map, &targets);
            Setting { sparse: &sparse, queries, targets }.push(table, &methods, row, context)?;
        }
    }
    Ok(())
}
