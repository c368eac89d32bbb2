//! How few images keep the error: every so many-th stays, the others are regressed or missed.

use vpr_core::Provenance;
use vpr_report::{
    figure::{Curve, Figure, Panel},
    table::{Cell, Table},
};

use super::{
    Context, Method, Paths, Rooms, Scene,
    dense::{densified, localize, selected},
    rows::MTE,
};
use crate::{Anchors, PoseErrors, Result, Targets};

pub(super) fn run(
    table: &mut Table,
    scenes: &[Scene],
    (every, methods, rooms): (&[usize], &[Method], &Rooms),
    context: Context<'_>,
) -> Result<Figure> {
    let mut figure = Figure::default();
    for encoder in &rooms.encoders {
        for &paths in &rooms.paths {
            let mut curves = Vec::new();
            for scene in scenes {
                let plan = (every, methods, rooms);
                curves.push(of_scene(table, scene, (encoder, paths), plan, context)?);
            }
            let label = Rooms::label(encoder, paths);
            figure.panels.extend(panel(&label, curves));
        }
    }
    Ok(figure)
}

/// Name and error at every share of images that stay.
type Curves = Vec<(String, Vec<(f64, f64)>)>;

/// The mean of all scenes, curve by curve.
fn panel(label: &str, scenes: Vec<Curves>) -> Option<Panel> {
    let first = scenes.first().filter(|it| !it.is_empty())?;
    let mean = |curve: usize| {
        let point = |at: usize| {
            let of = |scene: &Curves| scene.get(curve)?.1.get(at).copied();
            let points: Option<Vec<(f64, f64)>> = scenes.iter().map(of).collect();
            let points = points?;
            let n = points.len() as f64;
            let sum = points.iter().fold((0.0, 0.0), |sum, it| (sum.0 + it.0, sum.1 + it.1));
            Some((sum.0 / n, sum.1 / n))
        };
        let points = (0..first[curve].1.len()).filter_map(point).collect();
        Curve::new(&first[curve].0, points).of(Provenance::Generated)
    };
    Some(Panel {
        title: format!("mean of {} scenes: {label}", scenes.len()),
        x_label: "share of images that stay".to_owned(),
        y_label: MTE.to_owned(),
        curves: (0..first.len()).map(mean).collect(),
        ..Panel::default()
    })
}

fn of_scene(
    table: &mut Table,
    scene: &Scene,
    (encoder, paths): (&str, Paths),
    (every, methods, rooms): (&[usize], &[Method], &Rooms),
    context: Context<'_>,
) -> Result<Curves> {
    let label = Rooms::label(encoder, paths);
    let mut out = Out { table, scene, label: &label, context };
    let room = match rooms.open(scene, encoder, paths, context)? {
        Ok(room) => room,
        Err(why) => {
            out.absent("all images", &why);
            return Ok(Vec::new());
        }
    };
    let (all, queries) = (&room.references.map, &room.queries.map);
    let poses = all.poses().six_dof()?;
    let full = localize(all, queries)?;
    let estimate = out.errors("all images", &full, None)?;
    let mut curves: Curves = std::iter::once("images that stay".to_owned())
        .chain(methods.iter().map(Method::map))
        .map(|name| (name, vec![(1.0, estimate)]))
        .collect();
    for &k in every {
        let anchors = Anchors::every_and_last(poses, &room.references.sequences, k)?;
        let sparse = selected(all, anchors.rows())?;
        let share = sparse.len() as f64 / all.len() as f64;
        let name = format!("one image in {k}");
        let sparse_errors = localize(&sparse, queries)?;
        let note = Some(format!("{} of {} images", sparse.len(), all.len()));
        let estimate = out.errors(&name, &sparse_errors, note)?;
        out.gain(&name, "all images", (&sparse_errors, &full))?;
        curves[0].1.push((share, estimate));
        let left_out: Vec<usize> =
            (0..all.len()).filter(|it| anchors.rows().binary_search(it).is_err()).collect();
        let targets = Targets::frames(&anchors, poses, &left_out)?;
        for (number, method) in methods.iter().enumerate() {
            let name = format!("{name}, {}", method.map());
            let dense = match method.at(encoder).ready(context)? {
                Ok(ready) => densified(&sparse, all, &targets, &ready)?,
                Err(why) => Err(why),
            };
            match dense {
                Ok((dense, _)) => {
                    let errors = localize(&dense, queries)?;
                    let estimate = out.errors(&name, &errors, None)?;
                    out.gain(&name, "all images", (&errors, &full))?;
                    out.gain(&name, "the images that stay", (&errors, &sparse_errors))?;
                    curves[1 + number].1.push((share, estimate));
                }
                Err(why) => out.absent(&name, &why),
            }
        }
    }
    Ok(curves)
}

/// Where cells go.
struct Out<'a> {
    table: &'a mut Table,
    scene: &'a Scene,
    label: &'a str,
    context: Context<'a>,
}

impl Out<'_> {
    /// Gives the median.
    fn errors(&mut self, what: &str, errors: &PoseErrors, note: Option<String>) -> Result<f64> {
        let mte = errors.accuracy(&self.context.resampling())?.mte_m;
        let row = format!("{MTE}: {what} / {}", self.label);
        let (column, n) = (&self.scene.name, errors.len());
        let cell = Cell::new(row, column, mte.estimate, Provenance::Generated, n);
        let cell = cell.within(mte.low, mte.high, "bootstrap over queries");
        self.table.push(Cell { note, ..cell });
        Ok(mte.estimate)
    }

    fn gain(
        &mut self,
        what: &str,
        than: &str,
        (ours, theirs): (&PoseErrors, &PoseErrors),
    ) -> Result<()> {
        let gain = ours.mte_against(theirs, &self.context.resampling())?;
        let row = format!("{MTE}, minus that of {than}: {what} / {}", self.label);
        let (column, n) = (&self.scene.name, ours.len());
        let cell = Cell::new(row, column, gain.estimate, Provenance::Generated, n);
        self.table.push(cell.within(gain.low, gain.high, "paired bootstrap over queries"));
        Ok(())
    }

    fn absent(&mut self, what: &str, why: &str) {
        let row = format!("{MTE}: {what} / {}", self.label);
        self.table.push(Cell::absent(row, &self.scene.name, why));
    }
}
