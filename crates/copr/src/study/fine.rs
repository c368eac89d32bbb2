//! Coarse to fine: a retrieval, then the pose between two descriptors; with and without densification
//! (thesis §6.2.4, 6.3.7).

use std::path::PathBuf;

use ndarray::Axis;
use vpr_core::{Definition, Map, Pose, Provenance, retrieve};
use vpr_report::table::Table;

use super::{
    Context, Method, Paths, Rooms, Scene,
    dense::{densified, selected},
    rows::Row,
};
use crate::{Anchors, Grid, PoseErrors, Result, Targets, net::PoseNetwork, sequences};

/// What is done in every room.
#[derive(Clone, Copy)]
pub(super) struct Plan<'a> {
    pub(super) step_m: f64,
    pub(super) method: &'a Method,
    /// Weights of the networks for poses; `{encoder}` stands for the encoder.
    pub(super) poses: &'a [PathBuf],
    pub(super) rooms: &'a Rooms,
}

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
    let of = Rooms::label(encoder, paths);
    let row = |map: String, definition| Row {
        map,
        column: &scene.name,
        provenance: Provenance::Generated,
        of: &of,
        definition,
        note: None,
    };
    let room = match plan.rooms.open(scene, encoder, paths, context)? {
        Ok(room) => room,
        Err(why) => {
            row("sparse map".to_owned(), None).push_absent(table, &why);
            return Ok(());
        }
    };
    let queries = &room.queries.map;
    let sparse = selected(&room.references.map, &room.kept.clone().collect::<Vec<_>>())?;
    let poses = sparse.poses().six_dof()?;
    let anchors = Anchors::every(poses, &sequences(None, sparse.len()), plan.rooms.every)?;
    let grid = Grid::new(scene.span_m, plan.step_m, Definition::Corrected)?;
    let targets = Targets::around(&anchors, &grid)?;
    let mut maps = vec![("sparse map", sparse.clone())];
    match plan.method.at(encoder).ready(context)? {
        Ok(ready) => match densified(&sparse, &sparse, &targets, &ready)? {
            Ok((dense, _)) => maps.push(("dense map", dense)),
            Err(why) => row("dense map".to_owned(), None).push_absent(table, &why),
        },
        Err(why) => row("dense map".to_owned(), None).push_absent(table, &why),
    }
    let best = maps
        .iter()
        .map(|(_, map)| Ok(retrieve(queries.descriptors(), map.descriptors(), 1)?.best()));
    let best = best.collect::<Result<Vec<Vec<usize>>>>()?;
    let mut coarse = Vec::new();
    for ((name, map), best) in maps.iter().zip(&best) {
        let errors = PoseErrors::of_retrieval(best, map.poses(), queries.poses())?;
        row(format!("{name}, coarse"), None).push_errors(table, &errors, context)?;
        coarse.push(errors);
    }
    let found = Found { maps: &maps, best: &best, coarse: &coarse, queries };
    for weights in plan.poses {
        let weights = PathBuf::from(weights.to_string_lossy().replace("{encoder}", encoder));
        if let Some(path) = context.sources.locate(&weights)? {
            found.push(table, &PoseNetwork::open(&path)?, &row, context)?;
        } else {
            let weights = weights.display();
            let why = format!("{weights} is not at hand; `copr train regressor` makes it");
            row("sparse map, fine".to_owned(), None).push_absent(table, &why);
        }
    }
    Ok(())
}

/// What was found in the sparse map and, if there is one, in the dense map.
struct Found<'a> {
    maps: &'a [(&'a str, Map)],
    /// The best row for every query.
    best: &'a [Vec<usize>],
    coarse: &'a [PoseErrors],
    queries: &'a Map,
}

impl Found<'_> {
    fn push<'r>(
        &self,
        table: &mut Table,
        network: &PoseNetwork,
        row: &dyn Fn(String, Option<&'static str>) -> Row<'r>,
        context: Context<'_>,
    ) -> Result<()> {
        let definition = match network.definition() {
            Definition::Published => "published",
            Definition::Corrected => "corrected",
        };
        let mut in_sparse: Option<PoseErrors> = None;
        for (number, (name, map)) in self.maps.iter().enumerate() {
            let poses = refined(network, (map, &self.best[number]), self.queries)?;
            let errors = PoseErrors::of_poses(&poses, self.queries.poses())?;
            let row = row(format!("{name}, fine"), Some(definition));
            row.push_errors(table, &errors, context)?;
            let coarse = (&errors, &self.coarse[number]);
            row.push_against(table, coarse, "the coarse pose", context)?;
            if let Some(sparse) = &in_sparse {
                let sparse = (&errors, sparse);
                row.push_against(table, sparse, "the sparse map's fine one", context)?;
            }
            in_sparse.get_or_insert(errors);
        }
        Ok(())
    }
}

/// The pose of every query by its best reference and the way from there.
fn refined(
    network: &PoseNetwork,
    (map, best): (&Map, &[usize]),
    queries: &Map,
) -> Result<Vec<Pose>> {
    let poses = map.poses().six_dof()?;
    let references = map.descriptors().view().select(Axis(0), best);
    let relative = network.relative(references.view(), queries.descriptors().view())?;
    Ok(best.iter().zip(relative).map(|(&row, way)| poses[row] * way).collect())
}
