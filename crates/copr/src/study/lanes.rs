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
        let opened = Opened::new((&place.world, &place.name), &runner, context)?;
        let (sparse, queries) = (&opened.references, &opened.queries);
        let poses = sparse.poses().six_dof()?;
        let anchors = Anchors::every(poses, &sequences(None, poses.len()), 1)?;
        let targets = opened.targets(place.targets, &anchors)?;
        let methods: Vec<Method> = methods.iter().map(|it| it.at(&place.key)).collect();
        let setting = Setting { sparse, queries, targets: &targets };
        let sparse_errors = setting.push(table, &methods, row, context)?;
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
pub(super) struct Opened {
    pub(super) queries: Map,
    pub(super) references: Map,
    pub(super) views: Option<Map>,
}

impl Opened {
    pub(super) fn new(
        (world, name): (&str, &str),
        runner: &Runner,
        context: Context<'_>,
    ) -> Result<Self> {
        // Rendered and announced as any dataset, then opened for its further views.
        context.bare.images(world)?;
        let world = World::open(&named_recipe(world)?, context.bare.cache(), &|| {})?;
        let side = |side: Side| -> Result<Option<Map>> {
            let images = world.images(side)?;
            if images.is_empty() {
                return Ok(None);
            }
            let what = format!("{} on {name}", runner.column);
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

    /// Where descriptors are regressed.
    pub(super) fn targets<'a>(&self, aside: Aside, anchors: &'a Anchors) -> Result<Targets<'a>> {
        match aside {
            Aside::Lane([x, y, z]) => Targets::lane(anchors, Vector3::new(x, y, z), Frame::Camera),
            Aside::Views {} => {
                let views = self.views.as_ref().ok_or(CoreError::Empty("further views"))?;
                Targets::listed(anchors, views.poses().six_dof()?)
            }
        }
    }

    /// All its images as one map.
    fn whole(&self) -> Result<Map> {
        let both = joined(&self.references, &self.queries)?;
        self.views.as_ref().map_or(Ok(both.clone()), |views| joined(&both, views))
    }
}

impl Place {
    /// The places that its H learns from, each as one map, or why its encoder is not at hand.
    ///
    /// # Errors
    ///
    /// Places that cannot be rendered or described.
    pub fn lessons(&self, context: Context<'_>) -> Result<Result<Vec<Map>, String>> {
        let runner = match encoder::find(&self.encoder, context.sources)? {
            Found::Runs(runner) => runner,
            Found::Absent(why) => return Ok(Err(why)),
        };
        let of = |world: &String| Opened::new((world, &self.name), &runner, context)?.whole();
        self.learn.iter().map(of).collect::<Result<_>>().map(Ok)
    }
}
