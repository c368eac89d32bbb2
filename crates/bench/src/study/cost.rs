//! Times and sizes of techniques: table 3.6.

use serde::Deserialize;
use vpr_core::{Definition, Provenance, Result};
use vpr_report::{
    figure::Figure,
    table::{Cell, Table},
};
use vpr_vision::{cohog::CoHogParams, hog::HogParams};

use super::Context;
use vpr_study::{Runner, Technique};

/// The descriptor of a technique, as the thesis states it.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DescriptorShape {
    /// The technique.
    pub technique: Technique,
    /// Vectors per image.
    pub vectors: usize,
    /// Dimension of a vector.
    pub dim: usize,
    /// Bits of one number.
    pub bits: usize,
}

/// Images timed per technique.
const TIMED: usize = 40;

pub(super) fn run(
    table: &mut Table,
    timed_on: &[String],
    stored: &[String],
    descriptors: &[DescriptorShape],
    context: Context<'_>,
) -> Result<Option<Figure>> {
    times(table, timed_on, context)?;
    stored_times(table, stored, context)?;
    sizes(table, descriptors);
    Ok(None)
}

/// Times measured here, each apart from the other; only on request, since they vary.
fn times(table: &mut Table, timed_on: &[String], context: Context<'_>) -> Result<()> {
    networks(table);
    let images = if context.timings { context.first_images(timed_on)? } else { None };
    for Runner { column, technique, .. } in context.sources.runners()? {
        let Some(images) = &images else {
            for row in [ENCODING, MATCHING] {
                table.push(Cell::absent(row, *column, "measured on request: --timings"));
            }
            continue;
        };
        let paths = &images.queries[..images.queries.len().min(TIMED)];
        let timing = technique.time(paths)?;
        let provenance = images.provenance;
        let note = format!("median on one thread of this machine, {} images", images.name);
        for (row, value) in [(ENCODING, timing.encoding), (MATCHING, timing.matching * 1e3)] {
            let cell = Cell::new(row, *column, value, provenance, paths.len());
            table.push(cell.noted(&note).timing());
        }
    }
    Ok(())
}

/// The techniques that are not timed here.
fn networks(table: &mut Table) {
    for technique in Technique::ALL {
        let why = match technique {
            Technique::Hog | Technique::CoHog => continue,
            Technique::DenseVlad => "timed by experiments/peers/dense_vlad.py",
            _ => "its weights are not at hand; `bench methods` says where they are from",
        };
        for row in [ENCODING, MATCHING] {
            table.push(Cell::absent(row, technique.name(), why));
        }
    }
}

const ENCODING: &str = "t_e (s)";
const MATCHING: &str = "t_m, default (ms)";

/// Times that the authors stored with their matches.
fn stored_times(table: &mut Table, datasets: &[String], context: Context<'_>) -> Result<()> {
    for id in datasets {
        let name = &context.sources.entry(id)?.name;
        for technique in Technique::ALL {
            let rows = [
                format!("{ENCODING}, stored with {name}"),
                format!("t_m (ms), stored with {name}"),
            ];
            let Some(stored) = context.sources.stored(id, technique)? else {
                for row in rows {
                    let why = context.sources.why_absent(id, "stored matches")?;
                    table.push(Cell::absent(row, technique.name(), why));
                }
                continue;
            };
            let values = [stored.timing.encoding, stored.timing.matching * 1e3];
            let n = stored.scores.similarities().n_queries();
            for (row, value) in rows.into_iter().zip(values) {
                let cell = Cell::new(row, technique.name(), value, Provenance::Published, n);
                table.push(cell.noted(match technique {
                    Technique::ApGem | Technique::DenseVlad => {
                        "the same round number is stored with every dataset: a placeholder, it seems"
                    }
                    _ => "as the authors measured it; matching includes printing (VB-14)",
                }));
            }
        }
    }
    Ok(())
}

/// Sizes follow from the dimensions.
fn sizes(table: &mut Table, descriptors: &[DescriptorShape]) {
    for shape in descriptors {
        let note = "dimensions as the thesis states them";
        let column = shape.technique.name();
        size(table, column, *shape, None, Provenance::Published, note);
    }
    let hog = |params: HogParams| DescriptorShape {
        technique: Technique::Hog,
        vectors: 1,
        dim: params.dim(),
        bits: 32,
    };
    let released = "of our descriptor in the released configuration (VB-11)";
    let thesis = "of our descriptor in the thesis' configuration";
    size(
        table,
        "HOG",
        hog(HogParams::RELEASED),
        Some(Definition::Published),
        Provenance::Measured,
        released,
    );
    size(
        table,
        "HOG",
        hog(HogParams::THESIS),
        Some(Definition::Corrected),
        Provenance::Measured,
        thesis,
    );
    let params = CoHogParams::default();
    let cohog = DescriptorShape {
        technique: Technique::CoHog,
        vectors: params.n_regions(),
        dim: params.depth(),
        bits: 32,
    };
    size(table, "CoHOG", cohog, None, Provenance::Measured, "of our descriptor");
}

fn size(
    table: &mut Table,
    column: &str,
    shape: DescriptorShape,
    definition: Option<Definition>,
    provenance: Provenance,
    note: &str,
) {
    let DescriptorShape { technique, vectors, dim, bits } = shape;
    let kilobytes = (vectors * dim * bits / 8) as f64 / 1000.0;
    // CoHOG's dimensions are printed the other way round, depth first.
    let dimensions = match technique {
        Technique::CoHog => format!("{dim}×{vectors}"),
        _ => format!("{vectors}×{dim}"),
    };
    let cells = [
        Cell::new("Desc. Size (KBs)", column, kilobytes, provenance, 1),
        Cell::new("Desc. Dimensions", column, dimensions.as_str(), provenance, 1),
        Cell::new("Data Type", column, format!("float-{bits}").as_str(), provenance, 1),
    ];
    for cell in cells {
        let cell = cell.noted(note);
        table.push(match definition {
            Some(definition) => cell.defined(definition),
            None => cell,
        });
    }
}
