//! Contact sheets of chapter 3: what is in the datasets, what a stage shows, what is matched and
//! what is not, how much consecutive images share.

mod consecutive;
mod examples;
mod samples;
mod stage;

use std::sync::Arc;

use serde::Deserialize;
use vpr_core::{Provenance, Result};
use vpr_data::Dataset;
use vpr_report::{
    page::Sheet,
    table::{Cell, Table},
};
use vpr_study::ContactSheet;

use super::Context;

/// What a sheet shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scene {
    /// A query and a correct reference of every dataset: figure 3.3.
    Samples,
    /// All images of one place on a stage: figures 3.5, 3.7, 3.8 and 3.9.
    Stage,
    /// A query of every dataset and what every technique finds for it: figure 3.12.
    Examples,
    /// A query and consecutive references, with what is shared: figure 3.16.
    Consecutive,
}

const LEGEND: &str = "Grey: a query, or an image that is neither right nor wrong; blue and ✓: correct \
    reference; vermilion and ✗: wrong reference. Images of real places are counted in the table and \
    not shown.";

pub(super) fn run(
    table: &mut Table,
    scene: Scene,
    datasets: &[String],
    context: Context<'_>,
) -> Result<Option<Sheet>> {
    let mut sheet = ContactSheet::default();
    match scene {
        Scene::Samples => samples::run(table, &mut sheet, datasets, context)?,
        Scene::Stage => stage::run(table, &mut sheet, datasets, context)?,
        Scene::Examples => examples::run(table, &mut sheet, datasets, context)?,
        Scene::Consecutive => consecutive::run(table, &mut sheet, datasets, context)?,
    }
    if sheet.is_empty() {
        return Ok(None);
    }
    Ok(Some(sheet.draw(LEGEND)?))
}

/// The images of a dataset, or a cell that says why there are none.
fn opened(
    table: &mut Table,
    id: &str,
    column: &str,
    context: Context<'_>,
) -> Result<Option<Arc<Dataset>>> {
    let found = context.images(id)?;
    if found.is_none() {
        let why = context.sources.why_absent(id, "images")?;
        table.push(Cell::absent(context.sources.entry(id)?.name, column, why));
    }
    Ok(found)
}

/// Pictures of real places are not ours to pass on.
fn may_be_shown(dataset: &Dataset) -> bool {
    dataset.provenance == Provenance::Generated
}

/// A number that is rounded for a tile.
fn share(value: f64) -> String {
    format!("{:.0} %", 100.0 * value)
}
