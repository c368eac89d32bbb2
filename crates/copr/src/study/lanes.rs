//! The other lane of a street or an escalator: table 6.2.

use nalgebra::Vector3;
use vpr_core::{Error as CoreError, Map, Provenance};
use vpr_report::table::Table;
use vpr_study::{Runner, technique::Found};
use vpr_worlds::{Side, World, named_recipe};

use super::{
    Context, Method, Place,
    dense::{joined, localize},
    encoder,
    methods::Setting,
    place::Aside,
    rows::Row,
};
use crate::{Anchors, Frame, Result, Targets, sequences};

pub(super) fn run(
    table: &mut Table,
    places: &[Place],
    methods: &[Method],
    context: Context<'_>,
) -> Result<()> {
    for place in places {
        let of = format!("{}, generated", place.encoder);
        let row = |map: &str, definition, note: Option<String>| Row {
            map: map.to_owned(),
            column: &place.name,
            provenance: Provenance::Generated,
            of: &of,
            definition,
            note,
        };
        let runner = match encoder::find(&place.encoder, context.sources)? {
            Found::Runs(runner) => runner,
            Found::Absent(why) => {
                row("sparse map", None, None).push_absent(table, &why);
                continue;
            }
        };
        let opened = Opened::new(place, &runner, context)?;
        let (sparse, queries) = (&opened.references, &opened.queries);
        let poses = sparse.poses().six_dof()?;
        let anchors = Anchors::every(poses, &sequences(None, poses.len()), 1)?;
        let targets = match place.targets {
            Aside::Lane([x, y, z]) => {
                Targets::lane(&anchors, Vector3::new(x, y, z), Frame::Camera)?
            }
            Aside::Views {} => {
                let views = opened.views.as_ref().ok_or(CoreError::Empty("further views"))?;
                Targets::listed(&anchors, views.poses().six_dof()?)?
            }
        };
        let setting = Setting { sparse, queries, targets: &targets };
        let sparse_errors = setting.push(table, methods, row, context)?;
        if let (Aside::Views {}, Some(views)) = (place.targets, &opened.views) {
            let errors = localize(&joined(sparse, views)?, queries)?;
            let row = row("dense map, 3D Model", None, None);
            row.push_errors(table, &errors, context)?;
            row.push_gain(table, &errors, &sparse_errors, context)?;
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
