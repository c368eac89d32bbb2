//! All images of one place on a stage, in order: figures 3.5, 3.7, 3.8 and 3.9.

use vpr_core::Result;
use vpr_report::table::{Cell, Table};
use vpr_study::{ContactSheet, Frame, Tile};

use super::{Context, may_be_shown, opened};

/// Columns of a sheet.
const ACROSS: usize = 12;

pub(super) fn run(
    table: &mut Table,
    sheet: &mut ContactSheet,
    datasets: &[String],
    context: Context<'_>,
) -> Result<()> {
    for id in datasets {
        let Some(dataset) = opened(table, id, "images of one place", context)? else { continue };
        // The first half of the queries shows the place of the key frame.
        let place = &dataset.queries[..dataset.queries.len() / 2];
        let cell = |column: &str, n: usize| {
            let all = dataset.queries.len();
            Cell::new(&dataset.name, column, n as f64, dataset.provenance, all)
        };
        table.push(cell("images of one place", place.len()));
        table.push(cell("images of another", dataset.queries.len() - place.len()));
        if !may_be_shown(&dataset) {
            continue;
        }
        let tiles: Vec<Tile> = place
            .iter()
            .enumerate()
            .map(|(position, image)| Tile {
                image: image.clone(),
                name: format!("position {}", position + 1),
                frame: Frame::Neutral,
                remark: String::new(),
            })
            .collect();
        let mut title = dataset.name.clone();
        for tiles in tiles.chunks(ACROSS) {
            sheet.add_row(std::mem::take(&mut title), tiles.to_vec());
        }
    }
    Ok(())
}
