//! Sizes of the datasets: table 3.1.

use std::path::PathBuf;

use vpr_core::{Provenance, Result};
use vpr_report::{
    figure::Figure,
    table::{Cell, Table},
};
use vpr_vision::image;

use super::Context;
use vpr_study::Technique;

pub(super) fn run(
    table: &mut Table,
    datasets: &[String],
    context: Context<'_>,
) -> Result<Option<Figure>> {
    for id in datasets {
        let row = context.sources.entry(id)?.name.clone();
        let images = context.images(id)?;
        let provenance = context.sources.provenance(id)?;
        let why = context.sources.why_absent(id, "images")?;
        if let Some(images) = images.as_deref() {
            for (column, paths) in
                [("Queries", &images.queries), ("References", &images.references)]
            {
                table.push(Cell::new(&row, column, paths.len() as f64, provenance, paths.len()));
            }
            table.push(resolution(&row, "Query Res.", &images.queries, provenance)?);
            table.push(resolution(&row, "Ref Res.", &images.references, provenance)?);
            continue;
        }
        match context.sources.ground_truth(id)? {
            Some(truth) => {
                let n = truth.len();
                let note = "rows of the published ground truth";
                let cell = Cell::new(&row, "Queries", n as f64, Provenance::Published, n);
                table.push(cell.noted(note));
            }
            None => table.push(Cell::absent(&row, "Queries", &why)),
        }
        match context.sources.stored(id, Technique::Hog)? {
            Some(stored) => {
                let n = stored.scores.similarities().n_references();
                let note = "columns of the stored score matrices";
                let cell = Cell::new(&row, "References", n as f64, Provenance::Published, n);
                table.push(cell.noted(note));
            }
            None => table.push(Cell::absent(&row, "References", &why)),
        }
        table.push(Cell::absent(&row, "Query Res.", &why));
        table.push(Cell::absent(&row, "Ref Res.", &why));
    }
    Ok(None)
}

/// The resolution of all images, or of most of them with a remark.
fn resolution(row: &str, column: &str, images: &[PathBuf], provenance: Provenance) -> Result<Cell> {
    let mut counts: Vec<((usize, usize), usize)> = Vec::new();
    for path in images {
        let size = image::probe(path)?;
        let size = (size.width, size.height);
        match counts.iter_mut().find(|(it, _)| *it == size) {
            Some((_, n)) => *n += 1,
            None => counts.push((size, 1)),
        }
    }
    counts.sort_by_key(|&(size, n)| (std::cmp::Reverse(n), size));
    let ((width, height), n) = counts[0];
    let text = format!("{width} × {height}");
    let cell = Cell::new(row, column, text.as_str(), provenance, images.len());
    let is_uniform = n == images.len();
    Ok(if is_uniform { cell } else { cell.noted(format!("{n} of {}", images.len())) })
}
