//! AUC-PR, size and matching time over descriptor size: table 3.9.

use std::sync::Arc;

use vpr_core::{Definition, Provenance, Result};
use vpr_data::Dataset;
use vpr_report::{
    figure::Figure,
    table::{Cell, Table},
};
use vpr_vision::{cohog::CoHogParams, hog::HogParams};

use vpr_study::{Describe as _, Direction, HandCrafted, Runner, Subject};

use super::Context;

/// What is swept.
pub(super) struct Sweep<'a> {
    pub(super) cell_sizes: &'a [usize],
    pub(super) pca_dimensions: &'a [usize],
    pub(super) max_region_pairs: f64,
}

/// Images timed per technique.
const TIMED: usize = 12;

pub(super) fn run(
    table: &mut Table,
    datasets: &[String],
    sweep: Sweep<'_>,
    context: Context<'_>,
) -> Result<Option<Figure>> {
    for &cell in sweep.cell_sizes {
        for (column, technique) in at_cell_size(cell) {
            let row = format!("{cell}x{cell}");
            let size = kilobytes(&technique);
            let note = "follows from the dimensions";
            let size = Cell::new(&row, format!("{column} KBs"), size, Provenance::Measured, 1);
            table.push(size.noted(note));
        }
    }
    for &dim in sweep.pca_dimensions {
        for column in ["NetVLAD", "DenseVLAD", "AP-GeM"] {
            let size = (dim * size_of::<f32>()) as f64 / 1000.0;
            let size = Cell::new(
                format!("PCA {dim}"),
                format!("{column} KBs"),
                size,
                Provenance::Published,
                1,
            );
            table.push(size.noted("follows from the dimension"));
        }
    }
    for id in datasets {
        let name = context.sources.entry(id)?.name.clone();
        for &cell in sweep.cell_sizes {
            let row = format!("{cell}x{cell}, {name}");
            let Some(dataset) = context.images(id)? else {
                for (column, _) in at_cell_size(cell) {
                    let why = context.sources.why_absent(id, "images")?;
                    table.push(Cell::absent(&row, format!("{column} AUC"), why));
                }
                continue;
            };
            for (column, technique) in at_cell_size(cell) {
                if is_too_large(&technique, &dataset, sweep.max_region_pairs) {
                    let why = "left out: more region pairs than the experiment allows";
                    table.push(Cell::absent(&row, format!("{column} AUC"), why));
                    continue;
                }
                measure(table, &row, column, &technique, &dataset, context)?;
            }
        }
    }
    Ok(None)
}

fn at_cell_size(cell: usize) -> [(&'static str, HandCrafted); 2] {
    [
        ("CoHOG", HandCrafted::CoHog(CoHogParams::with_cell_size(cell))),
        ("HOG", HandCrafted::Hog(HogParams::THESIS.with_cell_size(cell))),
    ]
}

fn kilobytes(technique: &HandCrafted) -> f64 {
    let numbers = match technique {
        HandCrafted::Hog(params) => params.dim(),
        HandCrafted::CoHog(params) => params.n_regions() * params.depth(),
        HandCrafted::Vlad(vlad) => vlad.encoder().dim(),
    };
    (numbers * size_of::<f32>()) as f64 / 1000.0
}

fn is_too_large(technique: &HandCrafted, dataset: &Dataset, max_region_pairs: f64) -> bool {
    let HandCrafted::CoHog(params) = technique else { return false };
    let pairs = dataset.queries.len() as f64 * dataset.references.len() as f64;
    pairs * (params.n_regions() as f64).powi(2) > max_region_pairs
}

fn measure(
    table: &mut Table,
    row: &str,
    column: &'static str,
    technique: &HandCrafted,
    dataset: &Dataset,
    context: Context<'_>,
) -> Result<()> {
    let runner = Runner {
        name: column.to_owned(),
        column,
        encoder: column.to_owned(),
        technique: Arc::new(technique.clone()),
    };
    let scores = context.sources.scores(&runner, dataset, Direction::AsReleased)?;
    let note = scores.note().map(str::to_owned);
    let truth = Arc::new(dataset.truth.clone());
    let subject = Subject::new(row, column, dataset.provenance, scores, truth)?.noted(note);
    let evaluation = subject.evaluation()?;
    for definition in [Definition::Published, Definition::Corrected] {
        let value = evaluation.auc_pr(definition);
        table.push(subject.value_cell(row, &format!("{column} AUC"), definition, value)?);
    }
    if context.timings {
        let paths = &dataset.queries[..dataset.queries.len().min(TIMED)];
        let milliseconds = technique.time(paths)?.matching * 1e3;
        let cell = Cell::new(
            row,
            format!("{column} t_m (ms)"),
            milliseconds,
            subject.provenance,
            paths.len(),
        );
        table.push(cell.timing());
    }
    Ok(())
}
