//! Sparse and dense maps under several encoders: table 6.4.

use std::path::PathBuf;

use vpr_core::{Definition, Provenance};
use vpr_report::table::{Cell, Table, Value};

use super::{
    Context, Method, Paths, Rooms, Scene,
    dense::{densified, localize, selected},
};
use crate::{Anchors, Grid, PoseErrors, Result, Targets, sequences};

/// Row of means over scenes.
const AVERAGE: &str = "Average";

pub(super) fn run(
    table: &mut Table,
    scenes: &[Scene],
    step_m: f64,
    rooms: &Rooms,
    context: Context<'_>,
) -> Result<()> {
    let mut columns = Vec::new();
    for encoder in &rooms.encoders {
        // Where `copr train regressor` puts the weights of this encoder's H.
        let weights = PathBuf::from(format!("models/copr-{encoder}.safetensors"));
        let network = Method::Network { weights, renormalise: false, anchors: None };
        columns.extend(["sparse map", "dense map"].map(|map| format!("{encoder}: {map}")));
        for scene in scenes {
            for &paths in &rooms.paths {
                one(table, scene, (encoder, paths), (step_m, rooms, &network), context)?;
            }
        }
    }
    for paths in &rooms.paths {
        for column in &columns {
            average(table, scenes, column, *paths);
        }
    }
    Ok(())
}

/// The row of a scene.
fn label(scene: &str, paths: Paths) -> String {
    format!("{scene}, {}", paths.name())
}

fn one(
    table: &mut Table,
    scene: &Scene,
    (encoder, paths): (&str, Paths),
    (step_m, rooms, network): (f64, &Rooms, &Method),
    context: Context<'_>,
) -> Result<()> {
    let row = label(&scene.name, paths);
    let column = |map: &str| format!("{encoder}: {map}");
    let room = match rooms.open(scene, encoder, paths, context)? {
        Ok(room) => room,
        Err(why) => {
            for map in ["sparse map", "dense map"] {
                table.push(Cell::absent(&row, column(map), &why));
            }
            return Ok(());
        }
    };
    let mut push = |map: &str, errors: &PoseErrors| -> Result<()> {
        let mte = errors.accuracy(&context.resampling())?.mte_m;
        let cell = Cell::new(&row, column(map), mte.estimate, Provenance::Generated, errors.len());
        table.push(cell.within(mte.low, mte.high, "bootstrap over queries"));
        Ok(())
    };
    let queries = &room.queries.map;
    let sparse = selected(&room.references.map, &room.kept.clone().collect::<Vec<_>>())?;
    let sparse_errors = localize(&sparse, queries)?;
    push("sparse map", &sparse_errors)?;
    let anchors =
        Anchors::every(sparse.poses().six_dof()?, &sequences(None, sparse.len()), rooms.every)?;
    let grid = Grid::new(scene.span_m, step_m, Definition::Corrected)?;
    let targets = Targets::around(&anchors, &grid)?;
    let dense = match network.ready(context)? {
        Ok(ready) => densified(&sparse, &sparse, &targets, &ready)?,
        Err(why) => Err(why),
    };
    match dense {
        Ok((dense, _)) => {
            let errors = localize(&dense, queries)?;
            push("dense map", &errors)?;
            let gain = errors.mte_against(&sparse_errors, &context.resampling())?;
            let (name, provenance) = (column("dense minus sparse"), Provenance::Generated);
            let cell = Cell::new(&row, name, gain.estimate, provenance, errors.len());
            table.push(cell.within(gain.low, gain.high, "paired bootstrap over queries"));
        }
        Err(why) => table.push(Cell::absent(&row, column("dense map"), why)),
    }
    Ok(())
}

/// The mean of a column, if every scene has a value.
fn average(table: &mut Table, scenes: &[Scene], column: &str, paths: Paths) {
    let cell_of = |scene: &Scene| {
        let row = label(&scene.name, paths);
        table.cells.iter().find(|cell| cell.row == row && cell.column == *column)
    };
    let values: Option<Vec<(f64, usize)>> = scenes
        .iter()
        .map(|scene| {
            let cell = cell_of(scene)?;
            Some((cell.value.as_ref().and_then(Value::number)?, cell.n))
        })
        .collect();
    if let Some(values) = values.filter(|values| !values.is_empty()) {
        let mean = values.iter().map(|it| it.0).sum::<f64>() / values.len() as f64;
        let n = values.iter().map(|it| it.1).sum();
        table.push(Cell::new(label(AVERAGE, paths), column, mean, Provenance::Generated, n));
    }
}
