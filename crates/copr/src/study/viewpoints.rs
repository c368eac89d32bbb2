//! Which encoder finds the nearest camera, without any regressed row: figures 6.6 and 6.7.

use vpr_core::Provenance;
use vpr_report::{
    figure::{Curve, Figure, Panel},
    table::{Cell, Table},
};

use super::{Context, Paths, Rooms, Scene, dense::localize};
use crate::Result;

pub(super) fn run(
    table: &mut Table,
    scenes: &[Scene],
    rooms: &Rooms,
    context: Context<'_>,
) -> Result<Figure> {
    let mut figure = Figure::default();
    for &paths in &rooms.paths {
        let mut curves = Vec::new();
        for encoder in &rooms.encoders {
            curves.extend(of_encoder(table, scenes, (encoder, paths, rooms), context)?);
        }
        if !curves.is_empty() {
            let name = |(at, scene): (usize, &Scene)| (at as f64, scene.name.clone());
            figure.panels.push(Panel {
                title: format!("all references, {}", paths.name()),
                x_label: "scene".to_owned(),
                y_label: "MTE, m".to_owned(),
                x_ticks: scenes.iter().enumerate().map(name).collect(),
                curves,
                ..Panel::default()
            });
        }
    }
    Ok(figure)
}

fn of_encoder(
    table: &mut Table,
    scenes: &[Scene],
    (encoder, paths, rooms): (&str, Paths, &Rooms),
    context: Context<'_>,
) -> Result<Option<Curve>> {
    let row = format!("MTE, m: {}", Rooms::label(encoder, paths));
    let (mut points, mut band) = (Vec::new(), Vec::new());
    for (at, scene) in scenes.iter().enumerate() {
        match rooms.open(scene, encoder, paths, context)? {
            Ok(room) => {
                let errors = localize(&room.references.map, &room.queries.map)?;
                let mte = errors.accuracy(&context.resampling())?.mte_m;
                let provenance = Provenance::Generated;
                let cell = Cell::new(&row, &scene.name, mte.estimate, provenance, errors.len());
                table.push(cell.within(mte.low, mte.high, "bootstrap over queries"));
                points.push((at as f64, mte.estimate));
                band.push((mte.low, mte.high));
            }
            Err(why) => table.push(Cell::absent(&row, &scene.name, why)),
        }
    }
    let curve = Curve::new(encoder, points).of(Provenance::Generated).within(band);
    Ok((!curve.points.is_empty()).then_some(curve))
}
