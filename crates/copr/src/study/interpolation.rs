//! Images left out between every so many-th: table 6.3.

use vpr_core::{Poses, Provenance};
use vpr_report::table::Table;

use super::{
    Context, Method, Rooms, Scene, calibration,
    dense::{densified, localize, remark, selected},
    real::RealScene,
    rooms::Room,
    rows::Row,
};
use crate::{Anchors, PoseErrors, Result, Targets, oracle};

/// Why the released numbers are a little too good.
const LEAK: &str = "the last image of a sequence is the anchor of the last segment and one of its \
                    targets, which so sees its own descriptor";

pub(super) fn run(
    table: &mut Table,
    scenes: &[Scene],
    (every, methods, rooms): (usize, &[Method], &Rooms),
    context: Context<'_>,
) -> Result<()> {
    for scene in scenes {
        on_real_poses(table, scene, every, context)?;
    }
    for scene in scenes {
        for encoder in &rooms.encoders {
            let methods: Vec<Method> = methods.iter().map(|it| it.at(encoder)).collect();
            for &paths in &rooms.paths {
                let of = Rooms::label(encoder, paths);
                match rooms.open(scene, encoder, paths, context)? {
                    Ok(room) => {
                        let one = OneRoom { scene, of: &of, room: &room, every: rooms.every };
                        one.run(table, &methods, context)?;
                    }
                    Err(why) => {
                        let one = Row {
                            map: "sparse map".to_owned(),
                            column: &scene.name,
                            provenance: Provenance::Generated,
                            of: &of,
                            definition: None,
                            note: None,
                        };
                        one.push_absent(table, &why);
                    }
                }
            }
        }
    }
    Ok(())
}

/// What retrieval could at best reach, from real poses alone.
fn on_real_poses(
    table: &mut Table,
    scene: &Scene,
    every: usize,
    context: Context<'_>,
) -> Result<()> {
    let row = |map: &str| Row {
        map: map.to_owned(),
        column: &scene.name,
        provenance: Provenance::Measured,
        of: "",
        definition: None,
        note: None,
    };
    let Some(real) = RealScene::open(scene, context.sources)? else {
        let why = context.sources.why_absent("7scenes-poses", "poses")?;
        row("dense map, oracle").push_absent(table, &why);
        return Ok(());
    };
    let queries = real.queries.all();
    let dense = real.references.all();
    let sequences: Vec<_> = real.references.sequences.iter().map(|it| it.1.clone()).collect();
    let anchors = Anchors::every(&real.references.poses, &sequences, every)?;
    let sparse = Poses::SixDof(anchors.poses().to_vec());
    for (map, references) in [("dense map, oracle", &dense), ("sparse map, oracle", &sparse)] {
        let errors =
            PoseErrors::of_retrieval(&oracle(&queries, references)?, references, &queries)?;
        row(map).push_errors(table, &errors, context)?;
    }
    Ok(())
}

/// One room as one encoder sees it.
struct OneRoom<'a> {
    scene: &'a Scene,
    of: &'a str,
    room: &'a Room,
    every: usize,
}

impl OneRoom<'_> {
    fn row(&self, map: &str, definition: Option<&'static str>, note: Option<String>) -> Row<'_> {
        let (map, column, of) = (map.to_owned(), &self.scene.name, self.of);
        Row { map, column, provenance: Provenance::Generated, of, definition, note }
    }

    fn run(&self, table: &mut Table, methods: &[Method], context: Context<'_>) -> Result<()> {
        let all = &self.room.references.map;
        let sequences = &self.room.references.sequences;
        let queries = &self.room.queries.map;
        let poses = all.poses().six_dof()?;
        let best = oracle(queries.poses(), all.poses())?;
        let errors = PoseErrors::of_retrieval(&best, all.poses(), queries.poses())?;
        self.row("dense map, oracle", None, None).push_errors(table, &errors, context)?;
        self.row("ground-truth map", None, None).push_errors(
            table,
            &localize(all, queries)?,
            context,
        )?;
        // As released: the last image of a sequence is an anchor that is not in the sparse map.
        let open = Anchors::every(poses, sequences, self.every)?;
        let closed = Anchors::every_and_last(poses, sequences, self.every)?;
        for (definition, kept) in [("published", &open), ("corrected", &closed)] {
            let sparse = selected(all, kept.rows())?;
            let sparse_errors = localize(&sparse, queries)?;
            self.row("sparse map", Some(definition), None).push_errors(
                table,
                &sparse_errors,
                context,
            )?;
            let left_out: Vec<usize> =
                (0..all.len()).filter(|row| !kept.rows().contains(row)).collect();
            let targets = Targets::frames(&closed, poses, &left_out)?;
            if definition == "corrected" {
                let what = (self.of, self.scene.name.as_str(), Provenance::Generated);
                calibration::push(table, what, methods, (all, &left_out, &targets))?;
            }
            for method in methods {
                let map = method.map();
                let ready = match method.ready(context)? {
                    Ok(ready) => ready,
                    Err(why) => {
                        self.row(&map, None, None).push_absent(table, &why);
                        continue;
                    }
                };
                // A method as released goes with the map as released; the others with both.
                if ready.definition.is_some_and(|it| it != definition) {
                    continue;
                }
                match densified(&sparse, all, &targets, &ready)? {
                    Ok((dense, told)) => {
                        let errors = localize(&dense, queries)?;
                        let leak = (definition == "published").then(|| LEAK.to_owned());
                        let row = self.row(&ready.map, Some(definition), remark(told).or(leak));
                        row.push_errors(table, &errors, context)?;
                        row.push_gain(table, &errors, &sparse_errors, context)?;
                    }
                    Err(why) => {
                        self.row(&map, Some(definition), None).push_absent(table, &why);
                    }
                }
            }
        }
        Ok(())
    }
}
