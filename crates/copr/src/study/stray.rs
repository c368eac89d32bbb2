//! A reference from another room that looks more like the query than those of its own: figure 6.12,
//! as a count over all queries.

use ndarray::ArrayView1;
use vpr_core::{
    Map, Pose, Poses, Provenance,
    metrics::bootstrap::{Z_95, wilson_interval},
};
use vpr_report::table::{Cell, Table};

use super::{Context, Method, Paths, Rooms, Scene, dense::Ready, rooms::Room};
use crate::{Anchors, Result, Targets, regressed};

/// References of its own room that a query is given, as in the thesis.
const OWN: usize = 4;

pub(super) fn run(
    table: &mut Table,
    scenes: &[Scene],
    (methods, rooms): (&[Method], &Rooms),
    context: Context<'_>,
) -> Result<()> {
    for encoder in &rooms.encoders {
        for &paths in &rooms.paths {
            of_encoder(table, scenes, (encoder, paths), (methods, rooms), context)?;
        }
    }
    Ok(())
}

fn of_encoder(
    table: &mut Table,
    scenes: &[Scene],
    (encoder, paths): (&str, Paths),
    (methods, rooms): (&[Method], &Rooms),
    context: Context<'_>,
) -> Result<()> {
    let label = Rooms::label(encoder, paths);
    let mut opened = Vec::new();
    for scene in scenes {
        match rooms.open(scene, encoder, paths, context)? {
            Ok(room) => opened.push((scene, room)),
            Err(why) => {
                table.push(Cell::absent(
                    format!("strayed: sparse map / {label}"),
                    &scene.name,
                    why,
                ));
            }
        }
    }
    for (number, (scene, room)) in opened.iter().enumerate() {
        let strays: Vec<&Map> = opened
            .iter()
            .enumerate()
            .filter(|(other, _)| *other != number)
            .map(|(_, (_, room))| &room.references.map)
            .collect();
        let one = One { room, strays, every: rooms.every };
        let before = one.strayed(None)?;
        let push = |table: &mut Table, row: &str, strayed: &[bool]| -> Result<()> {
            let n = strayed.iter().filter(|it| **it).count();
            let share = wilson_interval(n, strayed.len(), Z_95)?;
            let row = format!("{row} / {label}");
            let provenance = Provenance::Generated;
            let cell = Cell::new(row, &scene.name, share.estimate, provenance, strayed.len());
            table.push(cell.within(share.low, share.high, "Wilson"));
            Ok(())
        };
        push(table, "strayed: sparse map", &before)?;
        for method in methods {
            let name = method.map();
            match method.at(encoder).ready(context)? {
                Ok(ready) => {
                    let after = one.strayed(Some(&ready))?;
                    let both = || before.iter().zip(&after);
                    push(table, &format!("strayed: {name}"), &after)?;
                    let mended: Vec<bool> = both().map(|(was, is)| *was && !is).collect();
                    push(table, &format!("no longer strayed: {name}"), &mended)?;
                }
                Err(why) => {
                    let row = format!("strayed: {name} / {label}");
                    table.push(Cell::absent(row, &scene.name, why));
                }
            }
        }
    }
    Ok(())
}

/// A room, and the references of all others.
struct One<'a> {
    room: &'a Room,
    strays: Vec<&'a Map>,
    every: usize,
}

impl One<'_> {
    /// For each query, whether some reference of another room looks more like it than the four
    /// sparsely sampled ones of its own that are nearest in space, and than what is regressed from the
    /// nearest of them at the query's pose.
    fn strayed(&self, ready: Option<&Ready>) -> Result<Vec<bool>> {
        let (queries, own) = (&self.room.queries.map, &self.room.references.map);
        let poses = own.poses().six_dof()?;
        let anchors = Anchors::every(poses, &self.room.references.sequences, self.every)?;
        let at: &[Pose] = queries.poses().six_dof()?;
        let expected = match ready {
            None => None,
            Some(ready) => {
                let targets = Targets::listed(&anchors, at)?;
                Some(regressed(own, &targets, &*ready.regressor, ready.options)?.0)
            }
        };
        let positions = Poses::SixDof(at.to_vec());
        (0..queries.len())
            .map(|query| {
                let seen = queries.descriptors().row(query);
                let near = anchors.nearest(positions.position(query), OWN)?;
                let mut best = f64::INFINITY;
                for anchor in near {
                    best = best.min(squared(seen, own.descriptors().row(anchors.rows()[anchor])));
                }
                if let Some(expected) = &expected {
                    best = best.min(squared(seen, expected.descriptors().row(query)));
                }
                let is_nearer =
                    |map: &&Map, row: usize| squared(seen, map.descriptors().row(row)) < best;
                Ok(self.strays.iter().any(|map| (0..map.len()).any(|row| is_nearer(map, row))))
            })
            .collect()
    }
}

fn squared(a: ArrayView1<'_, f32>, b: ArrayView1<'_, f32>) -> f64 {
    a.iter().zip(&b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum()
}
