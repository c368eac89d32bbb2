//! What generated worlds do to techniques, and how far they are from real places: the page
//! `docs/results/worlds.md`.

mod dial;
mod gap;
mod light_stage;
mod likeness;

use serde::Deserialize;
use vpr_core::{
    Result,
    metrics::bootstrap::{Interval, Z_95, wilson_interval},
};
use vpr_report::{
    figure::Figure,
    table::{Cell, Table},
};

pub use gap::Domain;
pub use likeness::Likeness;

use vpr_study::{Dial, Direction, Runner, technique::HOG_THESIS};

use super::Context;

/// The parts of the page.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Worlds {
    /// Nuisances that are turned up one at a time.
    pub dials: Vec<Dial>,
    /// World of one key frame under many lights.
    pub light_stage: String,
    /// Domains at equal viewpoint change; each compared with the home it names.
    pub domains: Vec<Domain>,
    /// Real and generated sets to be told apart.
    pub likeness: Likeness,
}

pub(super) fn run(
    table: &mut Table,
    worlds: &Worlds,
    context: Context<'_>,
) -> Result<Option<Figure>> {
    let mut figure = Figure::default();
    for dial in &worlds.dials {
        dial::run(table, &mut figure, dial, context)?;
    }
    light_stage::run(table, &mut figure, &worlds.light_stage, context)?;
    gap::run(table, &worlds.domains, context)?;
    likeness::run(table, &mut figure, &worlds.likeness, context)?;
    Ok(Some(figure))
}

/// One configuration of each technique.
fn techniques(context: Context<'_>) -> Result<impl Iterator<Item = &Runner>> {
    Ok(context.sources.runners()?.iter().filter(|runner| runner.name != HOG_THESIS))
}

/// Recall@1 of a technique on a generated dataset, of the queries that have a correct reference,
/// with Wilson's interval; pushed as a cell.
fn recall(
    table: &mut Table,
    row: &str,
    id: &str,
    runner: &Runner,
    context: Context<'_>,
) -> Result<Option<Interval>> {
    let Some(dataset) = context.images(id)? else {
        table.push(Cell::absent(row, runner.column, context.sources.why_absent(id, "images")?));
        return Ok(None);
    };
    let scores = context.sources.scores(runner, &dataset, Direction::AsReleased)?;
    let correct = dataset.truth.judge(&scores.best().reference)?;
    let n_hits = correct.iter().filter(|&&is_correct| is_correct).count();
    let n = dataset.truth.n_known();
    let interval = wilson_interval(n_hits, n, Z_95)?;
    let cell = Cell::new(row, runner.column, interval.estimate, dataset.provenance, n);
    table.push(cell.within(interval.low, interval.high, "Wilson"));
    Ok(Some(interval))
}
