//! Error against the step of a grid: figure 6.11.

use vpr_core::{Definition, Provenance};
use vpr_report::{
    figure::{Curve, Figure, Panel},
    table::{Cell, Table},
};

use super::{
    Context, Method, Paths, Rooms, Scene,
    dense::{densified, localize, selected},
};
use crate::{Anchors, Grid, Result, Targets, sequences};

pub(super) fn run(
    table: &mut Table,
    (scenes, steps_m): (&[Scene], &[f64]),
    (method, rooms): (&Method, &Rooms),
    context: Context<'_>,
) -> Result<Figure> {
    let mut figure = Figure::default();
    for encoder in &rooms.encoders {
        for &paths in &rooms.paths {
            let label = Rooms::label(encoder, paths);
            let mut curves = Vec::new();
            for scene in scenes {
                let plan = (steps_m, method, rooms);
                curves.extend(of_scene(table, scene, (encoder, paths), plan, context)?);
            }
            if !curves.is_empty() {
                figure.panels.push(Panel {
                    title: label,
                    x_label: "step of the grid, m".to_owned(),
                    y_label: "MTE, m".to_owned(),
                    curves,
                    ..Panel::default()
                });
            }
        }
    }
    Ok(figure)
}

/// One curve, if the scene and the method are at hand.
fn of_scene(
    table: &mut Table,
    scene: &Scene,
    (encoder, paths): (&str, Paths),
    (steps_m, method, rooms): (&[f64], &Method, &Rooms),
    context: Context<'_>,
) -> Result<Option<Curve>> {
    let row = format!("MTE, m: {} / {}", scene.name, Rooms::label(encoder, paths));
    let room = match rooms.open(scene, encoder, paths, context)? {
        Ok(room) => room,
        Err(why) => {
            table.push(Cell::absent(&row, "sparse map", why));
            return Ok(None);
        }
    };
    let ready = match method.at(encoder).ready(context)? {
        Ok(ready) => ready,
        Err(why) => {
            table.push(Cell::absent(&row, "sparse map", why));
            return Ok(None);
        }
    };
    let queries = &room.queries.map;
    let sparse = selected(&room.references.map, &room.kept.clone().collect::<Vec<_>>())?;
    let poses = sparse.poses().six_dof()?;
    let anchors = Anchors::every(poses, &sequences(None, sparse.len()), rooms.every)?;
    let (mut points, mut band) = (Vec::new(), Vec::new());
    for &step in steps_m {
        let grid = Grid::new(scene.span_m, step, Definition::Corrected)?;
        let targets = Targets::around(&anchors, &grid)?;
        let column = format!("step {step} m");
        match densified(&sparse, &sparse, &targets, &ready)? {
            Ok((dense, _)) => {
                let errors = localize(&dense, queries)?;
                let mte = errors.accuracy(&context.resampling())?.mte_m;
                let cell =
                    Cell::new(&row, column, mte.estimate, Provenance::Generated, errors.len());
                let n = targets.len();
                let cell = cell.within(mte.low, mte.high, "bootstrap over queries");
                table.push(cell.noted(format!("{n} regressed rows")));
                points.push((step, mte.estimate));
                band.push((mte.low, mte.high));
            }
            Err(why) => table.push(Cell::absent(&row, column, why)),
        }
    }
    let errors = localize(&sparse, queries)?;
    let mte = errors.accuracy(&context.resampling())?.mte_m;
    let cell = Cell::new(&row, "sparse map", mte.estimate, Provenance::Generated, errors.len());
    table.push(cell.within(mte.low, mte.high, "bootstrap over queries"));
    let curve = Curve::new(&scene.name, points).of(Provenance::Generated).within(band);
    Ok(Some(curve))
}
