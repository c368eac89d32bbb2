//! Sizes of maps, and how long making and searching them takes: table 6.5.

use std::time::Instant;

use vpr_core::{Map, Provenance, retrieve};
use vpr_report::table::{Cell, Table};
use vpr_study::{Runner, technique::Found};

use super::{
    Context, Method, Paths, Place, Rooms, Scene,
    dense::{joined, selected},
    encoder,
    lanes::Opened,
    lesson::{self, Lesson},
};
use crate::{Anchors, Grid, Result, Targets, regressed, sequences};
use vpr_core::Definition;

const TRAIN: &str = "t_train, s";
const DENSIFY: &str = "t_dense, ms";
const ENCODE: &str = "t_enc, ms";
const MATCH: &str = "t_match, ms";
const RETRIEVE: &str = "t_retr, ms";
const SIZE: &str = "map size, rows";
/// Why a time is not there.
const ON_REQUEST: &str = "measured on request: --timings";
/// Times of which the median counts.
const REPEATS: usize = 5;
/// Images that are timed.
const TIMED: usize = 20;

pub(super) fn run(
    table: &mut Table,
    (scene, step_m, rooms): (&Scene, f64, &Rooms),
    places: &[Place],
    (method, steps): (&Method, Option<usize>),
    context: Context<'_>,
) -> Result<()> {
    for encoder in &rooms.encoders {
        let column = format!("{}, {}", scene.name, Rooms::label(encoder, Paths::Own));
        let (room, runner) =
            match (rooms.open(scene, encoder, Paths::Own, context)?, found(encoder, context)?) {
                (Ok(room), Ok(runner)) => (room, runner),
                (Err(why), _) | (_, Err(why)) => {
                    table.push(Cell::absent(row(SIZE, "sparse map"), column, why));
                    continue;
                }
            };
        let sparse = selected(&room.references.map, &room.kept.clone().collect::<Vec<_>>())?;
        let poses = sparse.poses().six_dof()?;
        let anchors = Anchors::every(poses, &sequences(None, sparse.len()), rooms.every)?;
        let grid = Grid::new(scene.span_m, step_m, Definition::Corrected)?;
        let targets = Targets::around(&anchors, &grid)?;
        let Ok(dataset) = rooms.images(scene, Paths::Own, context)? else { continue };
        let images = &dataset.queries[..dataset.queries.len().min(TIMED)];
        let timed =
            Timed { column, sparse: &sparse, queries: &room.queries.map, targets: &targets };
        timed.push(table, &method.at(encoder), (&runner, images), context)?;
        let Some(steps) = steps else { continue };
        let cell = if context.timings {
            let Lesson { seconds, step, of } = lesson::learn(&room, steps)?;
            let provenance = Provenance::Generated;
            let cell = Cell::new(TRAIN, &timed.column, seconds, provenance, room.queries.map.len());
            let note = format!("H until its best validation, step {step} of {of}, on this machine");
            cell.noted(note).timing()
        } else {
            Cell::absent(TRAIN, &timed.column, ON_REQUEST)
        };
        table.push(cell);
    }
    for place in places {
        let column = format!("{}, {}, generated", place.name, place.encoder);
        let runner = match found(&place.encoder, context)? {
            Ok(runner) => runner,
            Err(why) => {
                table.push(Cell::absent(row(SIZE, "sparse map"), column, why));
                continue;
            }
        };
        let opened = Opened::new((&place.world, &place.name), &runner, context)?;
        let poses = opened.references.poses().six_dof()?;
        let anchors = Anchors::every(poses, &sequences(None, poses.len()), 1)?;
        let targets = opened.targets(place.targets, &anchors)?;
        let dataset = context.bare.images(&place.world)?;
        let images = dataset.map(|it| it.queries[..it.queries.len().min(TIMED)].to_vec());
        let (sparse, queries) = (&opened.references, &opened.queries);
        let timed = Timed { column, sparse, queries, targets: &targets };
        let images = images.unwrap_or_default();
        timed.push(table, &method.at(&place.key), (&runner, &images), context)?;
    }
    Ok(())
}

fn found(encoder: &str, context: Context<'_>) -> Result<Result<Runner, String>> {
    Ok(match encoder::find(encoder, context.sources)? {
        Found::Runs(runner) => Ok(runner),
        Found::Absent(why) => Err(why),
    })
}

fn row(what: &str, map: &str) -> String {
    format!("{what}: {map}")
}

/// A map, its queries and its targets.
struct Timed<'a> {
    column: String,
    sparse: &'a Map,
    queries: &'a Map,
    targets: &'a Targets<'a>,
}

impl Timed<'_> {
    fn push(
        &self,
        table: &mut Table,
        method: &Method,
        (runner, images): (&Runner, &[std::path::PathBuf]),
        context: Context<'_>,
    ) -> Result<()> {
        let provenance = Provenance::Generated;
        let n_dense = self.sparse.len() + self.targets.len();
        for (map, n) in [("sparse map", self.sparse.len()), ("dense map", n_dense)] {
            table.push(Cell::new(row(SIZE, map), &self.column, n as f64, provenance, n));
        }
        let rows = [
            row(DENSIFY, "dense map"),
            ENCODE.to_owned(),
            row(MATCH, "sparse map"),
            row(MATCH, "dense map"),
            row(RETRIEVE, "sparse map"),
            row(RETRIEVE, "dense map"),
        ];
        let absent = |table: &mut Table, why: &str| {
            for row in &rows {
                table.push(Cell::absent(row, &self.column, why));
            }
        };
        if !context.timings {
            absent(table, ON_REQUEST);
            return Ok(());
        }
        let ready = match method.ready(context)? {
            Ok(ready) => ready,
            Err(why) => {
                absent(table, &why);
                return Ok(());
            }
        };
        let make = || regressed(self.sparse, self.targets, &*ready.regressor, ready.options);
        let (seconds, regressed) = median_of(REPEATS, make)?;
        let dense = joined(self.sparse, &regressed.0)?;
        let encode = runner.technique.time(images)?.encoding;
        let n = self.queries.len();
        let search = |map: &Map| -> Result<f64> {
            let once = || Ok(retrieve(self.queries.descriptors(), map.descriptors(), 1)?);
            Ok(median_of(REPEATS, once)?.0 / n as f64)
        };
        let found = [search(self.sparse)?, search(&dense)?];
        let values = [
            (seconds, "all targets at once, median of 5"),
            (encode, "one image on one thread, median"),
            (found[0], "per query, all queries at once on all threads, median of 5"),
            (found[1], "per query, all queries at once on all threads, median of 5"),
            (encode + found[0], "t_enc + t_match"),
            (encode + found[1], "t_enc + t_match"),
        ];
        for (row, (seconds, note)) in rows.iter().zip(values) {
            let cell = Cell::new(row, &self.column, 1e3 * seconds, provenance, n);
            table.push(cell.noted(format!("{note}, on this machine")).timing());
        }
        Ok(())
    }
}

/// Seconds, the median of some runs, and what the last of them gave.
fn median_of<T>(n: usize, mut run: impl FnMut() -> Result<T>) -> Result<(f64, T)> {
    let mut times = Vec::new();
    loop {
        let start = Instant::now();
        let value = run()?;
        times.push(start.elapsed().as_secs_f64());
        if times.len() >= n {
            return Ok((vpr_core::metrics::median(&times)?, value));
        }
    }
}
