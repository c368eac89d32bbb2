//! The other lane of a street or an escalator: table 6.2.

use nalgebra::Vector3;
use vpr_core::{Error as CoreError, Map, Poses, Provenance};
use vpr_report::table::Table;
use vpr_study::{Runner, technique::Found};
use vpr_worlds::{Side, World, named_recipe};

use super::{
    Context, Method, Place,
    dense::{densified, joined, localize, remark},
    place::Aside,
    rows::Row,
};
use crate::{Anchors, Frame, PoseErrors, Result, Targets, oracle};

pub(super) fn run(
    table: &mut Table,
    places: &[Place],
    methods: &[Method],
    context: Context<'_>,
) -> Result<()> {
    for place in places {
        let of = format!("{}, generated", place.encoder);
        let row = |map: &str, definition, note| Row {
            map: map.to_owned(),
            column: &place.name,
            provenance: Provenance::Generated,
            of: &of,
            definition,
            note,
        };
        let runner = match context.sources.find(&place.encoder)? {
            Found::Runs(runner) => runner,
            Found::Absent(why) => {
                row("sparse map", None, None).push_absent(table, &why);
                continue;
            }
        };
        let opened = Opened::new(place, &runner, context)?;
        let (sparse, queries) = (&opened.references, &opened.queries);
        let poses = sparse.poses().six_dof()?;
        let anchors = Anchors::every(poses, &[0..poses.len()], 1)?;
        let targets = match place.targets {
            Aside::Lane([x, y, z]) => {
                Targets::lane(&anchors, Vector3::new(x, y, z), Frame::Camera)?
            }
            Aside::Views {} => {
                let views = opened.views.as_ref().ok_or(CoreError::Empty("further views"))?;
                Targets::listed(&anchors, views.poses().six_dof()?)?
            }
        };
        let sparse_errors = localize(sparse, queries)?;
        let mut dense = sparse.poses().clone();
        dense.extend(&Poses::SixDof(targets.iter().map(|it| it.pose).collect()))?;
        let best = oracle(queries.poses(), &dense)?;
        let errors = PoseErrors::of_retrieval(&best, &dense, queries.poses())?;
        row("dense map, oracle", None, None).push_errors(table, &errors, context)?;
        row("sparse map", None, None).push_errors(table, &sparse_errors, context)?;
        if let (Aside::Views {}, Some(views)) = (place.targets, &opened.views) {
            let errors = localize(&joined(sparse, views)?, queries)?;
            let row = row("dense map, 3D Model", None, None);
            row.push_errors(table, &errors, context)?;
            row.push_gain(table, &errors, &sparse_errors, context)?;
        }
        for method in methods {
            let map = method.map();
            let ready = match method.ready(context)? {
                Ok(ready) => ready,
                Err(why) => {
                    row(&map, None, None).push_absent(table, &why);
                    continue;
                }
            };
            match densified(sparse, sparse, &targets, &ready)? {
                Ok((dense, told)) => {
                    let errors = localize(&dense, queries)?;
                    let row = row(&map, ready.definition, remark(told));
                    row.push_errors(table, &errors, context)?;
                    row.push_gain(table, &errors, &sparse_errors, context)?;
                }
                Err(why) => row(&map, ready.definition, None).push_absent(table, &why),
            }
        }
    }
    Ok(())
}

/// A generated place as an encoder sees it.
struct Opened {
    queries: Map,
    references: Map,
    views: Option<Map>,
}

impl Opened {
    fn new(place: &Place, runner: &Runner, context: Context<'_>) -> Result<Self> {
        // Rendered and announced as any dataset, then opened for its further views.
        context.bare.images(&place.world)?;
        let world = World::open(&named_recipe(&place.world)?, context.bare.cache(), &|| {})?;
        let side = |side: Side| -> Result<Option<Map>> {
            let images = world.images(side)?;
            if images.is_empty() {
                return Ok(None);
            }
            let what = format!("{} on {}", runner.column, place.name);
            let rows = context.sources.features(runner, &images, &what)?.into_descriptors();
            let rows = rows.ok_or(CoreError::Empty("descriptors of one length"))?;
            Ok(Some(Map::new(rows, world.poses(side)?)?))
        };
        let need = |map: Option<Map>| map.ok_or(CoreError::Empty("images of a generated place"));
        Ok(Self {
            queries: need(side(Side::Queries)?)?,
            references: need(side(Side::References)?)?,
            views: side(Side::Grid)?,
        })
    }
}
