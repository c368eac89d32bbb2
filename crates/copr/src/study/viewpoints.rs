//! Which encoder finds the nearest camera, without any regressed row: figures 6.6 and 6.7.

use vpr_core::Provenance;
use vpr_report::{
    figure::{Curve, Figure, Panel, Shape},
    table::{Cell, Table},
};

use vpr_study::technique::Found;

use super::{Context, Paths, Place, Rooms, Scene, dense::localize, encoder, lanes::Opened};
use crate::Result;

pub(super) fn run(
    table: &mut Table,
    scenes: &[Scene],
    (rooms, places): (&Rooms, &[Place]),
    context: Context<'_>,
) -> Result<Figure> {
    let mut figure = Figure::default();
    if !places.is_empty() {
        figure.panels.push(elsewhere(table, places, rooms, context)?);
    }
    if scenes.is_empty() {
        return Ok(figure);
    }
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

/// Encoders at places of a kind that they have not seen.
fn elsewhere(
    table: &mut Table,
    places: &[Place],
    rooms: &Rooms,
    context: Context<'_>,
) -> Result<Panel> {
    let mut curves = Vec::new();
    for name in &rooms.encoders {
        let row = format!("MTE, m: {name}");
        let (mut points, mut band) = (Vec::new(), Vec::new());
        for (at, place) in places.iter().enumerate() {
            let runner = match encoder::find(name, context.sources)? {
                Found::Runs(runner) => runner,
                Found::Absent(why) => {
                    table.push(Cell::absent(&row, &place.name, why));
                    continue;
                }
            };
            let opened = Opened::new((&place.world, &place.name), &runner, context)?;
            let errors = localize(&opened.references, &opened.queries)?;
            let mte = errors.accuracy(&context.resampling())?.mte_m;
            let provenance = Provenance::Generated;
            let cell = Cell::new(&row, &place.name, mte.estimate, provenance, errors.len());
            table.push(cell.within(mte.low, mte.high, "bootstrap over queries"));
            points.push((at as f64, mte.estimate));
            band.push((mte.low, mte.high));
        }
        if !points.is_empty() {
            let curve = Curve::new(name, points).of(Provenance::Generated).within(band);
            curves.push(curve.shaped(Shape::Bars));
        }
    }
    let name = |(at, place): (usize, &Place)| (at as f64, place.name.clone());
    Ok(Panel {
        title: "all references, generated".to_owned(),
        x_label: "place".to_owned(),
        y_label: "MTE, m".to_owned(),
        x_ticks: places.iter().enumerate().map(name).collect(),
        curves,
        ..Panel::default()
    })
}
