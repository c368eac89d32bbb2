//! What a query shares with the references around its own: figure 3.16.

use vpr_core::{
    Result,
    metrics::bootstrap::{Resampling, percentile_bootstrap},
};
use vpr_report::table::{Cell, Table};
use vpr_study::{ContactSheet, Frame, Tile};
use vpr_worlds::{World, named_recipe};

use super::{Context, may_be_shown, opened, share};

/// References on either side.
const REACH: usize = 2;
const COLUMNS: [&str; 2 * REACH + 1] = ["n − 2", "n − 1", "n", "n + 1", "n + 2"];

pub(super) fn run(
    table: &mut Table,
    sheet: &mut ContactSheet,
    datasets: &[String],
    context: Context<'_>,
) -> Result<()> {
    for id in datasets {
        let Some(dataset) = opened(table, id, "n", context)? else { continue };
        let world = World::open(&named_recipe(id)?, context.sources.cache(), &|| {})?;
        let shared = world.overlap()?;
        // Around the reference that shares most, ties by lower index; ends of the path are left out.
        let centre = |query: usize| {
            let row = shared.row(query);
            (0..row.len()).fold(0, |best, it| if row[it] > row[best] { it } else { best })
        };
        let inner = REACH..dataset.references.len().saturating_sub(REACH);
        let centres: Vec<(usize, usize)> = (0..dataset.queries.len())
            .map(|query| (query, centre(query)))
            .filter(|(_, centre)| inner.contains(centre))
            .collect();
        for (at, column) in COLUMNS.iter().enumerate() {
            let value = |index: usize| {
                let (query, centre) = centres[index];
                f64::from(shared[[query, centre + at - REACH]])
            };
            let mean = |indices: &[usize]| {
                Ok(indices.iter().map(|&it| value(it)).sum::<f64>() / indices.len() as f64)
            };
            let resampling = Resampling { seed: context.seed, ..Resampling::default() };
            let mean = percentile_bootstrap(centres.len(), &resampling, mean)?;
            let (provenance, n) = (dataset.provenance, centres.len());
            let cell = Cell::new(&dataset.name, *column, mean.estimate, provenance, n);
            table.push(cell.within(mean.low, mean.high, "bootstrap over queries"));
        }
        let Some(&(query, centre)) = centres.get(centres.len() / 2) else { continue };
        if !may_be_shown(&dataset) {
            continue;
        }
        let reference = |(at, column): (usize, &&str)| {
            let index = centre + at - REACH;
            Tile {
                image: dataset.references[index].clone(),
                name: format!("{column}: {index}"),
                frame: Frame::Neutral,
                remark: share(f64::from(shared[[query, index]])),
            }
        };
        let query = Tile::query(&dataset.queries, query, String::new());
        let tiles = std::iter::once(query).chain(COLUMNS.iter().enumerate().map(reference));
        sheet.add_row(dataset.name.clone(), tiles.collect());
    }
    Ok(())
}
